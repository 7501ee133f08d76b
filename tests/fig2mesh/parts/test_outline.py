"""Part fields from outlines: laws on a drawn figure whose shape is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.field.body import Body
from fig2mesh.image_frame import image_frame
from fig2mesh.parse.read import read_figure
from fig2mesh.parts.canvas import make_canvas
from fig2mesh.parts.outline import Outline, outline_parts
from fig2mesh.parts.pieces import clean
from fig2mesh.pose.prior import lift
from fig2mesh.records import Figure
from fig2mesh.skeleton import BODY_PARTS, JOINT, JOINT_NAMES, PART, PART_NAMES
from tests.drawn import write_figure

VOXEL = 0.012


def read(folder: Path, scale: int = 2) -> Figure:
    files = write_figure(folder, scale)
    return read_figure(files.image, keypoints=files.keypoints)


def infer(figure: Figure) -> Outline:
    frame = image_frame(figure)
    return outline_parts(make_canvas(figure, frame, 320), lift(figure, frame), figure.visible, voxel=VOXEL)


@pytest.fixture(scope="module")
def figure(tmp_path_factory: pytest.TempPathFactory) -> Figure:
    return read(tmp_path_factory.mktemp("drawn"))


@pytest.fixture(scope="module")
def outline(figure: Figure) -> Outline:
    return infer(figure)


def front_mask(body: Body, figure: Figure, step: int) -> tuple[np.ndarray, np.ndarray]:
    """Every `step`-th pixel centre: True where the body is behind it, and the drawn mask there."""
    frame = image_frame(figure)
    rows, columns = np.mgrid[0 : figure.mask.shape[0] : step, 0 : figure.mask.shape[1] : step]
    xy = frame.figure_from_image(np.stack([columns + 0.5, rows + 0.5], axis=-1))
    depth = np.linspace(-0.4, 0.4, 81)
    shape = (*xy.shape[:2], len(depth))
    columns_of_points = [np.broadcast_to(xy[..., None, i], shape) for i in range(2)]
    points = np.stack([*columns_of_points, np.broadcast_to(depth, shape)], axis=-1)
    inside = body.distance(points.reshape(-1, 3).astype(np.float32)).reshape(points.shape[:3]).min(axis=2) < 0
    return inside, figure.mask[rows, columns]


def test_every_part_is_there(outline: Outline) -> None:
    assert {part.part for part in outline.parts} == set(BODY_PARTS)
    assert all(part.observed for part in outline.parts)


def test_front_silhouette_is_the_drawing(outline: Outline, figure: Figure) -> None:
    body, drawn = front_mask(Body(outline.parts), figure, 3)
    assert (body & drawn).sum() / (body | drawn).sum() > 0.97


def test_limbs_are_as_deep_as_wide(outline: Outline, figure: Figure) -> None:
    """A lower arm is drawn as a strip 18 px wide (of 300 px, 1.79 units): a cylinder."""
    body = Body(outline.parts)
    frame = image_frame(figure)
    radius = 9 * 2 * frame.units_per_px
    joints = lift(figure, frame).joints
    middle = (joints[JOINT["l_elbow"]] + joints[JOINT["l_wrist"]]) / 2
    depth = np.linspace(-0.2, 0.2, 401)
    line = np.column_stack([np.full(401, middle[0]), np.full(401, middle[1]), depth]).astype(np.float32)
    thick = np.ptp(depth[body.distance(line) < 0])
    assert thick == pytest.approx(2 * radius, rel=0.12)


def test_field_is_a_distance_near_the_surface(outline: Outline) -> None:
    """Gradients of a signed distance have length 1; the closed form is first order, so a tenth is allowed."""
    body = Body(outline.parts)
    random = np.random.default_rng(0)
    low, high = body.bounds()
    points = random.uniform(low, high, (40_000, 3)).astype(np.float32)
    near = points[np.abs(body.distance(points)) < 0.01]
    length = np.linalg.norm(body.gradient(near), axis=1)
    assert np.median(length) == pytest.approx(1.0, abs=0.05)
    assert np.quantile(length, 0.95) < 1.3


def test_mirrored_drawing_gives_mirrored_body(figure: Figure, outline: Outline) -> None:
    width = figure.mask.shape[1]
    swapped = [name.replace("l_", "R_").replace("r_", "l_").replace("R_", "r_") for name in JOINT_NAMES]
    order = [JOINT[name] for name in swapped]
    joints = figure.joints_px[order] * [-1, 1] + [width, 0]
    mirrored = Figure(
        "mirrored", figure.rgba[:, ::-1], figure.mask[:, ::-1], joints, figure.visible[order], figure.part_labels
    )
    body, other = Body(outline.parts), Body(infer(mirrored).parts)
    random = np.random.default_rng(1)
    low, high = body.bounds()
    points = random.uniform(low, high, (4000, 3)).astype(np.float32)
    inside = body.distance(points) < 0
    assert (inside == (other.distance(points * np.float32([-1, 1, 1])) < 0)).mean() > 0.995


def test_resolution_of_the_drawing_does_not_matter(tmp_path: Path, outline: Outline) -> None:
    body, large = Body(outline.parts), Body(infer(read(tmp_path, scale=5)).parts)
    random = np.random.default_rng(2)
    low, high = body.bounds()
    points = random.uniform(low, high, (4000, 3)).astype(np.float32)
    assert ((body.distance(points) < 0) == (large.distance(points) < 0)).mean() > 0.985


def test_hidden_forearm_goes_behind(figure: Figure) -> None:
    """A wrist drawn over the belly lies in front of it; the same wrist marked hidden lies behind."""
    joints = figure.joints_px.copy()
    for name, x, y in (("l_wrist", 100, 140), ("l_hand", 92, 142), ("l_elbow", 130, 125)):
        joints[JOINT[name]] = 2 * x, 2 * y
    depths = []
    for shown in (True, False):
        visible = figure.visible.copy()
        visible[[JOINT["l_wrist"], JOINT["l_hand"], JOINT["l_elbow"]]] = shown
        posed = Figure("posed", figure.rgba, figure.mask, joints, visible, figure.part_labels)
        (hand,) = [part for part in infer(posed).parts if PART_NAMES[part.part] == "l_hand"]
        depths.append(float(hand.centre[2]))
    assert depths[0] > 0.05
    assert depths[1] < -0.05


def test_specks_are_dropped_and_pieces_counted(figure: Figure) -> None:
    mask = figure.mask.copy()
    mask[5:7, 5:7] = True
    mask[500:560, 5:40] = True
    dirty = Figure("dirty", figure.rgba, mask, figure.joints_px, figure.visible, figure.part_labels)
    kept, pieces, specks = clean(dirty, VOXEL, 2048)
    assert (pieces, specks) == (2, 1)
    assert kept.mask.sum() == mask.sum() - 4
    shift = figure.joints_px[0] - kept.joints_px[0]
    assert np.allclose(figure.joints_px - shift, kept.joints_px)


def test_what_surrounds_the_figure_does_not_matter(figure: Figure) -> None:
    """The same figure on a sheet a hundred times larger is the same figure."""
    height, width = figure.mask.shape
    sheet = np.zeros((10 * height, 10 * width, 4), np.uint8)
    row, column = 7 * height, 3 * width
    sheet[row : row + height, column : column + width] = figure.rgba
    joints = figure.joints_px + np.float32([column, row])
    large = Figure("sheet", sheet, sheet[..., 3] > 127, joints, figure.visible, np.zeros(sheet.shape[:2], np.uint8))
    trimmed, small = clean(large, VOXEL, 2048)[0], clean(figure, VOXEL, 2048)[0]
    assert np.array_equal(trimmed.mask, small.mask)
    assert np.array_equal(trimmed.rgba, small.rgba)
    assert np.allclose(trimmed.joints_px, small.joints_px)


def test_part_labels_of_the_user_win(figure: Figure) -> None:
    labels = np.zeros(figure.mask.shape, np.uint8)
    head_y = int(figure.joints_px[JOINT["head"], 1])
    labels[: head_y - 10] = PART["hair"]
    labels[int(figure.joints_px[JOINT["pelvis"], 1]) :] = PART["garment"]
    labels[: int(figure.joints_px[JOINT["neck"], 1]) + 30][
        labels[: int(figure.joints_px[JOINT["neck"], 1]) + 30] == 0
    ] = PART["head"]
    labelled = replace(figure, part_labels=np.where(figure.mask, labels, 0))
    parts = {part.part: part for part in infer(labelled).parts}
    assert {PART["hair"], PART["garment"], PART["head"]} <= set(parts)
    assert PART["l_foot"] not in parts
    assert parts[PART["hair"]].centre[1] > parts[PART["head"]].centre[1]


@pytest.mark.parametrize("height", [16, 40])
def test_small_pictures_keep_their_limbs(figure: Figure, height: int) -> None:
    """A figure of 16 pixels has arms two pixels wide: they are still there."""
    factor = height / figure.mask.shape[0]
    size = (round(figure.mask.shape[1] * factor), height)
    rgba = np.asarray(Image.fromarray(figure.rgba).resize(size, Image.Resampling.BOX))
    joints = figure.joints_px * np.float32([size[0] / figure.mask.shape[1], factor])
    small = Figure("small", rgba, rgba[..., 3] > 127, joints, figure.visible, np.zeros(rgba.shape[:2], np.uint8))
    low, high = Body(infer(clean(small, VOXEL, 2048)[0]).parts).bounds()
    rows, columns = np.flatnonzero(small.mask.any(axis=1)), np.flatnonzero(small.mask.any(axis=0))
    pixel = 1.79 / (np.ptp(rows) + 1)
    assert high[1] - low[1] == pytest.approx(1.79, abs=1.0 * pixel)
    assert high[0] - low[0] == pytest.approx((np.ptp(columns) + 1) * pixel, abs=1.5 * pixel)


def test_a_large_scan_is_the_same_figure(figure: Figure) -> None:
    """Eight times as many pixels, reduced on the way in: joints and silhouette stay where they were."""
    size = (figure.mask.shape[1] * 8, figure.mask.shape[0] * 8)
    rgba = np.asarray(Image.fromarray(figure.rgba).resize(size, Image.Resampling.NEAREST))
    large = Figure(
        "large", rgba, rgba[..., 3] > 127, figure.joints_px * 8, figure.visible, np.zeros(rgba.shape[:2], np.uint8)
    )
    reduced, plain = clean(large, VOXEL, 600)[0], clean(figure, VOXEL, 2048)[0]
    assert max(reduced.mask.shape) < 1200
    places = [image_frame(f).figure_from_image(f.joints_px) for f in (reduced, plain)]
    assert np.allclose(*places, atol=0.006), "a pixel of the drawing is 0.003 units"


def test_lying_figures_are_no_giants() -> None:
    """A bar thirty times as wide as high: scaled by its width."""
    mask = np.zeros((20, 300), bool)
    mask[5:15, :] = True
    joints = np.full((21, 2), 10, np.float32)
    shape = mask.shape
    bar = Figure("bar", np.zeros((*shape, 4), np.uint8), mask, joints, np.ones(21, bool), np.zeros(shape, np.uint8))
    assert 300 * image_frame(bar).units_per_px == pytest.approx(3 * 1.79)
