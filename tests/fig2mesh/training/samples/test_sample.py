"""Properties of samples: distances, points, cubes, masks and joints of one subject agree with its mesh."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, binary_fill_holes, map_coordinates

from fig2mesh.skeleton import BODY_PARTS, anchor_joints, part_centre
from fig2mesh.training.bodies.partition import partition
from fig2mesh.training.bodies.subject import Subject, draw_subject
from fig2mesh.training.drawing.scene import VIEWS
from fig2mesh.training.samples import sample as samples
from fig2mesh.training.samples.sample import MASK, POINTS, geometry
from fig2mesh.training.samples.sdf import signed_distance, signed_distance_torch
from tests.fig2mesh.training.figures import capsule_pack

NODES = 32
"""Edge of the dense grids here; real ones have twice as many, and take eight times as long."""

PIXEL = (np.arange(MASK) + 0.5) / MASK * 2 - 1


class Sample(NamedTuple):
    """A subject and its arrays, masks unpacked."""

    subject: Subject
    arrays: dict[str, NDArray[Any]]
    amodal: NDArray[np.bool_]
    visible: NDArray[np.bool_]


def _sample(subject: Subject) -> Sample:
    arrays = geometry(subject, np.random.default_rng(0), grids=True)
    unpacked = (np.unpackbits(arrays[f"mask_{name}"], axis=-1).astype(bool) for name in ("amodal", "visible"))
    return Sample(subject, arrays, *unpacked)


@pytest.fixture(scope="module", autouse=True)
def coarse_grids() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(samples, "GRID", NODES)
        yield


@pytest.fixture(scope="module")
def sample(coarse_grids: None) -> Sample:
    """Seed of the first subject who wears a skirt."""
    subject = next(s for s in (draw_subject(capsule_pack(), "train", k) for k in range(60)) if len(s.skirt_faces))
    return _sample(subject)


@pytest.fixture(scope="module")
def cut(sample: Sample) -> Sample:
    """The same subject in parts that do not reach into each other."""
    return _sample(replace(sample.subject, parts=partition(sample.subject.rig, 0)))


def test_shapes_and_types_are_those_of_the_shards(sample: Sample) -> None:
    assert {name: (value.shape, value.dtype.name) for name, value in sample.arrays.items()} == {
        "joints": ((21, 3), "float32"),
        "centre": ((14, 3), "float32"),
        "edge": ((14,), "float32"),
        "size": ((14, 3), "float32"),
        "points": ((14, 2 * POINTS, 3), "float16"),
        "distance": ((14, 2 * POINTS), "float16"),
        "mask_amodal": ((4, 14, 64, 8), "uint8"),
        "mask_visible": ((4, 14, 64, 8), "uint8"),
        "grid": ((14, NODES, NODES, NODES), "float16"),
    }


def test_as_many_points_inside_as_outside_at_distances_of_the_mesh(sample: Sample) -> None:
    """Measured a second time, by other means than those that made them, at the points as they are stored."""
    distance = sample.arrays["distance"]
    assert (distance[:, :POINTS] <= 0).all()
    assert (distance[:, POINTS:] >= 0).all()
    for part in sample.subject.parts[::3]:
        row = part.part - 1
        vertices, faces = part.solid(sample.subject.vertices)
        local = 2 * (vertices - sample.arrays["centre"][row]) / sample.arrays["edge"][row]
        some = np.r_[0:60, POINTS : POINTS + 60]
        found = signed_distance_torch(local, faces, sample.arrays["points"][row][some].astype(np.float32))
        # Half precision has 11 bits.
        np.testing.assert_allclose(distance[row][some], found, rtol=1e-3, atol=1e-4)


def test_distances_never_change_faster_than_places(sample: Sample) -> None:
    rng = np.random.default_rng(1)
    points, distance = (sample.arrays[name].astype(np.float64) for name in ("points", "distance"))
    for row in range(14):
        a, b = rng.integers(2 * POINTS, size=(2, 20_000))
        apart = np.linalg.norm(points[row, a] - points[row, b], axis=1)
        # Each distance is rounded to 11 bits.
        rounding = 2.0**-11 * (np.abs(distance[row, a]) + np.abs(distance[row, b])) + 1e-6
        assert (np.abs(distance[row, a] - distance[row, b]) <= apart + rounding).all()


def test_dense_grids_agree_with_the_points(sample: Sample) -> None:
    spacing = 2 / (NODES - 1)
    for row in range(14):
        points = sample.arrays["points"][row].astype(np.float64)
        blended = map_coordinates(sample.arrays["grid"][row].astype(np.float64), (points.T + 1) / spacing, order=1)
        difference = np.abs(blended - sample.arrays["distance"][row])
        # Trilinear interpolation of a field of slope 1 errs most on its ridges, by less than a node's spacing.
        assert difference.max() < spacing
        assert difference.mean() < 0.1 * spacing


def test_the_cube_holds_the_part_and_is_centred_on_its_anchors(sample: Sample) -> None:
    grid = sample.arrays["grid"]
    shell = np.ones((NODES,) * 3, bool)
    shell[1:-1, 1:-1, 1:-1] = False
    assert (grid[:, shell] > 0).all()
    for part in sample.subject.parts:
        vertices, _ = part.solid(sample.subject.vertices)
        row = part.part - 1
        local = 2 * (vertices - sample.arrays["centre"][row]) / sample.arrays["edge"][row]
        assert np.abs(local).max() == pytest.approx(1 / samples.MARGIN, abs=1e-5)
        np.testing.assert_allclose(sample.arrays["size"][row], np.ptp(vertices, axis=0), atol=1e-5)
        centre = part_centre(part.part, sample.subject.joints)
        np.testing.assert_allclose(sample.arrays["centre"][row], centre, atol=1e-6)


def test_joints_lie_in_their_parts(sample: Sample) -> None:
    for part in sample.subject.parts:
        joints = sample.subject.joints[list(anchor_joints(part.part))]
        assert (signed_distance(*part.solid(sample.subject.vertices), joints) < 0.02).all()


@pytest.mark.parametrize("view", [0, 1])
def test_masks_are_the_silhouettes_of_the_fields(sample: Sample, cut: Sample, view: int) -> None:
    """Field and mask of parts without overlap agree; the rings by which real ones overlap are not drawn."""
    nodes = np.linspace(-1, 1, NODES)
    column, row, depth = np.meshgrid(PIXEL, -PIXEL, nodes)
    points = np.stack([column, row, depth], axis=-1) @ VIEWS[view]
    where = np.moveaxis((points + 1) * (NODES - 1) / 2, -1, 0)
    agreement = []
    for part in range(14):
        field = map_coordinates(cut.arrays["grid"][part].astype(np.float32), where, order=1).min(axis=2)
        # Masks are drawn from a part's own faces: seen along a limb, its open ends are a hole.
        own = binary_fill_holes(cut.amodal[view, part])
        agreement.append(((field < 0) & own).sum() / ((field < 0) | own).sum())
        # With rings the field reaches further than what is drawn, but nowhere less far than by half a node's spacing.
        field = map_coordinates(sample.arrays["grid"][part].astype(np.float32), where, order=1).min(axis=2)
        own = sample.amodal[view, part]
        assert field[own].max() < 1 / (NODES - 1), part
        assert (field < 0).sum() > own.sum(), part
    # Half as many nodes as real grids have lose the ragged rims of cuts.
    assert min(agreement) > 0.85
    assert np.mean(agreement) > 0.93


def test_what_is_seen_is_part_of_the_whole_and_never_two_parts_at_once(sample: Sample) -> None:
    assert not (sample.visible & ~sample.amodal).any()
    assert sample.visible.sum() < sample.amodal.sum()
    for view, turn in enumerate(VIEWS):
        centre, edge = sample.arrays["centre"] @ turn.T, sample.arrays["edge"]
        for part in range(14):
            rows, columns = np.nonzero(sample.visible[view, part])
            here = centre[part, :2] + edge[part] / 2 * np.stack([PIXEL[columns], -PIXEL[rows]], axis=1)
            for other in set(range(14)) - {part}:
                there = 2 * (here - centre[other, :2]) / edge[other]
                pixel = np.floor((there * [1, -1] + 1) * MASK / 2).astype(int)
                inside = ((pixel >= 0) & (pixel < MASK)).all(axis=1)
                # Squares of different size round differently along a common edge: it is left out.
                core = binary_erosion(sample.visible[view, other], np.ones((3, 3)))
                assert not core[pixel[inside, 1], pixel[inside, 0]].any(), (view, part, other)


def test_opposite_views_are_mirror_images(sample: Sample) -> None:
    np.testing.assert_array_equal(sample.amodal[2], sample.amodal[0][:, :, ::-1])
    np.testing.assert_array_equal(sample.amodal[3], sample.amodal[1][:, :, ::-1])
    assert (sample.visible[2] != sample.visible[0][:, :, ::-1]).any()


def test_a_seed_makes_the_same_bytes() -> None:
    first, again, other = (
        geometry(draw_subject(capsule_pack(), "train", seed), np.random.default_rng(seed)) for seed in (5, 5, 6)
    )
    assert {name: value.tobytes() for name, value in first.items()} == {n: v.tobytes() for n, v in again.items()}
    assert all(first[name].tobytes() != other[name].tobytes() for name in first)


def test_open_parts_are_refused() -> None:
    with pytest.raises(ValueError, match="not closed"):
        samples._choose(np.zeros(0, int), np.random.default_rng(0))


def test_every_part_of_the_body_has_a_row(sample: Sample) -> None:
    assert [part.part for part in sample.subject.parts] == list(BODY_PARTS)
    assert sample.amodal.any(axis=(2, 3)).all()
