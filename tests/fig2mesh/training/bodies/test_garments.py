"""Garments are offsets of the skin: a dressed body is the same mesh, thicker where it is covered."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from fig2mesh.skeleton import PART
from fig2mesh.training.bodies.garments import Garment, read_garments, vertex_normals, wear
from tests.fig2mesh.training.figures import bodies, vertex_part, wardrobe

BODY = bodies().rig


@pytest.mark.parametrize("garment", wardrobe(), ids=lambda garment: garment.name)
def test_what_is_covered_moves_by_the_offset_and_nothing_else(garment: Garment) -> None:
    dressed = wear(BODY.vertices, BODY.faces, garment, 1.2)
    moved = dressed - BODY.vertices
    assert dressed.shape == BODY.vertices.shape
    assert (moved[~garment.covered] == 0).all()
    if garment.kind == "cloth":
        along = np.einsum("nc,nc->n", moved, vertex_normals(BODY.vertices, BODY.faces))
        np.testing.assert_allclose(along, 1.2 * garment.offset[:, 0], atol=1e-7)
        np.testing.assert_allclose(np.linalg.norm(moved, axis=1), along, atol=1e-7)
    else:
        np.testing.assert_allclose(moved, garment.offset, atol=1e-7)


def test_normals_of_a_ball_point_outward() -> None:
    ball = trimesh.creation.icosphere(subdivisions=3)
    np.testing.assert_allclose(vertex_normals(ball.vertices, ball.faces), ball.vertices, atol=0.02)


def test_made_clothes_thicken_a_closed_body_and_leave_face_and_hands_free() -> None:
    made = read_garments(bodies(), None)
    assert {garment.kind for garment in made} == {"cloth", "hair"}
    bare = trimesh.Trimesh(BODY.vertices, BODY.faces, process=False).volume
    part = vertex_part(BODY)
    for garment in made:
        assert garment.name.startswith("made-")
        assert garment.covered.any()
        hands = np.isin(part, [PART["l_hand"], PART["r_hand"]])
        assert not (garment.covered & hands).any()
        assert (np.abs(garment.offset[~garment.covered]) < 1e-6).all()
        if garment.kind == "cloth":
            assert not (garment.covered & (part == PART["head"])).any()
            solid = trimesh.Trimesh(wear(BODY.vertices, BODY.faces, garment), BODY.faces, process=False)
            assert solid.is_watertight
            assert solid.volume > bare * 1.01


def test_a_garment_file_becomes_offsets(tmp_path: Path) -> None:
    """A tunic two centimetres off the torso, bound to the skin's vertices."""
    normal = vertex_normals(BODY.vertices, BODY.faces)
    faces = BODY.faces[BODY.face_part == PART["torso"]]
    used, inverse = np.unique(faces, return_inverse=True)
    folder = tmp_path / "makehuman_assets_cc0" / "clothes" / "tunic"
    folder.mkdir(parents=True)
    rows = [f"{v} {v} {v} 1 0 0 {' '.join(f'{x:.6f}' for x in 0.02 * normal[v])}" for v in used]
    # The scale is the distance of two vertices of the body, along each axis, on the body of the file.
    low, high = BODY.vertices.argmin(axis=0), BODY.vertices.argmax(axis=0)
    spread = np.ptp(BODY.vertices, axis=0)
    scales = [f"{axis}_scale {low[k]} {high[k]} {spread[k]:.6f}" for k, axis in enumerate("xyz")]
    (folder / "tunic.mhclo").write_text("\n".join(["name tunic", *scales, "verts 0", *rows, "delete_verts", "1 2"]))
    points = [f"v {x} {y} {z}" for x, y, z in BODY.vertices[used]]
    triangles = [f"f {a} {b} {c}" for a, b, c in inverse.reshape(-1, 3) + 1]
    (folder / "tunic.obj").write_text("\n".join([*points, "g tunic", *triangles]))
    tunic = next(garment for garment in read_garments(bodies(), tmp_path) if garment.name == "tunic")
    assert tunic.kind == "cloth"
    inner = tunic.covered.copy()
    # Next to bare skin the cloth is smoothed towards it.
    for _ in range(4):
        bare = np.unique(BODY.faces[~inner[BODY.faces].all(axis=1)])
        inner[bare] = False
    assert inner.sum() > 100
    np.testing.assert_allclose(tunic.offset[inner, 0], 0.02, atol=0.004)
    # Rays meet the tunic from a vertex or two beyond its hem, no further.
    part = vertex_part(BODY)[tunic.covered]
    assert (part == PART["torso"]).mean() > 0.9
    assert not np.isin(part, [PART[f"{s}_{p}"] for s in "lr" for p in ("lower_arm", "lower_leg")]).any()
