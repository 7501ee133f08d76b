"""Makes docs/globe.jpg and docs/blender_map.jpg: three figures on the map that they are drawn on, in two clients.

python docs/make_map_pictures.py [FOLDER]    from the top of the repository; needs node, npm, Chromium and Python 3.11

FOLDER keeps the converted figures; those that are there are not made again.
"""

from __future__ import annotations

import base64
import csv
import io
import sys
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from examples import draw_map  # noqa: E402
from examples.place_three_from_map import MAP, run  # noqa: E402
from fig2mesh.globe.assets import find_assets  # noqa: E402
from fig2mesh.globe.page import Overlay, globe_page, page_files  # noqa: E402
from fig2mesh.view.server import page_server  # noqa: E402
from tests.blender import blender  # noqa: E402
from tests.browser import browser, cesium_js, serving  # noqa: E402

SIZE = (1280, 720)
EDGES = (draw_map.WEST, draw_map.SOUTH, draw_map.EAST, draw_map.NORTH)

VIEW = """(async () => {
  const { viewer: { scene, camera } } = fig2mesh;
  fig2mesh.setGrid(false);
  const middle = Cesium.Cartesian3.fromDegrees(%f, %f, 1800);
  camera.lookAt(middle, new Cesium.HeadingPitchRange(0, Cesium.Math.toRadians(-31), 47000));
  camera.lookAtTransform(Cesium.Matrix4.IDENTITY);
  for (let i = 0; i < 300 && !(i > 20 && scene.globe.tilesLoaded); i++) {
    await new Promise((done) => { scene.requestRender(); requestAnimationFrame(done); });
  }
})()"""


def globe(tiles: Path, picture: Path) -> None:
    """The tileset of the three and the map on the page of `fig2mesh globe`."""
    assets, overlays = find_assets((tiles,)), (Overlay(MAP / "map.jpg", *EDGES),)
    server = page_server(globe_page(assets, overlays), 0, {"cesium": cesium_js()}, page_files(assets, overlays))
    west, south, east, north = EDGES
    # West and south of the middle: the panel covers the left, and nearer things look larger.
    view = VIEW % (0.58 * west + 0.42 * east, 0.55 * south + 0.45 * north)
    with serving(server) as address:
        seen = browser()(address, {"evaluate": view}, {"screenshot": True}, size=SIZE)
    if seen["messages"]:
        raise RuntimeError(str(seen["messages"]))
    png = base64.b64decode(seen["results"][1]["png"])
    Image.open(io.BytesIO(png)).convert("RGB").save(picture, quality=82, optimize=True)


def map_in_blender(models: list[Path], folder: Path, picture: Path, samples: int = 16) -> None:
    """Three USD files and the map in Blender."""
    west, south, east, north = EDGES
    east_km, north_km = (metres / 1000 for metres in draw_map.METRES_PER_DEGREE)
    figures: list[dict[str, Any]] = []
    with (MAP / "figures.csv").open(encoding="utf-8", newline="") as stream:
        for row, model in zip(csv.DictReader(stream), models, strict=True):
            lon, lat = draw_map.place(float(row["x"]), float(row["y"]))
            at = [(lon - (west + east) / 2) * east_km, (lat - (south + north) / 2) * north_km]
            figures.append({"file": str(model.resolve()), "at_km": at})
    size = [(east - west) * east_km, (north - south) * north_km]
    rendered = folder.resolve() / "blender_map.png"
    blender(
        ROOT / "docs" / "blender_map_scene.py",
        {
            "map": {"image": str(MAP / "map.jpg"), "size_km": size},
            "figures": figures,
            "picture": str(rendered),
            "size": SIZE,
            "samples": samples,
        },
        seconds=3600,
    )
    Image.open(rendered).convert("RGB").save(picture, quality=82, optimize=True)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "build/map")
    names = [name for name, _, _ in draw_map.PEOPLE]
    models = [folder / name / f"{name}{suffix}" for name in names for suffix in (".glb", ".usdc")]
    tiles = folder / "tileset.json"
    if not all(file.is_file() for file in (*models, tiles)):
        run(folder)
    globe(tiles, ROOT / "docs" / "globe.jpg")
    map_in_blender(models[1::2], folder, ROOT / "docs" / "blender_map.jpg")


if __name__ == "__main__":
    main()
