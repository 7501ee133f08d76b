"""Lines along the rim of drawn discs: their width, their pens, and drawings that have none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.image_frame import ImageFrame
from fig2mesh.texture.bare import without_line
from fig2mesh.texture.drawn_line import DrawnLine, drawn_line, paper_beside

SIDE, RADIUS_PX = 300, 120
FRAME = ImageFrame((SIDE / 2, SIDE / 2), 0.004)
RED, SKIN, BLACK, WHITE, BLUE = (200, 30, 40), (240, 200, 170), (10, 10, 12), (250, 250, 250), (20, 30, 160)
Colour = tuple[int, int, int]


def rim() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    outwards = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return RADIUS_PX * FRAME.units_per_px * outwards, outwards


def disc(fill: Colour, pen: Colour | None, width_px: float) -> NDArray[np.float32]:
    """A disc with soft edges, its colours continued beyond it."""
    rows, columns = np.mgrid[0:SIDE, 0:SIDE] + 0.5
    inside = RADIUS_PX - np.hypot(rows - SIDE / 2, columns - SIDE / 2)
    share = np.clip(width_px - inside + 0.5, 0, 1)[..., None] if pen is not None else np.zeros((SIDE, SIDE, 1))
    return (share * np.float32(pen or fill) + (1 - share) * np.float32(fill)).astype(np.float32)


def read(picture: NDArray[np.float32], paper: Colour | None = None) -> DrawnLine:
    points, outwards = rim()
    shown = np.ones(len(points), bool)
    return drawn_line(picture, FRAME, points, outwards, shown, None if paper is None else np.float64(paper))


@pytest.mark.parametrize("width_px", [1.5, 3.0, 5.0, 8.0])
@pytest.mark.parametrize("fill", [RED, SKIN, WHITE])
def test_width_and_pen(width_px: float, fill: Colour) -> None:
    line = read(disc(fill, BLACK, width_px))
    assert line.width == pytest.approx(width_px * FRAME.units_per_px, abs=0.35 * FRAME.units_per_px)
    assert line.pens == pytest.approx(np.array([BLACK], float), abs=3 if width_px >= 3 else 60)


@pytest.mark.parametrize("fill", [RED, SKIN, BLACK, WHITE])
def test_flat_drawings_have_no_line(fill: Colour) -> None:
    line = read(disc(fill, None, 0))
    assert len(line.pens) == 0
    assert (line.width == 0).all()


def test_shading_is_no_line() -> None:
    columns = np.arange(SIDE)[None, :, None] + np.zeros((SIDE, 1, 1))
    line = read((np.float32(RED) * (0.4 + 0.6 * columns / SIDE)).astype(np.float32))
    assert len(line.pens) == 0


def test_two_pens() -> None:
    picture = disc(SKIN, BLACK, 5)
    picture[: SIDE // 2] = disc(SKIN, BLUE, 5)[: SIDE // 2]
    line = read(picture)
    points, _ = rim()
    assert len(line.pens) == 2
    upper = points[:, 1] > 0.05
    assert np.median(line.color[upper], axis=0) == pytest.approx(np.array(BLUE), abs=3)
    assert np.median(line.color[points[:, 1] < -0.05], axis=0) == pytest.approx(np.array(BLACK), abs=3)


def test_white_ink_on_a_dark_fill_unless_it_is_the_paper() -> None:
    line = read(disc(BLUE, WHITE, 5))
    assert line.pens == pytest.approx(np.array([WHITE], float), abs=3)
    assert line.width == pytest.approx(5 * FRAME.units_per_px, rel=0.1)
    assert len(read(disc(BLUE, WHITE, 5), paper=WHITE).pens) == 0


def test_dark_clothes_hide_the_end_of_the_line() -> None:
    picture = disc(SKIN, BLACK, 5)
    picture[:, : SIDE // 2] = BLACK
    line = read(picture)
    points, _ = rim()
    assert np.isnan(line.width[points[:, 0] < -0.1]).all()
    assert line.width[points[:, 0] > 0.1] == pytest.approx(5 * FRAME.units_per_px, rel=0.15)


def test_a_line_along_part_of_the_rim() -> None:
    picture = disc(SKIN, BLACK, 5)
    picture[: SIDE // 2] = SKIN
    line = read(picture)
    points, _ = rim()
    assert (line.width[points[:, 1] > 0.05] == 0).all()
    assert (line.width[points[:, 1] < -0.05] > 0).all()


def test_what_is_hidden_is_not_read() -> None:
    points, outwards = rim()
    shown = points[:, 0] > 0
    line = drawn_line(disc(SKIN, BLACK, 5), FRAME, points, outwards, shown)
    assert np.isnan(line.width[~shown]).all()
    assert (line.width[shown] > 0).all()


def test_picture_without_the_line() -> None:
    picture = disc(SKIN, BLACK, 5)
    points, _ = rim()
    mask = np.hypot(*(np.mgrid[0:SIDE, 0:SIDE] + 0.5 - SIDE / 2)) < RADIUS_PX
    line = read(picture)
    bare = without_line(picture, mask, FRAME, points, 1.1 * line.width + 0.003, line.color)
    assert np.median(np.abs(bare[mask].astype(float) - SKIN)) == 0
    assert (np.linalg.norm(bare[mask] - np.float64(BLACK), axis=1) > 110).all()
    assert (bare == np.round(picture))[~(picture < np.float32(SKIN) - 1).any(axis=2)].all()
    same = without_line(picture, mask, FRAME, points, np.zeros(len(points)), line.color)
    assert (same == np.round(picture)).all()


def test_thin_things_keep_their_ink() -> None:
    picture = np.full((SIDE, SIDE, 3), BLACK, np.float32)
    points, _ = rim()
    mask = np.hypot(*(np.mgrid[0:SIDE, 0:SIDE] + 0.5 - SIDE / 2)) < RADIUS_PX
    width = np.full(len(points), 5 * FRAME.units_per_px)
    pen = np.tile(np.float64(BLACK), (len(points), 1))
    assert (without_line(picture, mask, FRAME, points, width, pen) == BLACK).all()


def test_paper() -> None:
    rgba = np.full((60, 60, 4), 255, np.uint8)
    rgba[..., :3] = 230
    mask = np.zeros((60, 60), bool)
    mask[20:40, 20:40] = True
    paper = paper_beside(rgba, mask)
    assert paper is not None
    assert paper == pytest.approx(230)
    rgba[..., 3] = 0
    assert paper_beside(rgba, mask) is None
