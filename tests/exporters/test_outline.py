"""Drawn contours: exact through every file that carries them, and absent without a trace from the others."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from exporters.asset import Asset, TexturedMesh, without_outline
from exporters.colour import srgb_from_linear
from exporters.figure_reader import read_figure
from exporters.gltf.glb import glb_bytes, write_glb
from exporters.gltf.ktx2 import padded
from exporters.gltf.reader import Gltf, glb_of
from exporters.inspect import inspect
from exporters.level_error import MAX_SCREEN_SPACE_ERROR_PX
from exporters.placed_figure import figure_of
from exporters.profiles import profile_named
from exporters.sampling import sample
from exporters.solid import measure_topology, unmatched_edges
from exporters.tiles.b3dm import read_b3dm
from exporters.tiles.tileset import with_visible_outlines
from exporters.validate import validate
from exporters.write import write
from fig2mesh.measure.model import load_textured
from fig2mesh.render.model import read_model
from tests.exporters.analytic import HEIGHT, ZURICH, asset, capsule, gradient_texture
from tests.exporters.outlined import PENS, hulled, ribboned
from tests.node import RunScript

FORMS: dict[str, TexturedMesh] = {
    "hull": hulled(capsule()),
    "ribbon": ribboned(capsule()),
    "hull of two pens": hulled(capsule(), pens=2),
    "ribbon of two pens": ribboned(capsule(), pens=2),
    "ribbon as drawn": ribboned(capsule(), drawn=True),
    "ribbon as drawn, of a figure without texture": ribboned(capsule(texture=None, uv=None, observed=None), drawn=True),
    "hull of a figure without colours": hulled(capsule(texture=None, uv=None, observed=None, parts=None)),
}
PROFILES = (None, "cesiumjs", "blender", "qgis")


def outlined(name: str, **changes: Any) -> Asset:
    return asset(ZURICH, lods=(FORMS[name],), **changes)


def read_back(given: Asset, profile: str | None) -> Gltf:
    return glb_of(glb_bytes(given, 0, profile_named(profile)), Path("a.glb"))


def triangles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F, 9) corners of triangles in a canonical order; orientation is kept, order and first corner are not."""
    corners = np.asarray(vertices, np.float64)[faces]
    first = np.lexsort(np.moveaxis(corners, 2, 0)[::-1], axis=1)[:, 0]
    turned = np.take_along_axis(corners, ((first[:, None] + np.arange(3)) % 3)[:, :, None], axis=1).reshape(-1, 9)
    return turned[np.lexsort(turned.T[::-1])]


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", FORMS)
def test_the_outline_comes_back(name: str, profile: str | None) -> None:
    given = outlined(name)
    outline = given.mesh.outline
    assert outline is not None
    gltf = read_back(given, profile)
    ((form, vertices, faces),) = gltf.scene_outlines()
    assert form == name.split()[0]
    expected = triangles(outline.vertices, outline.faces)
    if profile == "cesiumjs":
        # Half a quantisation step may exchange neighbours in the order of triangles; sums have no order.
        assert len(faces) == len(outline.faces)
        np.testing.assert_allclose(vertices[faces].mean(axis=(0, 1)), expected.reshape(-1, 3).mean(axis=0), atol=2e-5)
    else:
        assert np.array_equal(triangles(vertices, faces), expected)
    if form == "hull":
        turned = measure_topology(vertices, faces[:, ::-1])
        assert turned.outward
        assert measure_topology(vertices, faces).volume < 0
    else:
        assert unmatched_edges(outline.faces) == 0
        assert measure_topology(vertices, faces).volume == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("profile", [None, "blender", "qgis"])
