"""PLY and OBJ, read back with trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from exporters.obj import write_obj
from exporters.ply import write_ply
from exporters.sampling import sample
from exporters.validate import validate
from tests.exporters.analytic import ZURICH, asset, capsule, gradient_texture


def test_ply_is_closed_by_its_indices_and_coloured_from_the_texture(tmp_path: Path) -> None:
    given = asset(ZURICH).mesh
    write_ply(asset(ZURICH), tmp_path / "a.ply")
    read = trimesh.load_mesh(tmp_path / "a.ply", process=False)
    assert read.is_watertight
    assert np.array_equal(read.vertices[read.faces], given.vertices[given.faces])
    # Away from the seam a vertex has one copy, so its colour is the texture's, red from u and green from v.
    colors = read.visual.vertex_colors[read.faces.reshape(-1), :3]
    uv = given.uv[given.faces.reshape(-1)]
    inner = np.abs(uv[:, 0] - 0.5) < 0.4
    inner &= (given.vertices[given.faces.reshape(-1)][:, [0, 2]] != 0).any(axis=1)  # poles have many copies
    # Texel centres clamp at the rim by half a texel of 64, and bytes round.
    assert colors[inner][:, 0] == pytest.approx(uv[inner][:, 0] * 255, abs=255 / 128 + 1)
    assert colors[inner][:, 1] == pytest.approx(uv[inner][:, 1] * 255, abs=255 / 128 + 1)
    assert validate(tmp_path / "a.ply") == []


def test_ply_takes_given_colours_before_the_texture(tmp_path: Path) -> None:
    colors = np.tile(np.array([[1, 2, 3]], np.uint8), (len(capsule().vertices), 1))
    write_ply(asset(lods=(capsule(colors=colors),)), tmp_path / "a.ply")
    read = trimesh.load_mesh(tmp_path / "a.ply", process=False)
    assert (read.visual.vertex_colors[:, :3] == [1, 2, 3]).all()


def test_ply_without_any_colour(tmp_path: Path) -> None:
    write_ply(asset(lods=(capsule(texture=None, uv=None, observed=None, parts=None),)), tmp_path / "a.ply")
    assert b"property uchar red" not in (tmp_path / "a.ply").read_bytes()
    assert validate(tmp_path / "a.ply") == []


def test_ply_header_stays_in_ascii_and_in_its_lines(tmp_path: Path) -> None:
    write_ply(asset(ZURICH, copyright="Müller\nend_header"), tmp_path / "a.ply")
    header = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")[0].decode("ascii")
    assert "comment copyright M\\xfcller end header" in header
    assert "comment lon_deg 8.5417" in header
    assert validate(tmp_path / "a.ply") == []


def test_obj_comes_back_equal_with_its_texture(tmp_path: Path) -> None:
    given = asset(ZURICH).mesh
    write_obj(asset(ZURICH), tmp_path / "a b.obj")
    assert {file.name for file in tmp_path.iterdir()} == {"a b.obj", "a b.mtl", "a b_texture.png"}
    read = trimesh.load_mesh(tmp_path / "a b.obj", process=False)
    # Nine digits: the same float32.
    assert np.array_equal(read.vertices[read.faces].astype(np.float32), given.vertices[given.faces])
    uv = read.visual.uv[read.faces]
    assert np.array_equal(uv[:, :, 0].astype(np.float32), given.uv[given.faces][:, :, 0])
    assert 1 - uv[:, :, 1] == pytest.approx(given.uv[given.faces][:, :, 1], abs=1e-7)
    assert np.array_equal(np.asarray(read.visual.material.image), given.texture.pixels)
    assert validate(tmp_path / "a b.obj") == []


def test_obj_positions_are_those_of_the_solid(tmp_path: Path) -> None:
    write_obj(asset(), tmp_path / "a.obj")
    lines = (tmp_path / "a.obj").read_text().splitlines()
    assert sum(line.startswith("v ") for line in lines) == len(np.unique(capsule().solid_index))
    assert sum(line.startswith("vt ") for line in lines) == len(capsule().vertices)


def test_obj_without_texture_carries_vertex_colours(tmp_path: Path) -> None:
    colors = np.tile(np.array([[255, 0, 51]], np.uint8), (len(capsule().vertices), 1))
    write_obj(asset(lods=(capsule(texture=None, uv=None, observed=None, colors=colors),)), tmp_path / "a.obj")
    read = trimesh.load_mesh(tmp_path / "a.obj", process=False)
    assert (read.visual.vertex_colors[:, :3] == [255, 0, 51]).all()
    assert validate(tmp_path / "a.obj") == []


@pytest.mark.parametrize("writer", [write_ply, write_obj])
def test_same_asset_same_bytes(tmp_path: Path, writer: object) -> None:
    path = tmp_path / "a"
    writer(asset(ZURICH), path)
    first = path.read_bytes()
    writer(asset(ZURICH), path)
    assert path.read_bytes() == first


def test_sampling_is_bilinear_between_texel_centres() -> None:
    texture = gradient_texture(64)
    centre = (np.array([[10, 20]]) + 0.5) / 64
    assert (sample(texture, centre)[0] == texture.pixels[20, 10]).all()
    # Corners clamp to the outermost texels.
    assert (sample(texture, np.array([[0.0, 0.0], [1.0, 1.0]])) == texture.pixels[[0, -1], [0, -1]]).all()
