"""Measures of textures where the answer is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fig2mesh.nets.head_hsv import HeadHsv, HeadShape
from fig2mesh.nets.texture_fill import FillShape, TextureFill
from fig2mesh.nets.uv_unet import UvUnet, UvUnetShape
from fig2mesh.nets.view_refine import RefineShape, ViewRefine
from fig2mesh.texture.unobserved import TextureNets
from fig2mesh.training.evaluate.textures import COORDINATES, METHODS, PLACED, STRAIGHT, compare, face_share, painted
from fig2mesh.training.networks.loop import seeded
from fig2mesh.training.samples.textured_subject import TexturedSubject, subjects
from tests.fig2mesh.training.ellipsoids import BACK, FRONT, write_shards


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> TexturedSubject:
    folder = tmp_path_factory.mktemp("ellipsoids") / "data"
    write_shards(folder)
    return subjects(folder, "valid-clips", 1)[0]


@pytest.fixture(scope="module")
def untrained() -> TextureNets:
    return TextureNets(
        seeded(0, lambda: UvUnet(UvUnetShape(filters=4))).eval(),
        seeded(0, lambda: TextureFill(FillShape(32, 4))).eval(),
        ViewRefine(RefineShape(4)).eval(),
        HeadHsv(HeadShape(4, 8)).eval(),
    )


def test_points_lie_on_the_ellipsoid(subject: TexturedSubject) -> None:
    """Found from pictures and depths alone, so to a pixel or two."""
    seen = subject.sides.labels > 0
    radii = np.abs(subject.sides.points[seen]).max(axis=0)
    away = ((subject.sides.points[seen] / radii) ** 2).sum(axis=1)
    assert np.abs(np.sqrt(away) - 1).max() < 0.12
    assert np.abs(np.sqrt(away) - 1).mean() < 0.04


@pytest.mark.parametrize("method", METHODS)
def test_every_way_paints_every_side(subject: TexturedSubject, untrained: TextureNets, method: str) -> None:
    pytest.importorskip("cv2")
    made, _place = painted(subject, method, untrained)
    seen = subject.sides.labels > 0
    assert made.shape == subject.truth.shape
    assert np.isfinite(made[seen]).all()
    # Nobody can know that it is blue behind.
    assert np.abs(made[2][seen[2]] - FRONT).mean() < 25


def test_straight_through_is_the_mirrored_front(subject: TexturedSubject, untrained: TextureNets) -> None:
    made, place = painted(subject, STRAIGHT, untrained)
    same, found = painted(subject, COORDINATES, untrained)
    np.testing.assert_array_equal(made, same)
    np.testing.assert_array_equal(place, found)


@pytest.mark.parametrize("method", PLACED)
def test_colours_are_from_where_they_are_said_to_be(
    subject: TexturedSubject, untrained: TextureNets, method: str
) -> None:
    made, place = painted(subject, method, untrained)
    seen = subject.sides.labels > 0
    size = subject.front.shape[0]
    pixel = np.clip(((place[seen] + 1) / 2 * size).astype(int), 0, size - 1)
    off = np.abs(made[seen] - subject.front[pixel[:, 1], pixel[:, 0]]).max(axis=1)
    assert np.median(off) < 10


def test_comparison_of_a_picture_with_itself_and_with_another() -> None:
    rng = np.random.default_rng(0)
    truth = rng.uniform(0, 255, (40, 40, 3)).astype(np.float32)
    mask = np.ones((40, 40), bool)
    psnr, ssim, palette = compare(truth, truth, mask)
    assert (psnr, ssim, palette) == (90.0, pytest.approx(1.0), 0.0)
    psnr, ssim, palette = compare(truth + 25.5, truth, mask)
    assert psnr == pytest.approx(20.0)
    assert ssim < 1
    shuffled = rng.permuted(truth.reshape(-1, 3), axis=0).reshape(truth.shape)
    flat = np.full_like(truth, (200, 30, 30))
    assert compare(np.full_like(truth, (30, 200, 30)), flat, mask)[2] > 50
    assert compare(shuffled, truth, mask)[1] < 0.1


def test_what_lies_outside_of_the_body_does_not_count() -> None:
    rng = np.random.default_rng(0)
    truth = rng.uniform(0, 255, (40, 40, 3)).astype(np.float32)
    mask = np.zeros((40, 40), bool)
    mask[10:30, 10:30] = True
    other = np.where(mask[..., None], truth, 0).astype(np.float32)
    assert compare(other, truth, mask)[0] == 90.0


def test_a_mirrored_front_has_the_face_behind(subject: TexturedSubject, untrained: TextureNets) -> None:
    place = subject.sides.places()
    assert subject.face.any()
    head = subject.sides.labels[0] == 2
    expected = subject.face.sum() / head.sum()
    made, _place = painted(subject, STRAIGHT, untrained)
    shown, wrong = face_share(made, place, subject)
    assert shown == pytest.approx(expected, abs=0.1)
    assert wrong == pytest.approx(shown), "the truth is blue behind"
    assert face_share(subject.truth, place, subject) == (0, 0)
    assert face_share(made, place * 0 - 0.99, subject) == (0, 0)
    assert np.isnan(face_share(made, place, replace(subject, face=np.zeros_like(subject.face)))).all()


def test_truth_has_another_colour_behind(subject: TexturedSubject) -> None:
    assert np.abs(subject.truth[2][subject.sides.labels[2] > 0] - BACK).mean() < 5


def test_report_says_what_is_missing(tmp_path: Path) -> None:
    from fig2mesh.commands.main import main

    assert main(["evaluate", "textures", "--data", str(tmp_path), "-o", str(tmp_path / "report.md")]) == 2
    assert not (tmp_path / "report.md").exists()