@pytest.mark.parametrize("name", FORMS)
def test_a_file_read_back_has_the_same_outline(tmp_path: Path, name: str, profile: str | None) -> None:
    given = outlined(name)
    expected = given.mesh.outline
    assert expected is not None
    path = tmp_path / "a.glb"
    write(given, path, profile=profile_named(profile))
    found = load_textured(path)
    assert found.outline is not None
    for key in ("vertices", "faces"):
        assert np.array_equal(getattr(found.outline, key), getattr(expected, key)), key
    if name == "ribbon as drawn":
        assert given.mesh.texture is not None
        assert expected.uv is not None
        assert np.array_equal(found.outline.uv, expected.uv)
        assert np.array_equal(found.outline.colors, sample(given.mesh.texture, expected.uv))
    else:
        assert found.outline.uv is None
        assert np.array_equal(found.outline.colors, expected.colors)
    assert (found.outline.culled, found.outline.width_m) == (expected.culled, expected.width_m)
    # The surface before the inset is not in the file.
    assert np.array_equal(without_outline(found).vertices, found.vertices)
    assert np.array_equal(read_model(path).faces, found.faces)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", FORMS)
def test_colours_of_the_pens(name: str, profile: str | None) -> None:
    given = outlined(name)
    assert given.mesh.outline is not None
    gltf = read_back(given, profile)
    (index,) = gltf.outlines
    (primitive,) = gltf.primitives(index)
    material = gltf.item("materials", primitive["material"])
    assert material["name"] == "outline"
    assert material["doubleSided"] is ("ribbon" in name)
    assert ("KHR_materials_unlit" in material.get("extensions", {})) == (profile in (None, "cesiumjs"))
    surface, attributes = material["pbrMetallicRoughness"], primitive["attributes"]
    assert "NORMAL" not in attributes
    # CesiumJS samples property textures, if there are any, in every primitive.
    property_textures = bool(gltf.extension("EXT_structural_metadata").get("propertyTextures"))
    assert ("TEXCOORD_0" in attributes) == (property_textures or profile == "qgis" or name == "ribbon as drawn")
    if name == "ribbon as drawn":
        # The texture of the figure, at the ribbon's own coordinates.
        assert surface["baseColorTexture"] == gltf.item("materials", 0)["pbrMetallicRoughness"]["baseColorTexture"]
        found = gltf.numbers(attributes["TEXCOORD_0"])
        assert given.mesh.outline.uv is not None
        assert np.sort(found, axis=0) == pytest.approx(np.sort(given.mesh.outline.uv, axis=0), abs=1e-5)
        return
    pens = np.unique(given.mesh.outline.colors, axis=0)
    if profile == "qgis":
        source = gltf.item("textures", surface["baseColorTexture"]["index"])["source"]
        with Image.open(io.BytesIO(gltf.image(source))) as image:
            texels = np.asarray(image.convert("RGB"))[0]
        column = np.floor(gltf.accessor(attributes["TEXCOORD_0"])[:, 0] * len(texels)).astype(int)
        assert np.array_equal(texels[column], given.mesh.outline.colors)
    elif len(pens) == 1:
        assert np.array_equal(np.rint(srgb_from_linear(np.array(surface["baseColorFactor"][:3])) * 255), pens[0])
        assert surface["baseColorFactor"][3] == 1.0
    else:
        linear = gltf.numbers(attributes["COLOR_0"])
        assert (linear[:, 3] == 1).all()
        assert np.array_equal(np.unique(np.rint(srgb_from_linear(linear[:, :3]) * 255), axis=0), pens)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", FORMS)
