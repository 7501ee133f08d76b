"""Files made to hurt: small, and dear to whoever takes them at their word. All are refused, or read, in no time."""

from __future__ import annotations

import io
import json
import os
import struct
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from exporters.errors import ExportError
from exporters.figure_reader import read_figures
from exporters.gltf.reader import read_gltf
from exporters.inspect import inspect
from exporters.tiles.b3dm import read_b3dm
from exporters.validate import validate
from fig2mesh.conversion.record_types import fits
from fig2mesh.conversion.stores import FolderStore
from fig2mesh.errors import FigureError
from fig2mesh.parse.picture import read_rgba, read_view
from fig2mesh.parse.window import is_large
from fig2mesh.records import Mesh, Pose3D, UvMesh
from fig2mesh.render.model import read_model
from georef.errors import PlacementError
from georef.heights import undulation_m
from georef.mapsheet import read_sheet
from georef.sheets.pictures import read_picture
from georef.sheets.reference import crs_of
from georef.untrusted.damage import DamagedFile
from tests.fuzz import seeds
from tests.fuzz.readers import READERS
from tests.fuzz.worker import outcome


def png(width: int, height: int, data: bytes, *chunks: tuple[bytes, bytes], interlace: int = 0) -> bytes:
    """A grey PNG of 8 bits with a given header; data : packed rows."""
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, interlace)
    parts = [(b"IHDR", head), *chunks, (b"IDAT", data), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in parts
    )


def refused(
    tmp_path: Path, name: str, data: bytes, finding: str, bbox: tuple[int, int, int, int] | None = None
) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(FigureError, match=finding):
        read_view(tmp_path / name, bbox)


def test_pictures_of_more_pixels_than_are_decoded(tmp_path: Path) -> None:
    refused(tmp_path, "a.png", png(40_000, 40_000, b""), "more than 179 Mpx")
    refused(tmp_path, "a.png", png(40_000, 40_000, b""), "40000×40000 px in 0 kB", (0, 0, 9, 9))
    refused(tmp_path, "a.png", png(40_000, 40_000, b"", interlace=1), "interlaced", (0, 0, 9, 9))
    refused(tmp_path, "a.png", png(60_000, 60_000, b""), "a window of 3598 Mpx", (0, 0, 59_980, 59_980))


def test_texts_in_pictures_that_unpack_to_gigabytes_are_left_packed(tmp_path: Path) -> None:
    packed = zlib.compress(bytes(200_000_000), 9)
    rows = zlib.compress(bytes(9 * 10))
    for chunk in ((b"zTXt", b"k\0\0" + packed), (b"iTXt", b"k\0\1\0\0\0" + packed), (b"iCCP", b"k\0\0" + packed)):
        (tmp_path / "a.png").write_bytes(png(9, 9, rows, chunk))
        assert outcome(READERS["picture"], tmp_path / "a.png") in ("", "refused")


def test_a_progressive_picture_of_endless_scans(tmp_path: Path) -> None:
    stream = io.BytesIO()
    Image.new("L", (8000, 8000), 100).save(stream, "JPEG", progressive=True)
    data = stream.getvalue()
    again = data[data.rfind(b"\xff\xc4", 0, data.rfind(b"\xff\xda")) : -2]  # the last scan with its codes
    refused(tmp_path, "a.jpg", data[:-2] + again * 2000 + b"\xff\xd9", "a progressive JPEG of 20.. scans")
    (tmp_path / "b.jpg").write_bytes(data)
    assert read_rgba(tmp_path / "b.jpg").shape == (8000, 8000, 4)


