"""From a figure drawn on a georeferenced sheet to a tileset that stands where the sheet shows it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest
from PIL import Image

from exporters.georeference import placement_of_tile
from exporters.inspect import inspect
from fig2mesh.asset_frame import asset_from_figure, foot_on_picture, height_on_picture, on_drawing
from fig2mesh.commands.main import main
from fig2mesh.conversion.place import clamp_note, open_map, place
from fig2mesh.conversion.request import PlaceRequest
from fig2mesh.image_frame import image_frame
from fig2mesh.parse.read import read_figure
from fig2mesh.parts.pieces import clean
from fig2mesh.records import Figure
from georef.errors import InputError
from georef.geodesy import ecef_from_geodetic
from tests.drawn import draw_figure, keypoints
from tests.georef.sheets.sheets import annotation, points_file

SCALE = 2
SHEET = (900, 1000)
CORNER = (310, 240)
"""Upper left corner of the figure's picture on the sheet."""

METRES_PX, TURN_DEG = 4.0, 20.0
MIDDLE = (2_683_000.0, 1_247_000.0)
"""The sheet: Zurich in the Swiss grid, its "up" 20 degrees east of grid north."""

FOOT_PX = np.array([100 * SCALE + CORNER[0], 286 * SCALE + CORNER[1]], np.float64)
"""Between the ankles and feet of `tests.drawn`; the row is measured below."""


def swiss(pixels: Any) -> np.ndarray:
    turn = np.radians(TURN_DEG)
    right, down = (np.cos(turn), -np.sin(turn)), (-np.sin(turn), -np.cos(turn))
    return np.array(MIDDLE) + METRES_PX * (np.atleast_2d(pixels) - np.array(SHEET) / 2) @ np.array([right, down])


def lonlat(pixels: Any) -> np.ndarray:
    transformer = pyproj.Transformer.from_crs("EPSG:2056", "EPSG:4326", always_xy=True, allow_ballpark=False)
    return np.stack(transformer.transform(*swiss(pixels).T), axis=1)


@dataclass(frozen=True)
class Sheet:
    """picture, mask : of the whole sheet; joints : of the figure on it; figure : alone, with its own joints."""

    folder: Path
    picture: Path
    mask: Path
    joints: Path
    figure: Path
    own_joints: Path

    @property
    def drawn(self) -> list[str]:
        return [str(self.picture), "--mask", str(self.mask), "--keypoints", str(self.joints)]

    @property
    def alone(self) -> list[str]:
        return [str(self.figure), "--keypoints", str(self.own_joints)]


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> Sheet:
    """A paper-coloured sheet with a road and the drawn figure on it, and a .points file next to it."""
    folder = tmp_path_factory.mktemp("sheet")
    figure = draw_figure(SCALE)
    paper = Image.new("RGB", SHEET, (236, 226, 200))
    paper.paste((150, 120, 90), (0, 800, 900, 812))
    paper.paste(figure, CORNER, figure)
    mask = Image.new("L", SHEET)
    mask.paste(figure.getchannel("A"), CORNER)
    paper.save(folder / "map.png")
    mask.save(folder / "map_mask.png")
    figure.save(folder / "cut.png")
    own = keypoints(SCALE)
    (folder / "cut.json").write_text(json.dumps(own))
    moved = {
        name: [x + CORNER[0], y + CORNER[1], visible]
        for name, (x, y, visible) in dict(own["keypoints"]).items()  # type: ignore[call-overload]
    }
    joints = {"width": SHEET[0], "height": SHEET[1], "keypoints": moved}
    (folder / "figure.json").write_text(json.dumps(joints))
    pixels = np.array([[40.0, 30], [860, 60], [50, 950], [870, 970], [450, 480], [300, 700], [640, 250]])
    points_file(folder / "map.points", pixels, swiss(pixels), "EPSG:2056")
    names = ("map.png", "map_mask.png", "figure.json", "cut.png", "cut.json")
    return Sheet(folder, *(folder / name for name in names))


@pytest.fixture(scope="module")
def read(sheet: Sheet) -> Figure:
    figure = read_figure(sheet.picture, mask=sheet.mask, keypoints=sheet.joints)
    return clean(figure, 0.02, 2048)[0]


FAST = ["--quality", "draft", "--parts", "outline", "--textures", "none", "--mesher", "isosurface", "-q"]


def run(arguments: Sequence[object]) -> int:
    return main([str(argument) for argument in arguments])


