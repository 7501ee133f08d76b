"""Files for one client, read back by other programs."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree

from exporters.asset import Asset, Texture, TexturedMesh
from exporters.errors import ExportError
from exporters.gltf.glb import glb_bytes, write_glb, write_gltf
from exporters.gltf.ktx2 import size_of
from exporters.gltf.part_borders import split_at_parts
from exporters.gltf.reader import Gltf, read_gltf
from exporters.inspect import inspect
from exporters.profiles import PROFILES, profile_named
from exporters.validate import validate
from exporters.write import check_outputs, write
from tests.exporters.analytic import HEIGHT, ZURICH, asset, capsule
from tests.node import ROOT, RunScript, runner

CESIUM = PROFILES["cesiumjs"]
STEP = HEIGHT / 65535
"""Of a position: the capsule's longest side in 65535 steps."""

# fmt: off
VARIANTS: dict[str, Asset] = {
    "all": asset(ZURICH, lit=True),
    "vertex colours, no normals": asset(
        lods=(
            capsule(
                texture=None, uv=None, observed=None, normals=None,
                colors=np.tile(np.array([[255, 128, 0]], np.uint8), (len(capsule().vertices), 1)),
            ),
        )
    ),
    "uint32 indices": asset(lods=(capsule(600, 40),)),
    "a kilometre": asset(lods=(capsule(vertices=capsule().vertices * 1000 + (200, 0, -70)),)),
}
# fmt: on


@pytest.fixture
def codec_tools(codecs: Path, monkeypatch: pytest.MonkeyPatch) -> RunScript:
    """Scripts of tests/clients with the packages of `codecs`, which our encoder finds too."""
    monkeypatch.setenv("NODE_PATH", str(codecs))
    return runner(codecs)