def test_the_outline_is_a_child_of_the_figure_and_changes_nothing_of_it(name: str, profile: str | None) -> None:
    given = outlined(name)
    gltf = read_back(given, profile)
    figure, outline = gltf.items("nodes")
    assert (figure["name"], figure["children"]) == ("farmer", [1])
    assert outline == {"name": "outline", "mesh": 1}
    bare = read_back(replace(given, lods=(replace(given.mesh, outline=None),)), profile)
    ((vertices, faces),), ((expected, same),) = gltf.scene_solids(), bare.scene_solids()
    assert np.array_equal(faces, same)
    # Quantised, both are in the grid of the larger one.
    assert vertices == pytest.approx(expected, abs=0 if profile != "cesiumjs" else 3e-5)
    assert ("EXT_mesh_manifold" in gltf.item("meshes", 0).get("extensions", {})) == (profile in (None, "cesiumjs"))
    for key in ("EXT_structural_metadata", "KHR_xmp_json_ld"):
        assert list(gltf.extension(key)) == list(bare.extension(key))


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
@pytest.mark.parametrize("name", FORMS)
def test_validators_find_nothing(tmp_path: Path, name: str, suffix: str, node: RunScript) -> None:
    files = []
    for profile in PROFILES:
        files.append(write(outlined(name), tmp_path / f"{profile}{suffix}", profile=profile_named(profile))[-1])
        severe = [each for each in validate(files[-1], external=False) if each.severity != "info"]
        assert severe == []
    for report in node("validate_gltf.mjs", *files):
        issues = report["issues"]
        assert (issues["numErrors"], issues["numWarnings"], issues["numHints"]) == (0, 0, 0), issues["messages"]


def test_damaged_outlines_are_found(tmp_path: Path) -> None:
    hull, ribbon = FORMS["hull"], FORMS["ribbon"]
    assert hull.outline is not None
    assert ribbon.outline is not None
    broken = {
        "INSIDE_OUT": replace(hull, outline=replace(hull.outline, faces=hull.outline.faces[:, ::-1])),
        "NOT_CLOSED": replace(hull, outline=replace(hull.outline, faces=hull.outline.faces[1:])),
        "ONE_SIDED": replace(ribbon, outline=replace(ribbon.outline, faces=ribbon.outline.faces[1:])),
    }
    for code, mesh in broken.items():
        write_glb(asset(lods=(mesh,)), tmp_path / "a.glb")
        assert [each.code for each in validate(tmp_path / "a.glb", external=False)] == [code]
    (tmp_path / "a.glb").write_bytes(
        glb_bytes(asset(lods=(hull,))).replace(b'"doubleSided":false', b'"doubleSided":true ')
    )
    assert [each.code for each in validate(tmp_path / "a.glb", external=False)] == ["TWO_SIDED"]


@pytest.mark.parametrize("name", ["hull", "ribbon"])
def test_facts_count_the_outline_apart(tmp_path: Path, name: str) -> None:
    given = outlined(name)
    assert given.mesh.outline is not None
    write(given, tmp_path / "a.glb")
    write(replace(given, lods=(replace(given.mesh, outline=None),)), tmp_path / "bare.glb")
    facts, bare = inspect(tmp_path / "a.glb"), inspect(tmp_path / "bare.glb")
    assert facts.pop("outline") == {"form": name, "triangles": len(given.mesh.outline.faces)}
    assert bare.pop("outline") is None
    assert facts.pop("size_m") == pytest.approx([0.6, HEIGHT, 0.6] if name == "hull" else [0.6, HEIGHT, 0.59], abs=1e-6)
    differs = ("files", "bounds_m", "size_m")
    assert {key: facts[key] for key in facts if key not in differs} == {
        key: bare[key] for key in bare if key not in differs
    }


@pytest.mark.parametrize("profile", [None, "cesiumjs"])
@pytest.mark.parametrize("version", ["1.0", "1.1"])
def test_bounding_volumes_hold_the_outline(tmp_path: Path, version: str, profile: str | None) -> None:
    if version == "1.0" and profile:
        pytest.skip("3D Tiles 1.0 has no compression")
    mesh = FORMS["hull"]
    assert mesh.outline is not None
    far = replace(mesh.outline, vertices=mesh.outline.vertices * np.float32(1.5))  # farther out than any other vertex
    given = asset(ZURICH, lods=(replace(mesh, outline=far), ribboned(capsule(deviation_m=(0.001, 0.003)))))
    written = write(given, tmp_path, tiles_version=version, profile=profile_named(profile))  # type: ignore[arg-type]
    assert [each for each in validate(tmp_path / "tileset.json", external=False) if each.severity != "info"] == []
    record = figure_of(given, ("a", "b"))
    assert record.high[2] == pytest.approx(1.5 * HEIGHT, abs=1e-4)
    half = json.loads((tmp_path / "tileset.json").read_text())["root"]["boundingVolume"]["box"][3:]
    assert 2 * half[8] == pytest.approx(1.5 * HEIGHT, abs=0.01)
    if version == "1.1":
        (finest,) = (path for path in written if path.name == "farmer.glb")
        assert read_figure(finest).high == pytest.approx(record.high, abs=5e-5)
        assert read_figure(finest).observed == (None if profile else record.observed)