def test_the_whole_road(sheet: Sheet, read: Figure, tmp_path: Path) -> None:
    tiles, model, report = tmp_path / "tiles" / "tileset.json", tmp_path / "f.glb", tmp_path / "r.json"
    options = ["--map", sheet.picture, "--size-from", "map", "--altitude", 408, "--altitude-datum", "egm96"]
    assert run([*sheet.drawn, *options, *FAST, "-o", tiles, "-o", model, "--report", report]) == 0
    placed = placement_of_tile(json.loads(tiles.read_text())["root"]["transform"])
    foot = foot_on_picture(read)
    there = lonlat(foot)[0]
    offset = ecef_from_geodetic((*there, 0.0)) - ecef_from_geodetic((placed["lon_deg"], placed["lat_deg"], 0.0))
    # The points are exact, the fit an affine one in the same grid: what is left is rounding.
    assert np.linalg.norm(offset) < 1e-3
    assert placed["height_m"] == pytest.approx(408 + 47.34, abs=0.01)
    # Towards the reader: down on the sheet, grid south turned by 20 degrees, with the grid's convergence.
    down = pyproj.Geod(ellps="WGS84").inv(*there, *lonlat(np.array(foot) + (0, 1))[0])[0] % 360
    assert placed["heading_deg"] == pytest.approx(down, abs=1e-3)
    assert placed["heading_deg"] == pytest.approx(200.0, abs=1.5)
    # As large as drawn: its height in pixels, at 4 m each but for the grid's scale.
    drawn_px = float(np.ptp(np.flatnonzero(np.asarray(Image.open(sheet.mask)).max(axis=1) > 127)) + 1)
    facts = json.loads(report.read_text())
    assert facts["placement"]["figure_height_m"] == pytest.approx(drawn_px * METRES_PX, rel=1e-3)
    # A hundredth of the height: the coarse mesh may stop short of the drawn tip.
    assert inspect(model)["size_m"][1] == pytest.approx(drawn_px * METRES_PX, rel=0.01)
    map_facts = facts["map"]
    assert (map_facts["sheet"], map_facts["georeference"], map_facts["method"]) == ("map.png", "map.points", "affine")
    assert (map_facts["control_points"], map_facts["degrees_of_freedom"], map_facts["inside_hull"]) == (7, 8, True)
    assert map_facts["rmse_m"] < 1e-3
    assert len(map_facts["residuals_m"]) == 7
    assert map_facts["pixel"] == pytest.approx(foot)
    assert map_facts["up_bearing_deg"] == pytest.approx(down - 180, abs=1e-3)
    stages = {stage["stage"]: stage["seconds"] for stage in facts["stages"]}
    assert "place" in stages
    kept = inspect(model)["metadata"]["map"]
    assert set(kept) == {"sheet", "pixel", "method", "rmse_m"}


def test_the_feet_are_where_the_asset_has_its_origin(sheet: Sheet, read: Figure) -> None:
    """The placement before meshing and that of the finished mesh agree to a fraction of a pixel."""
    from fig2mesh.field.body import Body
    from fig2mesh.mesh.isosurface import isosurface
    from fig2mesh.parts.canvas import make_canvas
    from fig2mesh.parts.outline import outline_parts
    from fig2mesh.pose.prior import lift

    frame = image_frame(read)
    pose = lift(read, frame)
    outline = outline_parts(make_canvas(read, frame, 256, 0.02), pose, read.visible, voxel=0.02)
    mesh = isosurface(Body(outline.parts, fillets=outline.fillets), spacing=0.02)
    _, (x, y) = on_drawing(frame, asset_from_figure(pose, mesh.vertices, 1.79))
    foot = np.array(foot_on_picture(read)) - read.origin_px
    assert foot[0] == pytest.approx(x, abs=0.01)
    assert foot[1] == pytest.approx(y, abs=1.5), "the mesh of coarse cells ends within a cell, 6 px"
    assert height_on_picture(read) == pytest.approx(np.flatnonzero(read.mask.any(axis=1)).size)


def test_bbox_reduction_and_cutting_do_not_move_the_feet(sheet: Sheet, read: Figure) -> None:
    box = (250, 200, 760, 900)
    cut = read_figure(sheet.picture, mask=sheet.mask, keypoints=sheet.joints, bbox=box)
    assert foot_on_picture(cut) == pytest.approx(foot_on_picture(read), abs=1e-4)
    small = clean(cut, 0.02, 200)[0]
    assert small.step_px >= 2
    assert foot_on_picture(small) == pytest.approx(foot_on_picture(read), abs=small.step_px)
    assert height_on_picture(small) == pytest.approx(height_on_picture(read), abs=2 * small.step_px)


def place_request(sheet: Path | None, **more: Any) -> PlaceRequest:
    return PlaceRequest(
        **{
            "lonlat": None,
            "facing": "viewer",
            "height_m": None,
            "altitude": 0.0,
            "altitude_datum": "ellipsoid",
            "map": sheet,
            **more,
        }
    )


def test_the_pixel_may_be_given(sheet: Sheet, read: Figure) -> None:
    request = place_request(sheet.folder / "map.points", at=(123.0, 456.0))
    placed = place(request, open_map(request), read, sheet.figure)
    assert placed.placement is not None
    assert (placed.placement.lon_deg, placed.placement.lat_deg) == pytest.approx(tuple(lonlat((123, 456))[0]), abs=1e-9)
    assert placed.placement.heading_deg == pytest.approx(201, abs=1.5)
    assert placed.height_m == 1.79
    assert placed.metadata["map"]["pixel"] == [123.0, 456.0]


