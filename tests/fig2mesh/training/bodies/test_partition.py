"""Cutting a body: parts are closed, and nothing is lost or gained."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from fig2mesh.skeleton import BODY_PARTS, PART
from fig2mesh.training.bodies.partition import partition
from fig2mesh.training.bodies.rig import pose
from tests.fig2mesh.training.figures import capsule_man, poses


@pytest.mark.parametrize("rings", [0, 2])
def test_parts_of_a_posed_body_are_closed_and_point_outward(rings: int) -> None:
    rig = capsule_man("man", 20.0)
    vertices, _ = pose(rig, poses("seen", 8, 1).rotations[0], np.zeros(2))
    parts = partition(rig, rings)
    assert [part.part for part in parts] == list(BODY_PARTS)
    for part in parts:
        solid = trimesh.Trimesh(*part.solid(vertices), process=False)
        assert solid.is_watertight
        assert solid.is_winding_consistent
        assert solid.volume > 0
        # Torso: neck, arms and legs; head, hands and feet end in themselves.
        assert len(part.borders) == {"torso": 5, "head": 1, "hand": 1, "foot": 1}.get(_kind(part.part), 2)


def _kind(part: int) -> str:
    return next(name for name, label in PART.items() if label == part).removeprefix("l_").removeprefix("r_")


@pytest.mark.parametrize("posed", [False, True])
def test_parts_without_overlap_fill_the_body(posed: bool) -> None:
    rig = capsule_man("man", 20.0)
    vertices = pose(rig, poses("seen", 8, 1).rotations[1], np.zeros(2))[0] if posed else rig.vertices
    whole = trimesh.Trimesh(vertices, rig.faces, process=False).volume
    volumes = [trimesh.Trimesh(*part.solid(vertices), process=False).volume for part in partition(rig, 0)]
    assert sum(volumes) == pytest.approx(whole, rel=1e-6)
    overlapping = [trimesh.Trimesh(*part.solid(vertices), process=False).volume for part in partition(rig, 2)]
    assert (np.array(overlapping) > volumes).all()


def test_a_straight_cut_is_closed_by_a_flat_cap() -> None:
    """A prism with 16 sides, cut in the middle: each half is a shorter prism."""
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rings = [np.stack([0 * turn + x, np.cos(turn), np.sin(turn)], axis=1) for x in (-1.0, 0.0, 1.0)]
    i, j = np.meshgrid(np.arange(2), np.arange(16), indexing="ij")
    a, b, c, d = (16 * (i + p) + (j + q) % 16 for p, q in ((0, 0), (0, 1), (1, 0), (1, 1)))
    k = np.arange(16)
    faces = np.concatenate(
        [
            np.stack([a, b, d], -1).reshape(-1, 3),
            np.stack([a, d, c], -1).reshape(-1, 3),
            np.stack([k, np.full(16, 48), (k + 1) % 16], 1),
            np.stack([32 + k, 32 + (k + 1) % 16, np.full(16, 49)], 1),
        ]
    )
    vertices = np.concatenate([*rings, [[-1.0, 0, 0], [1.0, 0, 0]]])
    right = vertices[faces][:, :, 0].mean(axis=1) > 0
    man = capsule_man("man")
    rig = replace(
        man,
        vertices=vertices,
        faces=faces,
        face_part=np.where(right, PART["l_hand"], PART["torso"]),
        face_material=0 * right,
        bone_index=np.zeros((50, 4), int),
        bone_weight=np.tile([1.0, 0, 0, 0], (50, 1)),
    )
    halves = partition(rig, 0)
    assert [half.part for half in halves] == [PART["torso"], PART["l_hand"]]
    area = 16 / 2 * np.sin(2 * np.pi / 16)
    for half, sign in zip(halves, (-1, 1), strict=True):
        corners, triangles = half.solid(vertices)
        assert trimesh.Trimesh(corners, triangles, process=False).volume == pytest.approx(area)
        cap = triangles[(corners[triangles][:, :, 0] == 0).all(axis=1)]
        normals = np.cross(corners[cap[:, 1]] - corners[cap[:, 0]], corners[cap[:, 2]] - corners[cap[:, 0]])
        np.testing.assert_allclose(normals.sum(axis=0), [-sign * 2 * area, 0, 0], atol=1e-9)