def test_parts_of_an_outlined_figure_in_tiles_of_version_1_0(tmp_path: Path) -> None:
    write(outlined("hull"), tmp_path, tiles_version="1.0")
    tile = read_b3dm((tmp_path / "farmer.b3dm").read_bytes())
    assert tile.batch_table["name"] == ["torso", "head", "l_upper_leg"]
    inside = glb_of(tile.glb, Path("farmer.b3dm"))
    assert list(inside.outlines.values()) == ["hull"]
    attributes = [primitive["attributes"] for mesh in (0, 1) for primitive in inside.primitives(mesh)]
    assert ["_BATCHID" in each for each in attributes] == [True, False]


@pytest.mark.parametrize("name", ["hull", "ribbon"])
@pytest.mark.parametrize("suffix", [".ply", ".obj", ".usda", ".usdz"])
def test_formats_without_outlines_show_the_surface_as_drawn(tmp_path: Path, suffix: str, name: str) -> None:
    write(outlined(name), tmp_path / f"a{suffix}")
    write(asset(ZURICH, lods=(without_outline(FORMS[name]),)), tmp_path / "bare" / f"a{suffix}")
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / "bare" / f"a{suffix}").read_bytes()


def test_without_outline_is_the_mesh_before_the_inset() -> None:
    for mesh in FORMS.values():
        bare = without_outline(mesh)
        assert bare.outline is None
        assert np.array_equal(bare.vertices, capsule().vertices)
        assert np.array_equal(bare.faces, mesh.faces)
        assert without_outline(bare) is bare


def test_levels_whose_pixels_are_wider_than_the_line_have_no_outline() -> None:
    line = 0.01
    error = line * MAX_SCREEN_SPACE_ERROR_PX
    fine = gradient_texture(512)  # its texels are narrower than the line
    levels = tuple(
        hulled(capsule(deviation_m=(0.0, each), texture=fine), line) for each in (2 * error, 0.99 * error, 1.01 * error)
    )
    found = with_visible_outlines(asset(ZURICH, lods=levels)).lods
    assert [mesh.outline is not None for mesh in found] == [True, True, False]
    assert np.array_equal(found[2].vertices, capsule().vertices)


def test_padding_of_a_texture_moves_the_coordinates_of_the_outline() -> None:
    mesh = ribboned(capsule(texture=gradient_texture(63)), drawn=True)
    wide = padded(mesh)
    assert mesh.texture is not None
    assert wide.texture is not None
    assert mesh.outline is not None
    assert wide.outline is not None
    assert mesh.outline.uv is not None
    assert wide.outline.uv is not None
    found, expected = sample(wide.texture, wide.outline.uv), sample(mesh.texture, mesh.outline.uv)
    assert np.abs(found.astype(int) - expected).max() <= 1


def test_an_outline_must_fit_its_mesh() -> None:
    mesh = FORMS["hull"]
    assert mesh.outline is not None
    with pytest.raises(ValueError, match="its surface has only 7 vertices"):
        replace(mesh, outline=replace(mesh.outline, surface=mesh.outline.surface[:7]))
    with pytest.raises(ValueError, match="outside the"):
        replace(mesh.outline, vertices=mesh.outline.vertices[:7], colors=mesh.outline.colors[:7])
    with pytest.raises(ValueError, match="no outline"):
        replace(mesh.outline, faces=mesh.outline.faces[:0])
    assert PENS.dtype == np.uint8