def test_other_facings_stay_bearings_of_the_compass(sheet: Sheet, read: Figure) -> None:
    request = place_request(sheet.picture, facing="NE")
    placed = place(request, open_map(request), read, sheet.picture).placement
    assert placed is not None
    assert placed.heading_deg == 45.0


def test_a_cut_out_figure_at_the_scale_of_the_sheet(sheet: Sheet) -> None:
    figure = read_figure(sheet.figure, keypoints=sheet.own_joints)
    request = place_request(sheet.picture, at=tuple(FOOT_PX), size_from="map")
    placed = place(request, open_map(request), figure, sheet.figure)
    assert "a pixel of cut.png is assumed to be as large as a pixel of the sheet" in placed.notes[-1]
    assert placed.height_m == pytest.approx(height_on_picture(figure) * METRES_PX, rel=1e-3)


def test_outside_the_hull_is_reported(sheet: Sheet, read: Figure, caplog: pytest.LogCaptureFixture) -> None:
    request = place_request(sheet.picture, at=(890.0, 10.0))
    notes = place(request, open_map(request), read, sheet.picture).notes
    assert "outside the control points' hull" in notes[0]


def test_an_annotation_made_for_a_larger_scan(sheet: Sheet, read: Figure, tmp_path: Path) -> None:
    pixels = np.array([[40.0, 30], [860, 60], [50, 950], [870, 970], [450, 480]])
    made = annotation(3 * pixels, lonlat(pixels), (2700, 3000))
    picture = tmp_path / "map.png"
    picture.write_bytes(sheet.picture.read_bytes())
    (tmp_path / "map.json").write_text(json.dumps(made))
    request = place_request(picture)
    placed = place(request, open_map(request), read, picture).placement
    assert placed is not None
    assert (placed.lon_deg, placed.lat_deg) == pytest.approx(tuple(lonlat(foot_on_picture(read))[0]), abs=1e-7)


# fmt: off
BAD = {
    "twice": (["--map", "map.png", "--lonlat", "8", "47"], "--map: cannot be combined with --lonlat"),
    "at alone": (["--at", "1", "2"], "--at: requires --map"),
    "crs alone": (["--map-crs", "EPSG:2056"], "--map-crs: requires --map"),
    "transform alone": (["--map-transform", "tps"], "--map-transform: requires --map"),
    "size alone": (["--size-from", "map", "--lonlat", "8", "47"], "--size-from map: requires --map"),
    "size twice": (["--map", "map.png", "--size-from", "map", "--height-m", "2"], "cannot be combined with --height-m"),
    "off the sheet": (["--map", "map.png", "--at", "1", "2000"], "is not on the sheet of 900×1000 px"),
    "no sheet": (["--map", "none.png"], "no such file"),
    "too few": (["--map", "map.png", "--map-transform", "poly3"], "7 control points, but poly3 needs 10"),
    "transform": (["--map", "map.png", "--map-transform", "magic"], "'magic' is not one of"),
    "altitude": (["--map", "map.png", "--altitude", "nan"], "--altitude"),
    "facing": (["--map", "map.png", "--facing", "up"], "is not a direction"),
    "clamp without place": (["--altitude-mode", "clamp"], "--altitude-mode: requires a place"),
    "clamp to a datum": (
        ["--map", "map.png", "--altitude-mode", "clamp", "--altitude-datum", "egm96"],
        "--altitude-mode clamp: cannot be combined with --altitude-datum egm96",
    ),
}
# fmt: on


@pytest.mark.parametrize("name", BAD)
def test_bad_requests_are_one_line(
    sheet: Sheet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    options, finding = BAD[name]
    monkeypatch.chdir(sheet.folder)
    target = tmp_path / "a.glb"
    assert run([*sheet.drawn, *options, *FAST, "-o", target]) == 2
    message = capsys.readouterr().err
    assert finding in message
    assert message.count("\n") == 1
    assert not target.exists()


def test_a_figure_that_is_not_the_sheet_needs_a_pixel(
    sheet: Sheet, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run([*sheet.alone, "--map", sheet.picture, *FAST, "-o", tmp_path / "a.glb"]) == 2
    assert "cut.png is not the picture of map.points; give --at X Y" in capsys.readouterr().err


def test_plan_takes_the_options_and_reads_nothing(sheet: Sheet, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plan", "nowhere.png", "--map", "nowhere.tif", "--at", 1, 2, "--size-from", "map"]) == 0
    assert "lift" in capsys.readouterr().out


def test_formats_that_cannot_clamp_are_reported() -> None:
    request = place_request(None, lonlat=(8.0, 47.0), altitude_mode="clamp")
    assert clamp_note(request, ("a.czml",)) is None
    assert clamp_note(place_request(None, lonlat=(8.0, 47.0)), ("a.glb",)) is None
    note = clamp_note(request, ("a.czml", "a.glb", "tiles/tileset.json"))
    assert note is not None
    assert note.endswith("in a.glb, tiles/tileset.json")


def test_options_of_a_place_alone_are_checked_before_the_figure(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be combined with --lonlat"):
        open_map(place_request(tmp_path / "map.png", lonlat=(8.0, 47.0)))