def _where(gltf: Gltf) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Positions and triangles of the one mesh, in metres."""
    ((_, matrix),) = gltf.instances()
    positions, faces = gltf.mesh_arrays()
    return positions @ matrix[:3, :3].T + matrix[:3, 3], faces


def _same_triangles(mesh: TexturedMesh, gltf: Gltf, step: float) -> None:
    """The file's triangles are the mesh's: the same corners in the same sense, each within half a step."""
    positions, faces = _where(gltf)
    attributes = gltf.document["meshes"][0]["primitives"][0]["attributes"]
    scale = np.abs(mesh.vertices).max()
    here, there = mesh.vertices / scale, positions / scale
    if mesh.uv is not None:  # distinguishes the copies of a vertex along a seam
        here, there = (
            np.hstack([here, mesh.uv]),
            np.hstack([there, gltf.numbers(attributes["TEXCOORD_0"])]),
        )
    _, nearest = cKDTree(here).query(there)
    # Half a step along each axis, and what float32 of the mesh itself rounds.
    assert np.abs(mesh.vertices[nearest] - positions).max() <= step / 2 + scale * 2.0**-23

    def canonical(triangles: NDArray[np.int64]) -> set[tuple[int, ...]]:
        first = triangles.argmin(axis=1)[:, None]
        return set(map(tuple, np.take_along_axis(triangles, (first + np.arange(3)) % 3, axis=1).tolist()))

    alias = np.arange(len(mesh.vertices)) if mesh.uv is not None else mesh.solid_index.astype(np.int64)
    assert canonical(alias[nearest[faces]]) == canonical(alias[mesh.faces])


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if "uint32" in name else name for name in VARIANTS]
)
def test_compressed_files_come_back_within_half_a_step(tmp_path: Path, name: str, codec_tools: RunScript) -> None:
    given = VARIANTS[name]
    step = float(np.ptp(given.mesh.vertices, axis=0).max()) / 65535
    packed, plain = tmp_path / "packed.glb", tmp_path / "plain.glb"
    write_glb(given, packed, CESIUM)
    assert [finding for finding in validate(packed, external=False) if finding.severity != "info"] == []
    _same_triangles(given.mesh, read_gltf(packed), step)
    # Again with an independent decoder.
    (required,) = codec_tools("decompress_gltf.mjs", packed, plain)
    assert set(required) >= {"EXT_meshopt_compression", "KHR_mesh_quantization"}
    _same_triangles(given.mesh, read_gltf(plain), step)
    (report,) = codec_tools("validate_gltf.mjs", plain)
    assert (report["issues"]["numErrors"], report["issues"]["numWarnings"]) == (0, 0), report["issues"]["messages"]


def test_compressed_parts_and_solid_are_those_of_the_plain_file(tmp_path: Path) -> None:
    given = asset(ZURICH, lit=True)
    write_glb(given, tmp_path / "packed.glb", CESIUM)
    write_glb(given, tmp_path / "plain.glb")
    packed, plain = inspect(tmp_path / "packed.glb"), inspect(tmp_path / "plain.glb")
    for key in ("name", "triangles", "watertight", "solid", "components", "genus", "parts", "placement", "metadata"):
        assert packed[key] == plain[key], key
    assert packed["size_m"] == pytest.approx(plain["size_m"], abs=STEP)
    assert packed["volume_m3"] == pytest.approx(plain["volume_m3"], rel=1e-4)
    assert packed["observed"] == pytest.approx(plain["observed"], abs=0.02)
    # Feet stay on the ground, to the bit: quantisation begins at the lowest vertex.
    assert packed["bounds_m"][0][1] == plain["bounds_m"][0][1]
    gltf = read_gltf(tmp_path / "packed.glb")
    attributes = gltf.document["meshes"][0]["primitives"][0]["attributes"]
    labels = np.array([1, 2, 9])[gltf.accessor(attributes["_FEATURE_ID_0"]).astype(int)]
    where, faces = _where(gltf)
    assert (labels[faces] == labels[faces][:, :1]).all()
    split = split_at_parts(capsule())
    for label in (1, 2, 9):
        heights = np.sort(where[labels == label, 1])
        assert heights == pytest.approx(np.sort(split.vertices[split.parts == label, 1]), abs=STEP)
    normals = gltf.numbers(attributes["NORMAL"])
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(len(normals)), abs=1e-4)


def test_compression_makes_files_smaller(tmp_path: Path) -> None:
    dense = asset(lods=(capsule(120, 40),))
    assert len(glb_bytes(dense, 0, CESIUM)) < len(glb_bytes(dense)) / 4


def test_webp_holds_the_same_pixels(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (12, 20, 4), np.uint8)
    write_glb(asset(lods=(capsule(texture=Texture(pixels)),)), tmp_path / "a.glb", CESIUM)
    with Image.open(io.BytesIO(read_gltf(tmp_path / "a.glb").image(0))) as image:
        assert image.format == "WEBP"
        assert np.array_equal(np.asarray(image), pixels)


def test_ktx2_has_the_size_of_the_texture_in_blocks(tmp_path: Path, codec_tools: RunScript) -> None:
    odd = capsule(texture=Texture(capsule().texture.pixels[:63, :62]))
    write_gltf(asset(lods=(odd,)), tmp_path / "a.gltf", PROFILES["cesiumjs-ktx2"])
    assert {file.name for file in tmp_path.iterdir()} == {"a.gltf", "a.bin", "a_texture.ktx2"}
    gltf = read_gltf(tmp_path / "a.gltf")
    assert size_of(gltf.image(0)) == (64, 64)
    # Padded below and to the right: coordinates shrink by as much.
    attributes = gltf.document["meshes"][0]["primitives"][0]["attributes"]
    assert gltf.numbers(attributes["TEXCOORD_0"]).max(axis=0) == pytest.approx([62 / 64, 63 / 64], abs=1e-4)
    assert "KHR_texture_basisu" in gltf.document["extensionsRequired"]


@pytest.mark.parametrize("name", ["blender", "qgis"])
def test_plain_profiles_are_core_gltf(tmp_path: Path, name: str) -> None:
    write_glb(asset(ZURICH, lods=(capsule(normals=None),)), tmp_path / "a.glb", PROFILES[name])
    gltf = read_gltf(tmp_path / "a.glb")
    assert "extensionsUsed" not in gltf.document
    assert b"extensions" not in (tmp_path / "a.glb").read_bytes()
    (primitive,) = gltf.document["meshes"][0]["primitives"]
    split = split_at_parts(capsule())
    # Smooth although the mesh has no normals: the client shades it.
    assert gltf.accessor(primitive["attributes"]["NORMAL"]) == pytest.approx(split.normals, abs=0.05)
    labels = gltf.accessor(primitive["attributes"]["_PART"])
    assert np.array_equal(labels, split.parts)
    extras = gltf.document["nodes"][0]["extras"]
    assert extras["parts"] == {"1": "torso", "2": "head", "9": "l_upper_leg"}
    assert extras["georeference"]["heading_deg"] == ZURICH.heading_deg


def test_without_vertex_colours_their_mean_remains(tmp_path: Path) -> None:
    write_glb(VARIANTS["vertex colours, no normals"], tmp_path / "a.glb", PROFILES["qgis"])
    (material,) = read_gltf(tmp_path / "a.glb").document["materials"]
    # sRGB 128 is 21.586 % of the light (IEC 61966-2-1).
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([1, 0.2159, 0, 1], abs=1e-4)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if "ktx2" in name else name for name in PROFILES]
)
def test_same_bytes_in_another_process(tmp_path: Path, name: str, codec_tools: RunScript) -> None:
    suffix = ".usdc" if name == "omniverse" else ".glb"
    here = write(asset(ZURICH), tmp_path / f"a{suffix}", profile=PROFILES[name])[-1].read_bytes()
    code = (
        "import sys; from exporters.write import write; from exporters.profiles import *;"
        "from tests.exporters.analytic import *;"
        "write(asset(ZURICH), sys.argv[1], True, profile=profile_named(sys.argv[2]))"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / f"a{suffix}"), name], check=True, cwd=ROOT)
    assert (tmp_path / f"a{suffix}").read_bytes() == here


@pytest.mark.parametrize(
    ("name", "path"), [("cesiumjs", "a.usdc"), ("omniverse", "a.glb"), ("omniverse", "a.usda"), ("blender", "tiles/")]
)
def test_what_the_client_does_not_read_is_refused(tmp_path: Path, name: str, path: str) -> None:
    with pytest.raises(ExportError, match=f"--profile {name} cannot be combined with .*; .* reads "):
        check_outputs([tmp_path / path if path != "tiles/" else f"{tmp_path}/tiles/"], profile=PROFILES[name])
    with pytest.raises(ExportError, match=f"--profile {name} cannot be combined with .*; .* reads "):
        write(asset(ZURICH), tmp_path / path.rstrip("/"), profile=PROFILES[name])
    assert list(tmp_path.iterdir()) == []


def test_missing_tools_are_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="unknown profile 'maya'; choose from cesiumjs"):
        profile_named("maya")
    monkeypatch.setenv("PATH", str(tmp_path))  # no node
    with pytest.raises(ExportError, match=r"KTX 2 needs Node\.js and the npm package ktx2-encoder; npm install"):
        PROFILES["cesiumjs-ktx2"].check_tools()
    monkeypatch.setitem(sys.modules, "meshopt", None)
    with pytest.raises(ExportError, match=r"compression needs the package meshopt; pip install"):
        CESIUM.check_tools()
    PROFILES["blender"].check_tools()


def test_without_the_decoder_compressed_files_are_reported_as_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_glb(asset(), tmp_path / "a.glb", CESIUM)
    monkeypatch.setitem(sys.modules, "meshopt", None)
    findings = validate(tmp_path / "a.glb", external=False)
    assert {finding.severity for finding in findings} == {"info"}
    assert "NOT_READ_HERE" in {finding.code for finding in findings}


def test_tiles_of_a_profile(tmp_path: Path) -> None:
    write(asset(ZURICH), tmp_path / "tiles", profile=CESIUM)
    assert [finding for finding in validate(tmp_path / "tiles", external=False) if finding.severity != "info"] == []
    for lod in range(3):
        content = read_gltf(tmp_path / "tiles" / ("farmer" + (f"_lod{lod}" if lod else "") + ".glb"))
        assert "EXT_meshopt_compression" in content.document["extensionsRequired"]


def test_credits_are_in_dublin_core(tmp_path: Path) -> None:
    write_glb(asset(ZURICH), tmp_path / "a.glb")
    document = read_gltf(tmp_path / "a.glb").document
    (packet,) = document["extensions"]["KHR_xmp_json_ld"]["packets"]
    assert document["asset"]["extensions"]["KHR_xmp_json_ld"] == {"packet": 0}
    assert packet["dc:title"]["rdf:_1"] == {"@language": "x-default", "@value": "farmer"}
    assert packet["dc:rights"]["rdf:_1"]["@value"] == document["asset"]["copyright"] == "© Zürich map, CC BY 4.0"
    assert packet["dc:source"] == "farmer.png"
    place = dict(pair.split("=") for pair in packet["dc:coverage"].split("; "))
    assert (float(place["east"]), float(place["north"]), float(place["elevation"])) == (8.5417, 47.3769, 455.34)
    # Every prefix is declared: a JSON-LD reader can resolve each name.
    prefixes = {key.partition(":")[0] for key in packet if not key.startswith("@")}
    assert prefixes <= set(packet["@context"])
    write_glb(asset(copyright="", metadata={}), tmp_path / "b.glb")
    (bare,) = read_gltf(tmp_path / "b.glb").document["extensions"]["KHR_xmp_json_ld"]["packets"]
    assert not {"dc:rights", "dc:source", "dc:coverage"} & set(bare)
    json.dumps(bare, allow_nan=False)
