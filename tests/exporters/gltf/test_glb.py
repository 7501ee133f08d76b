"""glTF: read back by other libraries, judged by the Khronos validator."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pygltflib
import pytest
import trimesh
from PIL import Image

from exporters.asset import Asset, TexturedMesh
from exporters.errors import ExportError
from exporters.gltf.glb import glb_bytes, write_glb, write_gltf
from exporters.gltf.part_borders import split_at_parts
from exporters.gltf.reader import read_gltf
from exporters.inspect import inspect
from exporters.profiles import profile_named
from exporters.sampling import face_parts
from exporters.validate import validate
from exporters.write import write
from tests.exporters.analytic import ZURICH, asset, capsule, half_observed
from tests.exporters.walk import property_texels
from tests.node import RunScript

COLORS = np.tile(np.array([[255, 128, 0]], np.uint8), (len(capsule().vertices), 1))

VARIANTS: dict[str, Asset] = {
    "all": asset(ZURICH),
    "no parts": asset(lods=(capsule(parts=None),)),
    "no observed mask": asset(lods=(capsule(observed=None),)),
    "vertex colours": asset(lods=(capsule(texture=None, uv=None, observed=None, colors=COLORS),)),
    "bare": asset(
        lods=(capsule(texture=None, uv=None, observed=None, parts=None),), copyright="", metadata={}, part_names={}
    ),
    "uint32 indices": asset(lods=(capsule(600, 40),)),
    "unicode name": asset(name="Bäuerin / 農民", part_names={1: "Rumpf", 2: "Kopf", 9: "ジャンプ"}),
}


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_trimesh_reads_the_same_mesh(tmp_path: Path, suffix: str) -> None:
    given = asset(ZURICH)
    path = tmp_path / f"farmer{suffix}"
    (write_glb if suffix == ".glb" else write_gltf)(given, path)
    read = trimesh.load_mesh(path, process=False)
    mesh = split_at_parts(given.mesh)
    # float32 goes through unchanged: equal to the bit.
    assert np.array_equal(read.vertices.astype(np.float32), mesh.vertices)
    assert np.array_equal(read.faces, mesh.faces)
    # trimesh turns v upwards, in float32, which may cost the last bit.
    assert read.visual.uv * (1, -1) + (0, 1) == pytest.approx(mesh.uv, abs=1e-7)
    assert np.array_equal(np.asarray(read.visual.material.baseColorTexture), given.mesh.texture.pixels)


def test_front_of_the_picture_is_in_front(tmp_path: Path) -> None:
    # The middle of the texture, u = v = 1/2, must be where the figure faces the reader: on +z.
    path = tmp_path / "farmer.glb"
    write_glb(asset(), path)
    read = trimesh.load_mesh(path, process=False)
    middle = np.abs(read.visual.uv - 0.5).max(axis=1).argmin()
    assert read.vertices[middle] == pytest.approx([0, 0.9, 0.3], abs=1e-6)


@pytest.mark.parametrize("name", VARIANTS)
def test_khronos_validator_finds_no_errors_and_no_warnings(tmp_path: Path, name: str, node: RunScript) -> None:
    files = [tmp_path / "a b.glb", tmp_path / "c ü.gltf"]
    write_glb(VARIANTS[name], files[0])
    write_gltf(VARIANTS[name], files[1])
    for report in node("validate_gltf.mjs", *files):
        issues = report["issues"]
        counts = (issues["numErrors"], issues["numWarnings"], issues["numHints"])
        assert counts == (0, 0, 0), issues["messages"]
        # Nothing but that it knows none of these extensions, nor why the data that they refer to is there.
        codes = {message["code"] for message in issues["messages"]}
        assert codes <= {"UNSUPPORTED_EXTENSION", "UNUSED_OBJECT"}


@pytest.mark.parametrize("name", VARIANTS)
def test_own_checks_are_clean(tmp_path: Path, name: str) -> None:
    write_glb(VARIANTS[name], tmp_path / "a.glb")
    write_gltf(VARIANTS[name], tmp_path / "b.gltf")
    assert validate(tmp_path / "a.glb", external=False) == []
    assert validate(tmp_path / "b.gltf", external=False) == []


def test_document_has_the_facts_of_the_asset(tmp_path: Path) -> None:
    write_glb(asset(ZURICH), tmp_path / "a.glb")
    gltf = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    assert (gltf.asset.generator, gltf.asset.copyright) == ("fig2mesh", "© Zürich map, CC BY 4.0")
    place = gltf.asset.extras["georeference"]
    assert (place["lon_deg"], place["lat_deg"], place["height_m"]) == (8.5417, 47.3769, 455.34)
    assert (place["heading_deg"], place["height_datum"]) == (135.0, "egm96")
    assert gltf.asset.extras["metadata"] == {"source": "farmer.png", "seed": 7}
    assert not gltf.extensionsRequired
    (material,) = gltf.materials
    assert "KHR_materials_unlit" in material.extensions
    assert not material.doubleSided
    sampler, evidence = gltf.samplers
    assert (evidence.magFilter, evidence.minFilter) == (9728, 9728)
    assert (sampler.magFilter, sampler.minFilter, sampler.wrapS, sampler.wrapT) == (9729, 9987, 33071, 33071)
    position = gltf.accessors[gltf.meshes[0].primitives[0].attributes.POSITION]
    vertices = asset().mesh.vertices
    assert (position.min, position.max) == (vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist())
    indices = gltf.accessors[gltf.meshes[0].primitives[0].indices]
    assert indices.componentType == pygltflib.UNSIGNED_SHORT


def test_the_mask_of_observed_texels_is_written_only_where_it_is_asked_for(tmp_path: Path) -> None:
    given = asset(ZURICH, observed_pixels=False, lods=(capsule(observed=half_observed(512)),))
    for name, profile in (("a.glb", None), ("b.glb", "cesiumjs"), ("c.gltf", None), ("d.glb", "blender"), ("t", None)):
        write(given, tmp_path / name, profile=profile_named(profile))
    for path in [*tmp_path.glob("*.gl*"), *tmp_path.glob("t/*.glb")]:
        assert property_texels(path) <= 64 * 64, "loaders.gl reads all of it for each vertex"
    facts = inspect(tmp_path / "a.glb")
    assert facts["parts"] == ["torso", "head", "l_upper_leg"]
    assert all(0.4 < share < 0.6 for share in facts["observed"].values())
    write(replace(given, observed_pixels=True), tmp_path / "e.glb")
    assert property_texels(tmp_path / "e.glb") == 512 * 512


def test_indices_become_wide_only_when_they_must(tmp_path: Path) -> None:
    assert len(VARIANTS["uint32 indices"].mesh.vertices) > 65535
    write_glb(VARIANTS["uint32 indices"], tmp_path / "a.glb")
    gltf = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    assert gltf.accessors[gltf.meshes[0].primitives[0].indices].componentType == pygltflib.UNSIGNED_INT


def test_manifold_extension_gives_manifold3d_a_solid(tmp_path: Path) -> None:
    mesh = capsule()
    write_glb(asset(), tmp_path / "a.glb")
    gltf = read_gltf(tmp_path / "a.glb")
    vertices, faces = gltf.solid_arrays()
    used, compact = np.unique(faces, return_inverse=True)
    body = manifold3d.Manifold(
        manifold3d.Mesh(vertices[used].astype(np.float32), compact.reshape(-1, 3).astype(np.uint32))
    )
    assert body.status() == manifold3d.Error.NoError
    assert body.num_tri() == len(mesh.faces)
    assert body.genus() == 0


def test_a_mesh_with_a_hole_does_not_claim_to_be_manifold() -> None:
    whole = capsule()
    for broken in (capsule(faces=whole.faces[1:]), capsule(solid_index=np.arange(len(whole.vertices)))):
        assert b"EXT_mesh_manifold" not in glb_bytes(asset(lods=(broken,)))
    assert b"EXT_mesh_manifold" in glb_bytes(asset())


def test_a_property_texture_marks_observed_texels(tmp_path: Path) -> None:
    path = tmp_path / "farmer.glb"
    write_glb(asset(ZURICH), path)
    gltf = read_gltf(path)
    metadata = gltf.document["extensions"]["EXT_structural_metadata"]
    (holder,) = metadata["propertyTextures"]
    assert holder["class"] in metadata["schema"]["classes"]
    texture = gltf.document["textures"][holder["properties"]["observed"]["index"]]
    with Image.open(io.BytesIO(gltf.image(texture["source"]))) as image:
        assert np.array_equal(np.asarray(image), half_observed().pixels[..., 0])
    primitive = gltf.document["meshes"][0]["primitives"][0]
    assert primitive["extensions"]["EXT_structural_metadata"] == {"propertyTextures": [0]}
    # The colours stay the first image: clients without metadata support use only that.
    assert primitive["material"] == 0
    assert gltf.document["textures"][0]["source"] == 0


def test_parts_and_their_observed_shares(tmp_path: Path) -> None:
    write_glb(asset(), tmp_path / "a.glb")
    gltf = read_gltf(tmp_path / "a.glb")
    (table,) = gltf.document["extensions"]["EXT_structural_metadata"]["propertyTables"]
    shares = np.frombuffer(gltf.view(table["properties"]["observedShare"]["values"]), "<f4")
    # The mask shows half of each part; 16 samples per triangle resolve its two edges to 1/100 of the circumference.
    assert shares == pytest.approx([0.5] * 3, abs=0.01)
    primitive = gltf.document["meshes"][0]["primitives"][0]
    ids = gltf.accessor(primitive["attributes"]["_FEATURE_ID_0"])[gltf.accessor(primitive["indices"])]
    # One id per triangle, as clients interpolate between its corners.
    assert np.array_equal(np.array([1, 2, 9])[ids.astype(int)], np.repeat(face_parts(asset().mesh), 3))


def test_vertex_colours_are_linear(tmp_path: Path) -> None:
    write_glb(VARIANTS["vertex colours"], tmp_path / "a.glb")
    gltf = read_gltf(tmp_path / "a.glb")
    color = gltf.accessor(gltf.document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"])
    # sRGB 128 is 21.586 % of the light (IEC 61966-2-1); steps of uint16 are 1.5e-5.
    assert color[0] / 65535 == pytest.approx([1, 0.21586, 0, 1], abs=2e-5)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_textures_of_every_kind_come_back_equal(channels: int) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, channels), np.uint8)
    from exporters.asset import Texture

    with Image.open(io.BytesIO(Texture(pixels).png)) as image:
        assert np.array_equal(np.asarray(image).reshape(5, 7, channels), pixels)


def test_same_asset_same_bytes_and_unchanged_input(tmp_path: Path) -> None:
    given, again = asset(ZURICH), asset(ZURICH)
    assert glb_bytes(given) == glb_bytes(given) == glb_bytes(again)
    assert _state(given) == _state(again)
    write_gltf(given, tmp_path / "a.gltf")
    first = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    write_gltf(again, tmp_path / "a.gltf")
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == first
    assert set(first) == {"a.gltf", "a.bin", "a_texture.png"}


def _state(given: Asset) -> Any:
    def bytes_of(mesh: TexturedMesh) -> list[bytes]:
        return [value.tobytes() for value in vars(mesh).values() if isinstance(value, np.ndarray)]

    return [bytes_of(mesh) for mesh in given.lods], json.dumps(given.metadata), given.part_names


def test_a_mesh_without_triangles_is_refused() -> None:
    with pytest.raises(ExportError, match=r"farmer: .*no triangles"):
        glb_bytes(asset(lods=(capsule(faces=np.empty((0, 3), int)),)))
