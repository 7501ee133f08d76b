"""Every output in every client: place, bearing, size, colours; writes what docs/make_clients_table.py reads."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pxr import Usd, UsdGeom

from tests import python_clients
from tests.blender import looked_at
from tests.browser import pixels
from tests.clients import browser_matrix
from tests.clients.measure import (
    FOV_DEG,
    SIZE,
    Record,
    camera_of,
    colours_off,
    errors_of,
    keep,
    matrix_of,
    overlap_of,
    shown,
    stage_from_asset,
    transform_of,
)
from tests.clients.outputs import OUTPUTS, PLACE, Made, made

PLACE_M, BEARING_DEG, HEIGHT_PERCENT = 0.01, 0.05, 1.0
"""Outputs without an outline are some millimetres wider, since they have the line as a part of the body."""
PICTURE_PX, OVERLAP, COLOURS, SMALL_COLOURS = 4.0, 0.85, 12.0, 32.0
"""Figures of a group cover so few pixels that edges mix with the background."""
FLAT_COLOURS = 24.0
"""Of vertex colours, which smear, of Blender's and VTK's filters, and of CesiumJS's tone mapping of lit models."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Made:
    base = tmp_path_factory.getbasetemp()
    return made(base.parent if base.name.startswith("popen-") else base)


def check(record: Record, colours: float = COLOURS) -> None:
    """Fail where a record is beyond a tolerance; None is not compared."""
    assert record.result == "opened", record
    limits = {
        "place_m": PLACE_M,
        "bearing_deg": BEARING_DEG,
        "height_percent": HEIGHT_PERCENT,
        "picture_px": PICTURE_PX,
    }
    for name, limit in (limits | {"colours": colours}).items():
        value = getattr(record, name)
        assert value is None or value <= limit, f"{name}: {record}"
    assert record.overlap is None or record.overlap > OVERLAP, record


@pytest.fixture(scope="module")
def browsed(files: Made, cesium: Path) -> tuple[list[Record], dict[str, bytes]]:
    records, pictures = browser_matrix.measure(files, cesium)
    keep("browser", records, pictures)
    return records, pictures


def _limit_of_colours(record: Record) -> float:
    if record.output.startswith("six"):
        return SMALL_COLOURS
    return FLAT_COLOURS if (record.client, record.output) == ("CesiumJS", "glb blender") else COLOURS


@pytest.mark.slow
def test_pages(browsed: tuple[list[Record], dict[str, bytes]]) -> None:
    records, pictures = browsed
    assert len(records) == sum(len(client.outputs) for client in browser_matrix.CLIENTS)
    for record in records:
        check(record, _limit_of_colours(record))
        assert record.figures == (6 if record.output.startswith("six") else 1), record
        picture = next(
            png
            for title, png in pictures.items()
            if title.startswith(f"{record.client} {record.version} {record.output} ")
        )
        if record.overlap is not None and not record.output.startswith("six"):
            assert overlap_of(pixels(base64.b64encode(picture).decode()), mirrored=True) < record.overlap - 0.1, record


@pytest.mark.slow
def test_deck_shows_models_where_it_shows_tiles(browsed: tuple[list[Record], dict[str, bytes]]) -> None:
    """It does not give the place of a model in a layer, so that pictures are compared, not cropped."""
    masks = {
        record.output: shown(
            pixels(base64.b64encode(browsed[1][f"deck.gl {record.version} {record.output} 1"]).decode())
        )
        for record in browsed[0]
        if record.client == "deck.gl" and not record.output.startswith("six")
    }
    tiles = masks["tiles"]
    assert tiles.any()
    overlaps = {output: (mask & tiles).sum() / (mask | tiles).sum() for output, mask in masks.items()}
    assert min(overlaps.values()) > OVERLAP, overlaps


@pytest.mark.slow
def test_no_texture_is_read_for_each_vertex(browsed: tuple[list[Record], dict[str, bytes]]) -> None:
    """deck.gl reads property textures back, which a file has on request only; CesiumJS two texels when it starts."""
    assert {"glb", "tiles", "six"} <= {record.output for record in browsed[0] if record.client == "deck.gl"}
    assert [record for record in browsed[0] if (record.texels or 0) > 2] == []


@pytest.mark.slow
def test_reading_a_texture_for_each_vertex_is_counted(files: Made, cesium: Path) -> None:
    (record,) = browser_matrix.measure(files, cesium, ("deck",), ("glb pixels",))[0]
    assert record.result == "refused", record
    assert "texels read back" in record.note


@pytest.mark.slow
def test_cesiumjs_shows_the_levels_that_their_errors_select(files: Made, cesium: Path) -> None:
    """In a view of 1,080 rows: the finest where the figure fills them, coarser ones farther away."""
    document = json.loads(files.path("tiles lods").read_text(encoding="utf-8"))
    tiles = [document["root"]]
    while tiles[-1].get("children"):
        tiles.append(tiles[-1]["children"][0])
    pixels_at_1_m = 1080 / (2 * np.tan(np.radians(FOV_DEG / 2)))
    fills = np.ptp(files.vertices[:, 1]) / (2 * np.tan(np.radians(FOV_DEG / 2)))
    distances = [fills * factor for factor in (1.0, 5.0, 15.0, 24.0, 40.0)]
    expected = [
        next(tile for tile in tiles if tile["geometricError"] * pixels_at_1_m / distance <= 16)["content"]["uri"]
        for distance in distances
    ]
    assert expected[0] == tiles[-1]["content"]["uri"]
    assert len(set(expected)) == 3
    assert browser_matrix.levels_selected(files, cesium, distances, FOV_DEG, 1080) == expected


