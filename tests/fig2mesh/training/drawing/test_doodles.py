"""Doodles, worn things and the views made of them: joints where their parts are, the same seed the same picture."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.skeleton import JOINT, JOINT_MIRROR, PART
from fig2mesh.training.drawing.crop import ALLOWED, Crop, cut, visible_joints
from fig2mesh.training.drawing.doodles import STYLES, doodle, stance
from fig2mesh.training.drawing.draw import Layers
from fig2mesh.training.drawing.thing_shapes import Thing
from fig2mesh.training.drawing.worn import put_on
from fig2mesh.training.samples.crop_data import Crops
from fig2mesh.training.samples.crop_views import OTHER_SIDE, CropViewer


def some(count: int, seed: int = 0) -> list[Crop]:
    rng = np.random.default_rng(seed)
    made = [doodle(stance(rng), rng) for _ in range(count)]
    return [crop for crop in made if crop is not None]


@pytest.fixture(scope="module")
def crops() -> list[Crop]:
    return some(24)


def test_the_seed_decides(crops: list[Crop]) -> None:
    for crop, again in zip(crops[:3], some(3), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(crop, again, strict=True))


def test_visible_joints_lie_on_their_own_parts(crops: list[Crop]) -> None:
    for crop in crops:
        for index in np.flatnonzero(crop.visible):
            column, row = crop.joints[index].astype(int)
            near = crop.labels[max(row - 6, 0) : row + 7, max(column - 6, 0) : column + 7]
            assert ALLOWED[index, near].any()


def test_what_is_drawn_is_labelled(crops: list[Crop]) -> None:
    for crop in crops:
        drawn = crop.rgba[..., 3] > 128
        assert (crop.labels[drawn] > 0).mean() > 0.9
        assert len(np.unique(crop.labels)) > 8


def test_figures_fill_their_crops(crops: list[Crop]) -> None:
    for crop in crops:
        rows, columns = (np.flatnonzero((crop.labels > 0).any(axis=axis)) for axis in (1, 0))
        assert 215 < max(np.ptp(rows), np.ptp(columns)) + 1 < 240


def test_there_are_all_manners() -> None:
    assert sum(STYLES.values()) == pytest.approx(1)


def test_a_cut_keeps_places() -> None:
    labels = np.zeros((100, 80), np.uint8)
    labels[20:60, 30:50] = 1
    rgba = np.zeros((100, 80, 4), np.uint8)
    rgba[20:60, 30:50] = 255
    crop = cut(rgba, labels, np.array([[30.0, 20.0], [50.0, 60.0]]), np.ones(2, bool), 0.0)
    assert crop is not None
    assert crop.joints.tolist() == [[64.0, 0.0], [192.0, 256.0]]
    assert (crop.labels[:, 66:190] == 1).all()
    assert not crop.labels[:, :62].any()


def test_hidden_joints_are_not_seen() -> None:
    labels = np.full((40, 40), PART["torso"], np.uint8)
    seen = visible_joints(labels, np.full((21, 2), 20.0))
    assert seen[JOINT["thorax"]]
    assert not seen[JOINT["l_wrist"]]


@pytest.mark.parametrize("front", [True, False])
def test_things_go_before_or_behind_the_body(front: bool) -> None:
    labels = np.zeros((60, 60), np.uint8)
    labels[10:50, 25:35], labels[20:30, 25:30] = PART["torso"], PART["l_hand"]
    material = np.where(labels > 0, 0, -1)
    depth = np.where(labels > 0, 0.2, -np.inf).astype(np.float32)
    layers = Layers(labels, material, np.zeros((60, 60, 2), np.float32), depth, np.zeros((60, 60, 3), np.float32))
    mask = np.zeros((60, 60), bool)
    mask[15:40, 10:45] = True
    out, names = put_on(layers, ["skin"], [Thing(mask, PART["prop"], "cloth.held", front, (PART["l_hand"],))])
    assert names == ["skin", "cloth.held"]
    assert (out.labels[20:30, 25:30] == PART["l_hand"]).all()  # the hand holds it
    assert (out.labels[35, 30] == PART["prop"]) == front
    assert out.labels[20, 12] == PART["prop"]
    assert (out.depth[20, 12] > 0.2) == front


@pytest.fixture(scope="module")
def viewer(crops: list[Crop]) -> CropViewer:
    return CropViewer(Crops(*(np.stack(values) for values in zip(*crops, strict=True))), backgrounds=2, size=128)


def test_views_follow_their_figures(viewer: CropViewer) -> None:
    rng = np.random.default_rng(0)
    hits = []
    for row in range(20):
        view = viewer.view(row % len(viewer.crops), rng)
        assert view.picture.shape == (128, 128, 3)
        assert view.labels.shape == (128, 128)
        for index in np.flatnonzero(view.visible):
            column, line = (view.joints[index] * 128).astype(int)
            near = view.labels[max(line - 4, 0) : line + 5, max(column - 4, 0) : column + 5]
            hits.append(ALLOWED[index, near].any())
    assert np.mean(hits) > 0.97  # some lie on the edge of thin limbs


def test_views_follow_the_generator(viewer: CropViewer) -> None:
    first, second = (viewer.view(3, np.random.default_rng(5)) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first, second, strict=True))


def test_mirrors_are_their_own_inverse() -> None:
    assert np.array_equal(OTHER_SIDE[OTHER_SIDE], np.arange(18))
    assert [JOINT_MIRROR[other] for other in JOINT_MIRROR] == list(range(21))
