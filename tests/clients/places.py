"""Positions of a figure in clients, at places that reveal mistakes: feet, bearing, and the rendered pixels.

python -m tests.clients.places [TABLE.md]

The figure has a small red ball around its origin, the feet, and a small blue one in front of it, towards the nose.
CesiumJS loads it as a GLB (Model), as 3D Tiles and as CZML on the page of `fig2mesh globe`. The loaded objects' own
matrices, multiplied by CesiumJS, give the positions of feet and nose; the requested place comes from CesiumJS as well
(`Cartesian3.fromDegrees`, `Transforms.eastNorthUpToFixedFrame`). Then a picture is taken, and the middle of each
ball's pixels is compared with where CesiumJS projects the point to; this is finer than `pickPosition`, whose depth
has millimetres and whose pixel is whole, and it sees everything up to the screen. `Scene.pick` must name the ball.

USD has no globe of its own. pxr evaluates the stage; its frame is taken as Cesium for Omniverse documents it: a y-up
stage is x east, y up, z south at the georeference's origin. CesiumJS converts that frame and is the oracle again.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Asset, TexturedMesh
from exporters.gis.czml import write_czml
from exporters.gltf.glb import write_glb
from exporters.tiles.tileset import write_tileset
from exporters.usd.stage import write_usd
from fig2mesh.globe.assets import find_assets
from fig2mesh.globe.page import globe_page, page_files
from fig2mesh.view.server import page_server
from georef.placement import GeoPlacement
from tests.browser import Look, browser, cesium_js, pixels, serving

PLACES = {
    "equator and antimeridian": GeoPlacement(180.0, 0.0, 0.0, heading_deg=180.0),
    "nearly the pole": GeoPlacement(13.37, 89.9, 2.0, heading_deg=75.5),
    "Zurich": GeoPlacement(8.5417, 47.3769, 455.34, heading_deg=135.0),
    "Port San Julián": GeoPlacement(-67.7, -49.3, 12.0, heading_deg=301.25),
    "Dead Sea": GeoPlacement(35.48, 31.55, -430.0, heading_deg=0.0),
}
FORMATS = ("GLB", "3D Tiles", "CZML", "USD")
NOSE = (0.0, 1.0, 0.6)
"""ASSET, metres: far enough out that a pixel is at most half a degree."""
BALL_M = 0.04
SIZE = 640

FEET_TOLERANCE_M, BEARING_TOLERANCE_DEG, PICK_TOLERANCE_PX = 1e-3, 0.01, 1.0


@dataclass(frozen=True)
class PlaceErrors:
    """Errors of one client at one place: of the feet (m) and of the bearing (°), and in the picture (px).

    picked_px : the larger error of feet and nose; None without a picture
    names : names of the objects picked at feet and nose
    """

    place: str
    format: str
    feet_m: float
    bearing_deg: float
    picked_px: float | None = None
    names: tuple[str, ...] = ()


BARE = """(() => {
  const { viewer, setGrid } = fig2mesh;
  const { scene } = viewer;
  for (const name of ['globe', 'skyBox', 'skyAtmosphere', 'sun', 'moon']) scene[name].show = false;
  scene.backgroundColor = Cesium.Color.WHITE;
  setGrid(false);
  for (const each of ['#panel', '.cesium-viewer-bottom']) document.querySelector(each).style.display = 'none';
  for (const figure of fig2mesh.figures) figure.show(false);
})()"""

STAND = """(async () => {{
  const {{ Cartesian3, HeadingPitchRange, Matrix4, SceneTransforms, Transforms, Math: Angle }} = Cesium;
  const {{ viewer: {{ scene, camera }}, figures, ecefFromMesh }} = fig2mesh;
  figures.forEach((figure, i) => figure.show(i === {index}));
  await fig2mesh.look(figures[{index}], 0);
  const asked = Cartesian3.fromDegrees({lon}, {lat}, {height});
  const ecefFromEnu = Transforms.eastNorthUpToFixedFrame(asked);
  const enuFromEcef = Matrix4.inverseTransformation(ecefFromEnu, new Matrix4());
  const matrix = ecefFromMesh(figures[{index}].models()[0]);
  const found = (point) => Matrix4.multiplyByPoint(matrix, Cartesian3.fromArray(point), new Cartesian3());
  const feet = found([0, 0, 0]);
  const nose = found({nose});
  const direction = Cartesian3.subtract(nose, feet, new Cartesian3());
  const ahead = Matrix4.multiplyByPointAsVector(enuFromEcef, direction, new Cartesian3());
  // The camera is placed relative to the requested place, not to the figure.
  const bearing = Angle.toRadians({heading});
  const [, up, out] = {nose};
  const noseInEnu = new Cartesian3(out * Math.sin(bearing), out * Math.cos(bearing), up);
  const noseAsked = Matrix4.multiplyByPoint(ecefFromEnu, noseInEnu, new Cartesian3());
  const middle = Cartesian3.midpoint(asked, noseAsked, new Cartesian3());
  const from = new HeadingPitchRange(bearing + Angle.toRadians(130), Angle.toRadians(-30), 2.2);
  camera.lookAtTransform(Transforms.eastNorthUpToFixedFrame(middle), from);
  for (let i = 0; i < 3; i++) await new Promise((done) => {{ scene.requestRender(); requestAnimationFrame(done); }});
  const [feetAt, noseAt] = [asked, noseAsked].map((point) => SceneTransforms.worldToWindowCoordinates(scene, point));
  return {{
    feet_m: Cartesian3.distance(feet, asked), bearing: Angle.toDegrees(Math.atan2(ahead.x, ahead.y)),
    feet: [feetAt.x, feetAt.y], nose: [noseAt.x, noseAt.y], names: [feetAt, noseAt].map((at) => fig2mesh.at(at).part),
  }};
}})()"""

STAGE = """(() => {{
  const {{ Cartesian3, Matrix4, Transforms }} = Cesium;
  const origin = {origin};
  const asked = Cartesian3.fromDegrees({lon}, {lat}, {height});
  const ecefFromEnu = Transforms.eastNorthUpToFixedFrame(Cartesian3.fromDegrees(...origin));
  const enuFromEcef = Matrix4.inverseTransformation(Transforms.eastNorthUpToFixedFrame(asked), new Matrix4());
  const place = ([x, y, z]) => Matrix4.multiplyByPoint(ecefFromEnu, new Cartesian3(x, -z, y), new Cartesian3());
  const [feet, nose] = [{feet}, {nose}].map(place);
  const direction = Cartesian3.subtract(nose, feet, new Cartesian3());
  const ahead = Matrix4.multiplyByPointAsVector(enuFromEcef, direction, new Cartesian3());
  return {{ feet_m: Cartesian3.distance(feet, asked), bearing: Cesium.Math.toDegrees(Math.atan2(ahead.x, ahead.y)) }};
}})()"""


def marked(placement: GeoPlacement) -> Asset:
    """A red ball at the feet, a blue one at the nose."""
    balls = [_ball((0.0, 0.0, 0.0)), _ball(NOSE)]
    count = len(balls[0][0])
    mesh = TexturedMesh(
        vertices=np.concatenate([vertices for vertices, _ in balls]),
        faces=np.concatenate([balls[0][1], balls[1][1] + count]),
        normals=None,
        solid_index=np.arange(2 * count),
        colors=np.repeat([[255, 0, 0], [0, 0, 255]], count, axis=0),
        parts=np.repeat([1, 2], count),
    )
    return Asset("marked", (mesh,), placement, {1: "feet", 2: "nose"})


def _ball(centre: tuple[float, float, float], columns: int = 32, rows: int = 16) -> tuple[NDArray[Any], NDArray[Any]]:
    """Vertices and faces of a closed ball; symmetric, so that its picture's middle is its centre's."""
    down, round_ = np.meshgrid(
        np.pi * np.arange(1, rows) / rows, 2 * np.pi * np.arange(columns) / columns, indexing="ij"
    )
    ring = np.stack([np.sin(down) * np.sin(round_), np.cos(down), np.sin(down) * np.cos(round_)], axis=-1)
    vertices = np.concatenate([ring.reshape(-1, 3), [[0, 1, 0], [0, -1, 0]]])
    index = np.arange((rows - 1) * columns).reshape(rows - 1, columns)
    after = np.roll(index, -1, axis=1)
    top, bottom = index.size, index.size + 1
    quads = [np.stack([index[:-1], index[1:], after[1:]], -1), np.stack([index[:-1], after[1:], after[:-1]], -1)]
    caps = [
        np.stack([index[0], after[0], np.full(columns, top)], -1),
        np.stack([after[-1], index[-1], np.full(columns, bottom)], -1),
    ]
    faces = np.concatenate([part.reshape(-1, 3) for part in (*quads, *caps)])
    return BALL_M * vertices + centre, faces


def measure(folder: Path, look: Look, cesium: Path) -> list[PlaceErrors]:
    """Measure all places in all formats, in one session of the browser.

    folder : where the files go
    """
    from pxr import Usd, UsdGeom

    paths: list[Path] = []
    actions: list[dict[str, Any]] = [{"evaluate": BARE}]
    order: list[tuple[str, str]] = []
    for number, (name, place) in enumerate(PLACES.items()):
        asset = marked(place)
        files = [folder / f"{number}.glb", folder / f"{number}_tiles", folder / f"{number}.czml"]
        write_glb(asset, files[0])
        write_tileset(asset, files[1])
        write_czml(asset, files[2])
        asked = {"lon": place.lon_deg, "lat": place.lat_deg, "height": place.height_m}
        for kind in FORMATS[:3]:
            stand = STAND.format(index=len(paths), nose=list(NOSE), heading=place.heading_deg, **asked)
            actions += [{"evaluate": stand}, {"screenshot": True}]
            order.append((name, kind))
            paths.append(files[FORMATS.index(kind)])
        stage_file = folder / f"{number}.usda"
        write_usd(asset, stage_file)
        stage = Usd.Stage.Open(str(stage_file))
        matrix = UsdGeom.Xformable(stage.GetPrimAtPath("/Figure/Mesh")).ComputeLocalToWorldTransform(
            Usd.TimeCode.Default()
        )
        feet, nose = ([float(x) for x in matrix.Transform(point)] for point in ((0.0, 0.0, 0.0), NOSE))
        georeference = stage.GetPrimAtPath("/CesiumGeoreference")
        origin = [
            georeference.GetAttribute(f"cesium:georeferenceOrigin:{key}").Get()
            for key in ("longitude", "latitude", "height")
        ]
        actions.append({"evaluate": STAGE.format(origin=origin, feet=feet, nose=nose, **asked)})
        order.append((name, "USD"))
    assets = find_assets(tuple(paths))
    with serving(page_server(globe_page(assets), 0, {"cesium": cesium}, page_files(assets))) as address:
        view = look(address, *actions, size=(SIZE, SIZE))
    if view["messages"]:
        raise RuntimeError(f"messages of the page: {view['messages']}")
    elsewhere = [request for request in view["requests"] if not request.startswith(address)]
    if elsewhere:
        raise RuntimeError(f"the page requests {elsewhere}")
    results = iter(view["results"][1:])
    found = []
    for name, kind in order:
        facts = next(results)["value"]
        turn = (facts["bearing"] - PLACES[name].heading_deg + 180) % 360 - 180
        if kind == "USD":
            found.append(PlaceErrors(name, kind, facts["feet_m"], abs(turn)))
            continue
        image = pixels(next(results)["png"])[..., :3].astype(float)
        misses = [np.hypot(*(_middle(image, channel) - facts[key])) for channel, key in ((0, "feet"), (2, "nose"))]
        found.append(PlaceErrors(name, kind, facts["feet_m"], abs(turn), float(max(misses)), tuple(facts["names"])))
    return found


def _middle(image: NDArray[np.float64], channel: int) -> NDArray[np.float64]:
    """Centroid (x, y) of a ball's pixels, weighted by their difference from white towards its colour."""
    share = (255 - image[..., 1]) / 255 * (image[..., channel] > 250) * (image[..., 2 - channel] < 250)
    rows, columns = np.indices(share.shape) + 0.5
    return np.array([(columns * share).sum(), (rows * share).sum()]) / share.sum()


