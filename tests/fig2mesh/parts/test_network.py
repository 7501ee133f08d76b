"""Inputs of the part networks, and the use of their outputs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.nets.part_size import PartSizeNet, SizeShape
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.network import MASK, MIN_EDGE, ROOM, hidden_parts, network_inputs, part_cubes, part_mask
from fig2mesh.parts.split import Layer, Split
from fig2mesh.records import PartSdf
from fig2mesh.skeleton import BODY_PARTS, KINDS, PART, part_centre

PITCH = 0.01
SIDE = 241
CORNER = (-1.2, 1.2)
L_HAND, R_HAND, HEAD = PART["l_hand"], PART["r_hand"], PART["head"]


def blank(sdf: NDArray[np.float64] | None = None) -> Canvas:
    shape = (SIDE, SIDE)
    return Canvas(np.ones(shape) if sdf is None else sdf, np.zeros(shape, np.uint8), CORNER, PITCH)


def disc(centre: tuple[float, float], radius: float) -> NDArray[np.bool_]:
    return np.asarray(np.hypot(*np.moveaxis(blank().points() - centre, -1, 0)) < radius)


@pytest.fixture(scope="module")
def sizes() -> dict[str, PartSizeNet]:
    """Untrained networks: their output is arbitrary."""
    return {kind: PartSizeNet(SizeShape(kind)) for kind in KINDS}


def joints() -> NDArray[np.float64]:
    return np.random.default_rng(0).uniform(-0.5, 0.5, (21, 3))


@pytest.mark.parametrize("edge", [0.25, 0.6, 1.6])
def test_the_mask_of_a_disc_is_a_disc_where_it_should_be(edge: float) -> None:
    centre, radius = np.array([0.1, -0.2, 0.5]), 0.3 * edge
    shift = np.array([0.1 * edge, -0.08 * edge])
    mask = part_mask(blank(), disc((0.1 + shift[0], -0.2 + shift[1]), radius), centre, edge)
    pixel = (np.arange(MASK) + 0.5) / MASK * 2 - 1
    x, y = np.meshgrid(pixel, -pixel)
    expected = np.hypot(x - 0.2, y + 0.16) < 0.6
    assert mask.shape == (64, 64)
    assert (mask & expected).sum() / (mask | expected).sum() > 0.93
    rows, columns = np.nonzero(mask)
    assert pixel[columns].mean() == pytest.approx(0.2, abs=0.02)
    assert -pixel[rows].mean() == pytest.approx(-0.16, abs=0.02)


def test_thin_strokes_survive_a_large_cube_and_nothing_gives_nothing() -> None:
    stroke = np.zeros((SIDE, SIDE), bool)
    stroke[100:140, 118:122] = True
    assert part_mask(blank(), stroke, np.zeros(3), 2.4).any()
    assert not part_mask(blank(), np.zeros_like(stroke), np.zeros(3), 2.4).any()


def test_cubes_hold_what_is_drawn(sizes: dict[str, PartSizeNet]) -> None:
    """However wrong a size network is."""
    places = joints()
    regions = {part: np.zeros((SIDE, SIDE), bool) for part in BODY_PARTS}
    centre = part_centre(L_HAND, places)
    regions[L_HAND] = disc((centre[0] + 0.3, centre[1] - 0.1), 0.2)
    cubes = part_cubes(blank(), regions, places, sizes)
    assert list(cubes) == list(BODY_PARTS)
    found, edge = cubes[L_HAND]
    np.testing.assert_allclose(found, centre)
    assert edge / 2 >= ROOM * 0.5
    drawn = part_mask(blank(), regions[L_HAND], found, edge)
    assert drawn.sum() * (edge / MASK) ** 2 == pytest.approx(np.pi * 0.2**2, rel=0.05)
    rim = np.ones_like(drawn)
    rim[1:-1, 1:-1] = False
    assert not drawn[rim].any()
    assert all(edge >= MIN_EDGE for _, edge in cubes.values())


def test_a_hidden_part_is_as_large_as_its_twin(sizes: dict[str, PartSizeNet]) -> None:
    places = joints()
    regions = {part: np.zeros((SIDE, SIDE), bool) for part in BODY_PARTS}
    alone = part_cubes(blank(), regions, places, sizes)
    regions[L_HAND] = disc((float(places[0, 0]), float(places[0, 1])), 0.25)
    regions[HEAD] = disc((0.0, 0.0), 0.25)
    cubes = part_cubes(blank(), regions, places, sizes)
    assert cubes[R_HAND][1] == cubes[L_HAND][1]
    np.testing.assert_array_equal(cubes[R_HAND][0], part_centre(R_HAND, places))
    for part in set(BODY_PARTS) - {L_HAND, R_HAND, HEAD}:
        assert cubes[part][1] == alone[part][1]


def test_anchors_are_told_in_the_cube_and_specks_count_as_hidden(sizes: dict[str, PartSizeNet]) -> None:
    labels = np.zeros((SIDE, SIDE), np.uint8)
    labels[disc((0.3, 0.3), 0.2)] = L_HAND
    labels[10, 10:13] = R_HAND
    layer = Layer("core", labels > 0, labels, None, labels > 0)
    places = joints()
    inputs = network_inputs(blank(), Split((layer,), (), labels < 0, labels), places, sizes)
    assert inputs[L_HAND].mask.any()
    assert not inputs[R_HAND].mask.any()
    for part, given in inputs.items():
        middle = given.anchors.mean(axis=0)
        assert given.anchors.shape == (4 if part == PART["torso"] else 2, 3)
        if part != HEAD:  # whose cube is centred on one of its anchors
            np.testing.assert_allclose(middle, 0, atol=1e-12)


def test_hidden_parts_stay_inside_the_silhouette_and_hang_on_what_is_shown() -> None:
    points = blank().points()
    canvas = blank(np.hypot(points[..., 0], points[..., 1]) - 0.3)
    axis = np.linspace(-0.5, 0.5, 40)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    ball = (np.sqrt(x**2 + y**2 + z**2) - 0.25).astype(np.float32)

    def field(part: int, place: tuple[float, float, float], observed: bool = False) -> PartSdf:
        return PartSdf(part, ball, np.array(place, np.float32), 1.0, observed)

    shown = (field(3, (0.0, 0, 0), True),)
    behind, beyond, outside = field(4, (0.2, 0, -0.2)), field(5, (0.1, 0, -0.6)), field(6, (0.9, 0, 0))
    floating = field(7, (0, 0, -1.5))
    labels = np.zeros((SIDE, SIDE), np.uint8)
    free = Split((), (), np.zeros((SIDE, SIDE), bool), labels)
    found = hidden_parts((*shown, behind, beyond, outside, floating), shown, canvas, free)
    # The one beyond touches nothing that is shown, but the one behind, which does.
    assert [part.part for part in found] == [4, 5]
    inside = found[0].grid < 0
    assert inside.sum() < (ball < 0).sum()
    assert (np.hypot(x[inside] + 0.2, y[inside]) < 0.3).all()
    assert (inside <= (ball < 0)).all()
    # Where the outline is far, nothing is cut.
    kept = np.hypot(x + 0.2, y) < 0.2
    np.testing.assert_array_equal(inside[kept], (ball < 0)[kept])
    # Cloth hides what is under it.
    covered = Split((), (), np.ones((SIDE, SIDE), bool), labels)
    assert hidden_parts((behind,), shown, canvas, covered) == ()
