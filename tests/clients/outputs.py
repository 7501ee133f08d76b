"""Every output of one drawn figure, made once for all clients, and what is known of them.

A conversion in draft quality takes half a minute on a slow machine, so that processes of xdist share the files.
"""

from __future__ import annotations

import math
import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from filelock import FileLock
from numpy.typing import NDArray

import fig2mesh
from exporters.asset import Asset
from exporters.profiles import profile_named
from exporters.write import write
from fig2mesh.commands.main import main
from georef.placement import GeoPlacement
from tests.node import ROOT

FIGURE = ROOT / "examples" / "figures" / "farmer"
PLACE = GeoPlacement(8.5417, 47.3769, 455.34, heading_deg=135.0)
_METRE = 360 / 4.0075e7
COLLECTION = {
    "south": replace(PLACE, heading_deg=180.0),
    "east": replace(
        PLACE, lon_deg=PLACE.lon_deg + 3 * _METRE / math.cos(math.radians(PLACE.lat_deg)), heading_deg=90.0
    ),
    "north": replace(PLACE, lat_deg=PLACE.lat_deg + 5 * _METRE, heading_deg=0.0),
    "west": replace(
        PLACE, lon_deg=PLACE.lon_deg - 4 * _METRE / math.cos(math.radians(PLACE.lat_deg)), heading_deg=270.0
    ),
    "patagonia": GeoPlacement(-67.7, -49.3, 12.0, heading_deg=301.25),
    "antimeridian": GeoPlacement(179.9999, 0.0, 0.0, heading_deg=180.0),
}
"""Four figures 3 to 5 m apart, facing all four ways; one in the south-west, one beside the antimeridian."""


@dataclass(frozen=True)
class Output:
    """Files of one kind.

    title : as the table names it
    path : of the file to open, relative to the folder of all outputs
    frame : of the vertices that a client holds: "asset" (metres, y up, front +z), "stage" (metres, x east, z south) or
        "earth" (ECEF)
    """

    title: str
    path: str
    frame: str = "asset"


# fmt: off
OUTPUTS = {
    "glb": Output(".glb", "farmer.glb"),
    "gltf": Output(".gltf", "farmer.gltf"),
    "glb cesiumjs": Output(".glb --profile cesiumjs", "cesiumjs/farmer.glb"),
    "glb blender": Output(".glb --profile blender", "blender/farmer.glb"),
    "glb pixels": Output(".glb --evidence pixels", "pixels/farmer.glb"),
    "obj": Output(".obj", "farmer.obj"),
    "ply": Output(".ply", "farmer.ply"),
    "usda": Output(".usda", "farmer.usda", "stage"),
    "usdc": Output(".usdc", "farmer.usdc", "stage"),
    "usdz": Output(".usdz", "farmer.usdz", "stage"),
    "czml": Output(".czml", "farmer.czml", "earth"),
    "geojson": Output(".geojson", "farmer.geojson", "earth"),
    "tiles": Output("tileset 1.1", "tiles/tileset.json", "earth"),
    "tiles 1.0": Output("tileset 1.0", "tiles_10/tileset.json", "earth"),
    "tiles cesiumjs": Output("tileset --profile cesiumjs", "tiles_cesiumjs/tileset.json", "earth"),
    "tiles lods": Output("tileset --lods 3", "tiles_lods/tileset.json", "earth"),
    "six": Output("tileset of six, 1.1", "six/tileset.json", "earth"),
    "six 1.0": Output("tileset of six, 1.0", "six_10/tileset.json", "earth"),
    "stac": Output("STAC catalogue", "city/collection.json"),
    "gpkg": Output("index.gpkg", "city/index.gpkg"),
    "index": Output("index.geojson", "city/index.geojson"),
}
# fmt: on


@dataclass(frozen=True)
class Made:
    """The outputs in a folder, and the mesh that all of them hold.

    vertices : (N, 3) float64, ASSET, metres
    """

    folder: Path
    vertices: NDArray[np.float64]

    def path(self, key: str) -> Path:
        return self.folder / OUTPUTS[key].path


def made(shared: Path) -> Made:
    """The outputs below a folder that all test processes share."""
    folder = shared / "client_outputs"
    with FileLock(shared / "client_outputs.lock"):
        if not (folder / "vertices.npy").is_file():
            folder.mkdir(exist_ok=True)
            np.save(folder / "vertices.npy", _write(folder))
    return Made(folder, np.load(folder / "vertices.npy"))


def _write(folder: Path) -> NDArray[np.float64]:
    request = fig2mesh.Request(
        str(FIGURE / "image.png"),
        keypoints=str(FIGURE / "keypoints.json"),
        lonlat=(PLACE.lon_deg, PLACE.lat_deg),
        quality="draft",
        lods=3,
    )
    levels = replace(fig2mesh.convert(request).asset, name="farmer", placement=PLACE)
    asset = replace(levels, lods=levels.lods[:1])
    for suffix in ("glb", "gltf", "obj", "ply", "usda", "usdc", "usdz", "czml", "geojson"):
        write(asset, folder / f"farmer.{suffix}", overwrite=True)
    for profile in ("cesiumjs", "blender"):
        (folder / profile).mkdir(exist_ok=True)
        write(asset, folder / profile / "farmer.glb", overwrite=True, profile=profile_named(profile))
    (folder / "pixels").mkdir(exist_ok=True)
    write(replace(asset, observed_pixels=True), folder / "pixels" / "farmer.glb", overwrite=True)
    write(asset, folder / "tiles", overwrite=True)
    write(asset, folder / "tiles_10", overwrite=True, tiles_version="1.0")
    write(asset, folder / "tiles_cesiumjs", overwrite=True, profile=profile_named("cesiumjs"))
    write(levels, folder / "tiles_lods", overwrite=True)
    _write_six(asset, folder)
    _write_city(folder)
    return np.asarray(asset.lods[0].vertices, np.float64)


def _write_six(asset: Asset, folder: Path) -> None:
    sources = []
    for name, placement in COLLECTION.items():
        sources.append(folder / "single" / f"{name}.glb")
        sources[-1].parent.mkdir(exist_ok=True)
        write(replace(asset, name=name, placement=placement), sources[-1], overwrite=True)
    for version, name in (("1.1", "six"), ("1.0", "six_10")):
        arguments = ["tileset", *map(str, sources), "-o", str(folder / name), "--tiles-version", version, "--overwrite"]
        if main([*arguments, "-q"]):
            raise RuntimeError(f"tileset {version}")


def _write_city(folder: Path) -> None:
    """A collection of one, with a name that is not ASCII."""
    (folder / "drawn").mkdir(exist_ok=True)
    for file in FIGURE.glob("*.*"):
        shutil.copy(file, folder / "drawn" / file.name)
    rows = ["figure,keypoints,lon,lat,name,quality"]
    rows.append(f"drawn/image.png,drawn/keypoints.json,{PLACE.lon_deg},{PLACE.lat_deg},Bäuerin,draft")
    table = folder / "city.csv"
    table.write_text("\n".join(rows), encoding="utf-8")
    if main(["batch", str(table), "-o", str(folder / "city"), "-q"]):
        raise RuntimeError("batch")
