"""Silhouettes from a coarse guess and the picture's own lines and colours."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from fig2mesh.parse.colours import by_colour, guided
from fig2mesh.parse.silhouette import agreement, plain_background, refine

SIDE = 240
Y, X = np.mgrid[:SIDE, :SIDE] + 0.5


def disc(x: float, y: float, radius: float) -> np.ndarray:
    return np.hypot(X - x, Y - y) < radius


def guess(mask: np.ndarray, blurred: float = 7.0) -> np.ndarray:
    """Prediction of a network on a coarse grid."""
    return ndimage.gaussian_filter(mask.astype(np.float32), blurred)


def iou(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


BODY = disc(120, 90, 45) | ((abs(X - 120) < 26) & (abs(Y - 160) < 55)) | ((abs(X - 175) < 4) & (abs(Y - 120) < 40))
BODY |= (abs(Y - 120) < 5) & (X > 120) & (X < 178)
"""A head, a body and a thin arm held up."""


def lines(mask: np.ndarray, width: int = 3) -> np.ndarray:
    return mask & ~ndimage.binary_erosion(mask, iterations=width)


def paper(colour: tuple[int, int, int] = (236, 226, 205), slope: float = 0.0) -> np.ndarray:
    return np.clip(np.array(colour) * (1 + slope * (X / SIDE - 0.5))[..., None], 0, 255)


@pytest.mark.parametrize("slope", [0.0, 0.25])
def test_a_filled_figure_on_paper_gets_its_own_edge(slope: float) -> None:
    picture = np.where(BODY[..., None], [150, 60, 50], paper(slope=slope)).astype(np.uint8)
    assert iou(refine(picture, guess(BODY)), BODY) > 0.995


def test_a_line_drawing_is_filled_in() -> None:
    picture = np.where(lines(BODY)[..., None], [30, 30, 30], paper()).astype(np.uint8)
    assert iou(refine(picture, guess(BODY)), BODY) > 0.99


def test_gaps_in_the_outline_are_bridged() -> None:
    gap = disc(94, 160, 6) | disc(120, 46, 5)
    picture = np.where((lines(BODY) & ~gap)[..., None], [30, 30, 30], paper()).astype(np.uint8)
    assert iou(refine(picture, guess(BODY)), BODY) > 0.96


def test_ground_seen_through_a_bent_arm_is_no_figure() -> None:
    ring = disc(120, 120, 80) & ~disc(150, 120, 22)
    picture = np.where(ring[..., None], [60, 90, 160], paper()).astype(np.uint8)
    found = refine(picture, guess(ring, 4))
    assert not found[120, 150]
    assert iou(found, ring) > 0.99


def test_other_things_on_the_sheet_are_left_out() -> None:
    other = disc(30, 30, 14) | ((abs(Y - 225) < 2) & (X < 80))
    picture = np.where((BODY | other)[..., None], [40, 40, 40], paper()).astype(np.uint8)
    assert iou(refine(picture, guess(BODY)), BODY) > 0.99


def test_a_busy_ground_is_no_sheet_and_colours_decide() -> None:
    rng = np.random.default_rng(0)
    ground = ndimage.zoom(rng.uniform(90, 255, (24, 24, 3)), (10, 10, 1), order=0)
    picture = np.where(BODY[..., None], [170, 30, 40], ground).astype(np.uint8)
    likely = guess(BODY)
    sheet = plain_background(picture.astype(np.float32), likely)
    assert sheet is None or sheet.share < 0.5
    assert iou(refine(picture, likely), BODY) > iou(likely > 0.5, BODY)


def test_mirrored_pictures_have_mirrored_silhouettes() -> None:
    picture = np.where(lines(BODY)[..., None], [30, 30, 30], paper(slope=0.1)).astype(np.uint8)
    found = refine(picture, guess(BODY))
    turned = refine(picture[:, ::-1], guess(BODY)[:, ::-1])
    assert iou(found, turned[:, ::-1]) > 0.998


def test_large_pictures_have_their_own_size() -> None:
    large = np.kron(BODY, np.ones((7, 7), bool))
    picture = np.where(large[..., None], [150, 60, 50], [236, 226, 205]).astype(np.uint8)
    found = refine(picture, np.kron(guess(BODY), np.ones((7, 7), np.float32)))
    assert found.shape == large.shape
    assert iou(found, large) > 0.98


def test_nothing_guessed_is_nothing_found() -> None:
    assert not refine(paper().astype(np.uint8), np.zeros((SIDE, SIDE), np.float32)).any()


@pytest.mark.parametrize("shape", [(1, 1), (3, 200), (2, 2)])
def test_tiny_pictures(shape: tuple[int, int]) -> None:
    likely = np.full(shape, 0.9, np.float32)
    assert refine(np.full((*shape, 3), 128, np.uint8), likely).shape == shape


def test_colours_of_one_kind_leave_the_guess() -> None:
    likely = guess(BODY)
    grey = np.full((SIDE, SIDE, 3), 128, np.float32)
    assert iou(by_colour(grey, likely), likely > 0.5) > 0.93


def test_agreement_is_one_with_itself_and_none_with_nothing() -> None:
    likely = guess(BODY)
    assert agreement(likely > 0.5, likely) == pytest.approx(1.0)
    assert agreement(np.zeros_like(BODY), likely) == 0.0


def test_a_guided_filter_keeps_constants_and_follows_edges() -> None:
    rng = np.random.default_rng(1)
    guide = rng.random((40, 50, 3)).astype(np.float32)
    assert np.allclose(guided(guide, np.full((40, 50), 0.3, np.float32), 4, 1e-3), 0.3, atol=1e-5)
    edge = np.zeros((40, 50), np.float32)
    edge[:, 25:] = 1.0
    # An image linear in its guide is left as it is (He, Sun, Tang 2013, equation 4, softness 0).
    assert np.allclose(guided(np.repeat(edge[..., None], 3, 2), edge, 4, 1e-6), edge, atol=1e-3)


def test_a_forearm_that_the_guess_overlooks_stays_between_sleeve_and_hand() -> None:
    hand, arm = disc(214, 60, 9), (abs(Y - 60) < 3) & (X > 120) & (X < 214)
    figure = disc(120, 90, 45) | hand | arm
    picture = np.where(figure[..., None], [150, 60, 50], paper()).astype(np.uint8)
    likely = guess(disc(120, 90, 45) | hand, 4)
    assert iou(refine(picture, likely), figure) > 0.99