@pytest.mark.slow
def test_blender(files: Made, tmp_path: Path) -> None:
    records, pictures = [], {}
    for key in ("glb", "gltf", "glb blender"):
        picture = tmp_path / "front.png"
        found = looked_at(files.path(key), picture, SIZE)
        (x0, y0, z0), (x1, y1, z1) = found["low"], found["high"]
        box = {"matrix": np.eye(4).ravel(), "low": [x0, z0, -y1], "high": [x1, z1, -y0]}  # z up, front -y
        with Image.open(picture) as image:
            opaque = Image.new("RGBA", image.size, "white")
            opaque.alpha_composite(image.convert("RGBA"))
        records.append(_record("Blender", found["version"], key, box, np.asarray(opaque), np.eye(4), files))
        opaque.save(tmp_path / "opaque.png")
        pictures[f"Blender {key} 1"] = (tmp_path / "opaque.png").read_bytes()
    keep("blender", records, pictures)
    for record in records:
        check(record, FLAT_COLOURS)


@pytest.mark.slow
def test_vtk(files: Made, tmp_path: Path) -> None:
    low, high = files.vertices.min(axis=0), files.vertices.max(axis=0)
    keys = ("glb", "gltf", "glb blender", "obj", "ply", "glb cesiumjs")
    job = {"camera": camera_of(np.eye(4), low, high), "size": SIZE, "pictures": str(tmp_path)}
    found = python_clients.read("vtk_import.py", job | {"files": [str(files.path(key)) for key in keys]})
    records, pictures = [], {}
    version = python_clients.PACKAGES["vtk"]
    for key, each in zip(keys, found, strict=True):
        if not each["meshes"]:
            records.append(Record("VTK", version, key, "refused", note=each["messages"][1].partition(": ")[2]))
            continue
        with Image.open(each["picture"]) as image:
            picture = np.asarray(image.convert("RGBA"))
        pictures[f"VTK {key} 1"] = Path(each["picture"]).read_bytes()
        records.append(_record("VTK", version, key, each["meshes"][0], picture, np.eye(4), files))
    keep("vtk", records, pictures)
    for record in records[:-1]:
        check(record, FLAT_COLOURS)
    assert records[-1].result == "refused"
    assert "EXT_meshopt_compression is required" in records[-1].note


@pytest.mark.slow
def test_usd_core(files: Made) -> None:
    records = []
    for key in ("usda", "usdc", "usdz"):
        stage = Usd.Stage.Open(str(files.path(key)))
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Figure/Mesh"))
        points = np.array(mesh.GetPointsAttr().Get(), float)
        world = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(mesh.GetPrim())).ravel()
        box = {"matrix": world, "low": points.min(axis=0), "high": points.max(axis=0)}
        version = ".".join(map(str, Usd.GetVersion()[1:]))
        records.append(_record("usd-core", version, key, box, None, stage_from_asset(PLACE), files))
    keep("usd", records)
    for record in records:
        check(record)


@pytest.mark.slow
def test_tables(files: Made) -> None:
    job = {"gpkg": "gpkg", "geojson": "index", "stac": "stac", "figure": "geojson"}
    found = python_clients.read("index_tables.py", {name: str(files.path(key)) for name, key in job.items()})
    records = []
    for name, each in found.items():
        output = name.split()[0]
        height = PLACE.height_m if output == "geojson" else 0.0
        points = each.get("points")
        away = [np.hypot((x - PLACE.lon_deg) * 75e3, (y - PLACE.lat_deg) * 111e3) for x, y, *_ in points or []]
        away += [abs((z or 0.0) - height) for *_, z in points or []]
        client, _, version = each["version"].partition(" ")
        note = each.get("error") or "; ".join(each["warnings"])
        result = "refused" if "error" in each else "opened"
        place = float(max(away)) if away else None
        reader = {"stac arrow": " (arrow)", "stac geodataframe": " (GeoDataFrame)"}.get(name, "")
        records.append(
            Record(
                client + reader, version, output, result, place, figures=len(each.get("names", ())) or None, note=note
            )
        )
    keep("tables", records)
    for name, record in zip(found, records, strict=True):
        check(record)
        assert found[name]["names"] == (["farmer"] if record.output == "geojson" else ["Bäuerin"]), record
    assert found["stac pystac"]["missing"] == []
    assert len(found["gpkg"]["layers"]) == 1, "no table of failures where nothing fails"
    assert found["gpkg"]["warnings"] == []


def _record(
    client: str,
    version: str,
    key: str,
    box: dict[str, object],
    picture: np.ndarray | None,
    asked: np.ndarray,
    files: Made,
) -> Record:
    low, high = files.vertices.min(axis=0), files.vertices.max(axis=0)
    place, bearing, height = errors_of(transform_of(box, low, high), asked)
    overlap, colours = (None, None) if picture is None else (overlap_of(picture), colours_off(picture))
    return Record(client, version, key, "opened", place, bearing, height, None, overlap, colours, figures=1)


def test_matrices_of_frames() -> None:
    """An asset that faces east moves its front to +x of a stage, and up in the earth's frame."""
    assert OUTPUTS["usda"].frame == "stage"
    front = stage_from_asset(PLACE) @ [0, 0, 1, 0]
    np.testing.assert_allclose(front, [np.sin(np.radians(135)), 0, np.sin(np.radians(45)), 0], atol=1e-12)
    assert errors_of(matrix_of("earth", PLACE), matrix_of("earth", PLACE)) == (0.0, 0.0, 0.0)