def test_heads_are_read_without_decoding(tmp_path: Path) -> None:
    rows = zlib.compress(b"no rows of a picture")
    (tmp_path / "a.png").write_bytes(png(40_000, 40_000, rows))
    assert read_picture(tmp_path / "a.png").size == (40_000, 40_000)
    (tmp_path / "a.png").write_bytes(png(5_000, 5_000, rows))
    assert is_large(tmp_path / "a.png")
    exif = Image.Exif()
    exif[274] = 6
    Image.new("L", (5_000, 5_000)).save(tmp_path / "turned.png", exif=exif)
    assert not is_large(tmp_path / "turned.png")
    with pytest.raises(PlacementError, match="EXIF orientation"):
        read_picture(tmp_path / "turned.png")


def test_formats_whose_readers_start_other_programs_or_expand_entities(tmp_path: Path) -> None:
    refused(tmp_path, "a.png", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\nshowpage\n%%EOF\n", "not a picture")
    entities = '<!DOCTYPE svg [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]>'
    svg = f'<?xml version="1.0"?>{entities}<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9">&b;</svg>'
    refused(tmp_path, "a.png", svg.encode(), "not a picture")
    from fig2mesh.parse.window import read_window

    with pytest.raises(FigureError, match="cannot be read"):
        read_window(tmp_path / "a.png", (0, 0, 5, 5))


def test_deep_greys_are_read_without_copies_and_without_nan(tmp_path: Path) -> None:
    values = np.array([[0.0, np.nan, 1e30], [-5.0, 65535.0, np.inf]], np.float32)
    Image.fromarray(values).save(tmp_path / "a.tif")
    grey = read_rgba(tmp_path / "a.tif")
    assert grey[..., 0].tolist() == [[0, 0, 255], [0, 255, 255]]
    assert (grey[..., 3] == 255).all()


def test_a_palette_that_is_too_short(tmp_path: Path) -> None:
    image = Image.fromarray(np.full((4, 4), 9, np.uint8), "L")
    image.putpalette(bytes(6))
    stream = io.BytesIO()
    image.save(stream, "PNG", bits=8)
    (tmp_path / "a.png").write_bytes(stream.getvalue())
    assert outcome(READERS["picture"], tmp_path / "a.png") in ("", "refused")


def glb(path: Path, document: dict[str, Any], binary: bytes = b"") -> Path:
    text = json.dumps({"asset": {"version": "2.0"}} | document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


POINTS = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 0]}


def test_accessors_that_hold_more_than_the_file(tmp_path: Path) -> None:
    path = glb(tmp_path / "a.glb", {"accessors": [{"componentType": 5126, "count": 2**40, "type": "MAT4"}]})
    (finding,) = (each for each in validate(path, external=False) if each.code == "NOT_READ_HERE")
    assert "far more than the file" in finding.message
    views = [{"buffer": 0, "byteLength": 36}]
    many = {
        "accessors": [POINTS] * 5 + [{**POINTS, "count": 10**9}],
        "bufferViews": views,
        "buffers": [{"byteLength": 36}],
    }
    found = validate(glb(tmp_path / "b.glb", many, bytes(36)), external=False)
    assert {each.code for each in found} >= {"NOT_READ_HERE"}


