"""Figures from bare pictures, by the shipped network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.parse.infer import infer_figure, on_light, predict, spread, square
from fig2mesh.parse.picture import read_rgba
from fig2mesh.skeleton import JOINT, JOINT_MIRROR, PART
from fig2mesh.training.evaluate.parser import BACKGROUNDS, bare, drawings, evaluate_parse, measure

FARMER = Path(__file__).parents[3] / "examples" / "figures" / "farmer"


@pytest.fixture(scope="module")
def farmer() -> np.ndarray:
    return bare(read_rgba(FARMER / "image.png"), "white")


# Measured with the shipped weights: docs/parsing.md. On black, black outlines are ground.
@pytest.mark.parametrize(("ground", "least"), [("white", 0.9), ("hidden", 0.8), ("map", 0.85)])
def test_the_farmer_is_found_on_any_ground(ground: str, least: float) -> None:
    score, found = measure(FARMER, ground)
    assert found is not None
    assert score.iou > least
    assert score.pck10 > 0.8


def test_a_mirrored_picture_has_the_mirrored_answer(farmer: np.ndarray) -> None:
    size = farmer.shape[1], farmer.shape[0]
    centre, edge = np.array(size) / 2, 1.1 * max(size)
    prediction, turned = predict(farmer, centre, edge), predict(farmer[:, ::-1], [size[0] - centre[0], centre[1]], edge)
    # Resampling rounds to whole colours.
    assert np.abs(turned.likely[:, ::-1] - prediction.likely).mean() < 0.002
    assert np.abs(turned.heat[list(JOINT_MIRROR)][:, :, ::-1] - prediction.heat).max() < 0.05


def test_likelihoods_are_likelihoods(farmer: np.ndarray) -> None:
    prediction = predict(farmer, np.array(farmer.shape[1::-1]) / 2, float(max(farmer.shape)))
    assert np.allclose(prediction.heat.sum(axis=(1, 2)), 1, atol=1e-4)
    assert np.allclose(prediction.labels.sum(axis=0), 1, atol=1e-4)
    assert 0 <= prediction.likely.min() <= prediction.likely.max() <= 1


def test_parts_lie_in_the_mask_and_joints_on_the_picture(farmer: np.ndarray) -> None:
    found = infer_figure(farmer)
    assert found is not None
    assert ((found.part_labels > 0) == found.mask).all()
    assert (found.joints_px >= 0).all()
    assert (found.joints_px <= farmer.shape[1::-1]).all()
    head = np.argwhere(found.part_labels == PART["head"]).mean(axis=0)
    assert abs(head[0] - found.joints_px[JOINT["head"], 1]) < 0.15 * farmer.shape[0]


def test_a_known_mask_is_kept(farmer: np.ndarray) -> None:
    mask = np.asarray(Image.open(FARMER / "mask.png").convert("L")) > 127
    found = infer_figure(farmer, mask)
    assert found is not None
    assert np.array_equal(found.mask, mask)


def test_plain_dark_grounds_become_white_and_others_stay() -> None:
    dark = np.full((40, 40, 3), 8, np.uint8)
    dark[10:30, 10:30] = 200
    dark[15:20, 15:20] = 8  # enclosed: part of the figure
    light = on_light(dark)
    assert (light[:10] == 255).all()
    assert np.array_equal(light[10:30, 10:30], dark[10:30, 10:30])
    for other in (255 - dark, np.random.default_rng(0).integers(0, 60, (40, 40, 3)).astype(np.uint8)):
        assert np.array_equal(on_light(other), other)


def test_nothing_is_found_on_an_empty_sheet() -> None:
    assert infer_figure(np.full((120, 80, 3), 250, np.uint8)) is None


def test_a_square_beyond_the_picture_is_filled_with_its_rim() -> None:
    picture = np.full((10, 20, 3), 40, np.uint8)
    picture[3:7, 5:9] = 200
    found = square(picture, np.array([-10.0, -15.0]), 40.0, 80)
    assert found.shape == (80, 80, 3)
    assert (found[:20] == 40).all()
    assert (found[38:42, 32:36] == 200).all()


def test_cells_spread_over_the_picture_where_they_were_seen() -> None:
    picture = np.zeros((60, 40, 3), np.uint8)
    prediction = predict(picture, np.array([20.0, 30.0]), 64.0)
    values = np.zeros((16, 16), np.float32)
    values[8:, 8:] = 1
    out = spread(values, prediction, (60, 40))
    assert out[45, 30] == 1
    assert out[10, 30] == 0


def test_the_table_names_every_drawing(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    for name in ("image.png", "mask.png", "keypoints.json"):
        (tmp_path / "one" / name).write_bytes((FARMER / name).read_bytes())
    assert [each.name for each in drawings(tmp_path)] == ["one"]
    text = evaluate_parse(tmp_path)
    assert "| one |" in text
    assert "| mean |" in text
    assert all(f"| {ground} |" in text for ground in BACKGROUNDS)