def table(found: list[PlaceErrors]) -> str:
    """Format the table as Markdown."""
    lines = [
        "# Feet and bearing in clients",
        "",
        "Written by `python -m tests.clients.places docs/places.md`; it says how. Tests hold these tolerances: "
        f"feet {1000 * FEET_TOLERANCE_M:g} mm, bearing {BEARING_TOLERANCE_DEG:g}°, picture {PICK_TOLERANCE_PX:g} px.",
        "",
        "| place | lon, lat, height | bearing | format | feet off, mm | bearing off, ° | picture off, px |",
        "|---|---|---|---|---|---|---|",
    ]
    for each in found:
        place = PLACES[each.place]
        where = f"{place.lon_deg:g}, {place.lat_deg:g}, {place.height_m:g} m"
        picked = "–" if each.picked_px is None else f"{each.picked_px:.2f}"
        numbers = f"{1000 * each.feet_m:.1g} | {each.bearing_deg:.1g} | {picked}"
        lines.append(f"| {each.place} | {where} | {place.heading_deg:g}° | {each.format} | {numbers} |")
    lines += [
        "",
        "GLB is loaded as a Model, CZML as an Entity, 3D Tiles as a tileset, on the page of `fig2mesh globe`. "
        "USD is evaluated by pxr and placed as Cesium for Omniverse documents it, so there is no picture of it.",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        text = table(measure(Path(folder), browser(), cesium_js()))
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(text, encoding="utf-8")
    else:
        print(text, end="")


if __name__ == "__main__":
    main()