def test_rows_that_overlap_and_nodes_with_two_parents(tmp_path: Path) -> None:
    document: dict[str, Any] = {
        "accessors": [POINTS],
        "bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 1}],
        "buffers": [{"byteLength": 36}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        # Each names the next one twice: 2^60 instances.
        "nodes": [{"children": [i + 1, i + 1]} for i in range(60)] + [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    path = glb(tmp_path / "a.glb", document, bytes(36))
    with pytest.raises(DamagedFile, match="rows of 12 bytes every 1"):
        read_gltf(path).accessor(0)
    with pytest.raises(ExportError, match="two parents"):
        inspect(path)
    with pytest.raises(ExportError, match="invalid glTF"):
        read_model(path)


def test_a_mesh_that_is_shown_a_million_times(tmp_path: Path) -> None:
    count = 3_000
    document: dict[str, Any] = {
        "accessors": [{**POINTS, "count": count}],
        "bufferViews": [{"buffer": 0, "byteLength": 12 * count}],
        "buffers": [{"byteLength": 12 * count}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}] * 10_000,
        "scenes": [{"nodes": list(range(10_000))}],
    }
    path = glb(tmp_path / "a.glb", document, bytes(12 * count))
    with pytest.raises(ExportError, match="far more than the file"):
        inspect(path)


def test_textures_of_more_pixels_than_are_decoded(tmp_path: Path) -> None:
    image = png(9000, 9000, b"")
    image += bytes(-len(image) % 4)
    document = {
        "images": [{"bufferView": 0, "mimeType": "image/png"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(image)}],
        "buffers": [{"byteLength": len(image)}],
    }
    path = glb(tmp_path / "a.glb", document, image)
    assert [each.message for each in validate(path, external=False) if each.code == "NOT_READ_HERE"] == [
        "9000 x 9000 px, more than 67 million"
    ]


def test_tilesets_that_name_each_other_without_end(tmp_path: Path) -> None:
    volume = {"boundingVolume": {"sphere": [0, 0, 0, 9]}, "geometricError": 0}
    for number in range(20):
        content = {**volume, "content": {"uri": f"{number + 1}.json"}}
        root = {**volume, "refine": "ADD", "children": [content] * 2}
        document = {"asset": {"version": "1.1"}, "geometricError": 0, "root": root}
        (tmp_path / f"{number}.json").write_text(json.dumps(document))
    (tmp_path / "20.json").write_text(json.dumps({"asset": {"version": "1.1"}, "root": {**volume, "refine": "ADD"}}))
    found = validate(tmp_path / "0.json", external=False)
    assert any("referred to more than 20 times" in each.message for each in found)
    assert list(read_figures(tmp_path / "0.json")) == []


def test_models_that_name_devices_pipes_and_other_peoples_files(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    for name in ("/dev/zero", "pipe"):
        (tmp_path / "a.mtl").write_text(f"newmtl a\nmap_Kd {name}\n")
        (tmp_path / "a.obj").write_text("mtllib a.mtl\n" + triangle)
        (tmp_path / "b.obj").write_text(f"mtllib {name}\n" + triangle)
        for obj in ("a.obj", "b.obj"):
            with pytest.raises(ExportError, match="not a regular file"):
                inspect(tmp_path / obj)
            with pytest.raises(ExportError, match="not a regular file"):
                read_model(tmp_path / obj)
        gltf = {"asset": {"version": "2.0"}, "images": [{"uri": name}], "buffers": [{"uri": name, "byteLength": 9}]}
        (tmp_path / "a.gltf").write_text(json.dumps(gltf))
        with pytest.raises(ExportError, match="not a regular file"):
            inspect(tmp_path / "a.gltf")
    (tmp_path / "c.obj").write_text("".join(f"mtllib {n}.mtl\n" for n in range(100)) + triangle)
    with pytest.raises(ExportError, match="refers to 100 files"):
        inspect(tmp_path / "c.obj")


def test_tables_of_batched_models_that_are_no_tables() -> None:
    for text in (b"[]      ", b"[NaN]   ", b"[" * 4096):
        data = struct.pack("<4s6I", b"b3dm", 1, 28 + len(text) + 4, len(text) + 4, 0, 0, 0) + text + b"    "
        with pytest.raises(DamagedFile, match=r"object|NaN|JSON|nested"):
            read_b3dm(data)


def test_packages_that_unpack_to_more_than_they_are(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.usdz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("../../evil.usda", "#usda 1.0\n")
        for number in range(3):
            archive.writestr(f"{number}.png", bytes(9_000_000))
    found = {each.message for each in validate(tmp_path / "a.usdz") if each.code == "PACKAGE"}
    assert {"is compressed", "leads out of the package"} <= found


def _member(head: str, data: bytes = b"") -> bytes:
    text = head.encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data


@pytest.mark.parametrize(
    ("member", "finding"),
    [
        (_member("{'descr': '<f8', 'fortran_order': False, 'shape': (999999999999,), }"), "in 0 bytes"),
        (_member("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", bytes(8)), "object"),
        (_member("{'descr': '<f4', 'fortran_order': False, 'shape': (-1,), }"), "shape"),
        (_member("{'descr': '<f4',"), "not a stage file"),
        (_member("(" * 100), "not a stage file"),
        (b"", "not a stage file"),
    ],
)
def test_arrays_whose_heads_lie(tmp_path: Path, member: bytes, finding: str) -> None:
    FolderStore(tmp_path).write_file("lift", Pose3D(np.zeros((21, 3), np.float32)))
    with zipfile.ZipFile(tmp_path / "lift.npz") as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "lift.npz", "w") as archive:
        for name, data in (members | {"a0.npy": member}).items():
            archive.writestr(name, data)
    with pytest.raises(FigureError, match=finding):
        FolderStore(tmp_path).read_file("lift", Pose3D)


def test_a_stage_of_another_kind_and_records_whose_fields_do_not_fit(tmp_path: Path) -> None:
    FolderStore(tmp_path).write_file("lift", Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32)))
    with pytest.raises(FigureError, match="a record of kind Mesh"):
        FolderStore(tmp_path).read_file("lift", Pose3D)
    assert fits((1, 2.5), tuple[int, float])
    assert not fits((True, 2.5), tuple[int, float])
    assert fits({"a": None}, dict[str, int | None])
    assert not fits({1: None}, dict[str, int | None])
    corner = np.eye(3, dtype=np.float32)
    faces = np.array([[0, 1, 2]], np.int32)
    with pytest.raises(ValueError, match="index outside the 3 vertices"):
        UvMesh(Mesh(corner, faces), faces + 1, np.arange(3, dtype=np.int32), corner[:, :2], (8, 8))


def test_a_stage_that_unpacks_to_gigabytes(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "lift.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(3):
            with archive.open(f"a{number}.npy", "w") as stream:
                for _ in range(16):
                    stream.write(bytes(1 << 20))
    data = bytearray((tmp_path / "lift.npz").read_bytes())
    for place in range(len(data) - 46):
        if data[place : place + 4] == b"PK\1\2":
            struct.pack_into("<I", data, place + 24, 1 << 30)  # the size of each member in the directory
    (tmp_path / "lift.npz").write_bytes(data)
    with pytest.raises(FigureError, match=r"unpacks to 3.22 GB, more than 2.15 GB"):
        FolderStore(tmp_path).read_file("lift", Pose3D)


def grid(**tags: tuple[int, int, int]) -> bytes:
    """A TIFF of one strip of 4 x 5 floats; tags : _NUMBER=(type, count, value) replaces an entry."""
    entries = {
        256: (3, 1, 5),
        257: (3, 1, 4),
        258: (3, 1, 32),
        259: (3, 1, 1),
        262: (3, 1, 1),
        273: (4, 1, 200),
        277: (3, 1, 1),
        278: (3, 1, 4),
        279: (4, 1, 80),
        339: (3, 1, 3),
    }
    entries |= {int(name[1:]): value for name, value in tags.items()}
    data = struct.pack("<2sHIH", b"II", 42, 8, len(entries))
    for tag, (kind, count, value) in sorted(entries.items()):
        data += struct.pack("<HHII", tag, kind, count, value)
    return (data + bytes(4)).ljust(200, b"\0") + bytes(80)


@pytest.mark.parametrize(
    ("data", "finding"),
    [
        (grid(_278=(3, 1, 0)), "blocks of 5 x 0"),
        (grid(_256=(3, 1, 0)), "a grid of 0 x 4"),
        (grid(_256=(4, 1, 2**31)), "a grid of 2147483648 x 4"),
        (grid(_278=(3, 1, 1)), "1 of 4 blocks"),
        (grid(_322=(3, 1, 0), _323=(3, 1, 16)), "blocks of 0 x 16"),
        (grid(_258=(3, 1, 0)), "values of 0 bits"),
        (grid(_42112=(2, 2**31, 8)), "tag 42112 ends at byte"),
        (grid()[:100], "truncated"),
        (grid()[: 8 + 2 + 120] + struct.pack("<I", 8) + bytes(200), "a cycle of directories"),
        (b"II*\0" + bytes(12), "without a directory"),
        (b"no TIFF at all..", "not a TIFF file"),
    ],
)
def test_geoid_grids_that_end_the_process_in_proj(tmp_path: Path, data: bytes, finding: str) -> None:
    (tmp_path / "a.tif").write_bytes(data)
    with pytest.raises(PlacementError, match=finding):
        undulation_m(8.1, 46.9, tmp_path / "a.tif")


@pytest.mark.parametrize(
    "head",
    [
        (46.0, 7.0, 0.5, 0.5, 2**30, 2**30),
        (46.0, 7.0, 0.0, 0.5, 2, 2),
        (float("nan"), 7.0, 0.5, 0.5, 2, 2),
        (46.0, 7.0, 0.5, 0.5, -2, 2),
    ],
)
def test_gtx_grids_whose_heads_lie(tmp_path: Path, head: tuple[float, ...]) -> None:
    (tmp_path / "a.gtx").write_bytes(struct.pack(">4d2i", *head) + bytes(16))
    with pytest.raises(PlacementError, match="its header declares"):
        undulation_m(8.1, 46.9, tmp_path / "a.gtx")


def test_names_that_are_no_unicode_are_one_line_on_the_terminal(tmp_path: Path) -> None:
    name = os.fsdecode(b"\xff\xfe\x1b[2J\n.png")
    try:
        (tmp_path / name).write_bytes(b"no picture")
    except OSError:
        pytest.skip("this file system takes Unicode names only")
    words = [sys.executable, "-m", "fig2mesh", os.fsencode(tmp_path / name)]
    run = subprocess.run(words, capture_output=True, check=False)
    assert run.returncode == 2, run.stderr
    assert run.stderr.count(b"\n") == 1
    assert b"\x1b" not in run.stderr


@pytest.mark.parametrize(
    "text", ["{" * 9000, '{"a":' * 9000 + "1" + "}" * 9000, "[{" * 9000, "PROJCS[" * 9000, "EPSG:2056+" * 20_000]
)
def test_reference_systems_that_are_nested_or_endless(text: str) -> None:
    with pytest.raises(PlacementError, match="is not a reference system"):
        crs_of(text)


def test_a_drawing_in_an_annotation_is_not_searched_through(tmp_path: Path) -> None:
    case = next(seeds.annotations())
    document = json.loads(case.files[case.main])
    document["target"] = {"selector": {"value": "<svg" * 1_500_000}}
    (tmp_path / "main.json").write_text(json.dumps(document))
    assert read_sheet(tmp_path / "main.json").size is None


def test_a_cell_of_a_points_file_that_never_ends(tmp_path: Path) -> None:
    case = next(seeds.points_files())
    (tmp_path / "main.points").write_bytes(case.files[case.main] + b'1,2,3,"' + b"x" * 200_000)
    with pytest.raises(PlacementError, match="field larger than field limit"):
        read_sheet(tmp_path / "main.points")


def test_links_that_lead_in_a_circle(tmp_path: Path) -> None:
    (tmp_path / "a.glb").symlink_to(tmp_path / "b.glb")
    (tmp_path / "b.glb").symlink_to(tmp_path / "a.glb")
    (tmp_path / "up").symlink_to(tmp_path)
    for reader in ("glb", "picture", "joints", "model", "globe"):
        assert outcome(READERS[reader], tmp_path / "a.glb").partition(":")[0] in ("refused", "OSError")
