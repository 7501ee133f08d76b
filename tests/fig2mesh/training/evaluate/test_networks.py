"""Whole figures against the truth, and the report's tables."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field.analytic import ellipsoid, sample
from fig2mesh.field.body import Body
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.records import Figure, PartSdf
from fig2mesh.skeleton import PART
from fig2mesh.training.evaluate.assembled import GroundTruth, part_ious, similarity
from fig2mesh.training.evaluate.networks import table

RADII = (0.3, 0.6, 0.2)


def solid(centre: tuple[float, float, float], radii: tuple[float, float, float] = RADII) -> PartSdf:
    return sample(ellipsoid(centre, radii), PART["torso"], centre, 1.5, n=48)


@pytest.fixture(scope="module")
def truth() -> GroundTruth:
    mesh = isosurface(Body((solid((0, 0, 0)),)), spacing=0.02)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    picture = np.zeros((4, 4), bool)
    figure = Figure("", np.zeros((4, 4, 4), np.uint8), picture, np.zeros((21, 2)), np.ones(21, bool), picture)
    parts = {PART["torso"]: (mesh.vertices.astype(np.float64), mesh.faces)}
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = across / np.linalg.norm(across, axis=1, keepdims=True)
    return GroundTruth(figure, np.zeros((21, 3)), parts, corners.mean(axis=1), normals)


def test_a_body_that_only_stands_further_away_is_right(truth: GroundTruth) -> None:
    parts = (solid((0, 0, -0.35)),)
    found = similarity(Body(parts), truth)
    assert found.shift == pytest.approx(0.35, abs=0.02)
    # Samples of two surfaces that coincide are still some millimetres apart.
    assert found.chamfer < 0.015
    assert found.normals > 0.99
    assert found.side_iou > 0.95
    assert part_ious(parts, truth, 0.35)[PART["torso"]] > 0.97


def test_overlap_of_a_shifted_solid_and_of_none(truth: GroundTruth) -> None:
    # Half as thick: half the volume.
    parts = (solid((0, 0, 0), (0.3, 0.6, 0.1)),)
    assert part_ious(parts, truth, 0.0)[PART["torso"]] == pytest.approx(0.5, abs=0.03)
    assert part_ious((), truth, 0.0)[PART["torso"]] == 0.0
    found = similarity(Body(parts), truth)
    assert found.chamfer > 0.03
    # Seen from the side an ellipse of half the depth.
    assert found.side_iou == pytest.approx(0.5, abs=0.03)


def test_tables_are_markdown() -> None:
    assert table(("a", "b"), [("x", "1"), ("y", "2")]) == "| a | b |\n|---|---:|\n| x | 1 |\n| y | 2 |"
