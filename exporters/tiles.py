"""3D Tiles 1.1 with glTF content: a folder of tileset.json and one .glb per level of detail.

https://docs.ogc.org/cs/22-025r4/22-025r4.html
https://github.com/CesiumGS/3d-tiles/tree/main/specification

The tile transform, in float64, carries the figure from the TILE frame (metres, z up) to ECEF; content stays in the
ASSET frame in float32, where a step is 1e-7 m instead of the 0.5 m that float32 has at the earth's surface.
Viewers turn glTF content from y-up to z-up before they apply the transform.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from exporters.asset import Asset
from exporters.errors import ExportError
from exporters.georeference import georeference
from exporters.glb import glb_bytes
from georef.geodesy import ecef_from_tile, tile_from_asset
from georef.transform import column_major

DEFAULT_VISIBLE_FROM_M = 2000.0
"""From how far away a figure is drawn unless asked otherwise, metres."""

VISIBLE_RANGE_PER_ERROR = 1080 / (16 * 2 * math.tan(math.radians(30)) * 1080 / 1920)
"""103.9: metres of distance per metre of geometric error at which CesiumJS stops drawing a tileset.

It draws where error * height / (distance * 2 tan(fov_y / 2)) > 16 pixels; here for a screen of 1920 x 1080 and the
default field of view of 60 degrees across. Other screens differ by their number of rows.
"""

BOX_MARGIN_M = 1e-3
"""Rounding, of a viewer's float32 too, must not push a vertex out of its volume; nor may a volume be flat."""


def content_name(name: str, lod: int) -> str:
    """File name of a level of detail of the asset called `name`: `name.glb`, `name_lod1.glb`, ..."""
    return safe_name(name) + (f"_lod{lod}" if lod else "") + ".glb"


def safe_name(name: str) -> str:
    """The name with everything that could leave its folder or hide the file replaced by an underscore."""
    return re.sub(r"[^\w.-]+", "_", name).strip(".") or "figure"


def write_tileset(asset: Asset, path: Path | str, visible_from_m: float = DEFAULT_VISIBLE_FROM_M) -> None:
    """Write a figure as a tileset of its own.

    asset : a placed asset; `deviation_m` of its levels of detail becomes the tiles' geometric errors
    path : a folder, made if it is not there, or the tileset.json in one; files of the same names are replaced
    visible_from_m : distance from which the figure is drawn at all, on a screen of 1080 rows

    Raises ExportError for an asset without a placement or a distance that is not positive.
    """
    path = Path(path)
    folder = path.parent if path.name == "tileset.json" else path
    document = tileset(asset, visible_from_m)
    folder.mkdir(parents=True, exist_ok=True)
    for lod in range(len(asset.lods)):
        (folder / content_name(asset.name, lod)).write_bytes(glb_bytes(asset, lod))
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    (folder / "tileset.json").write_bytes(text.encode() + b"\n")


def tileset(asset: Asset, visible_from_m: float = DEFAULT_VISIBLE_FROM_M) -> dict[str, Any]:
    """The tileset.json of an asset; arguments and errors as for `write_tileset`."""
    if not (math.isfinite(visible_from_m) and visible_from_m > 0):
        raise ExportError("--visible-from", f"{visible_from_m:g} m", "give a positive distance in metres")
    root = root_tile(asset)
    assert asset.placement is not None  # root_tile has checked
    properties: dict[str, Any] = {"name": {"type": "STRING", "required": True, "semantic": "NAME"}}
    values: dict[str, Any] = {"name": asset.name}
    if asset.copyright:
        # 3D Tiles' own `asset` has no copyright field; viewers show credits from the copyright of the glTF content.
        properties["copyright"] = {"type": "STRING", "required": True}
        values["copyright"] = asset.copyright
    error = max(visible_from_m / VISIBLE_RANGE_PER_ERROR, root["geometricError"])
    return {
        "asset": {"version": "1.1", "generator": "fig2mesh", "extras": {"georeference": georeference(asset.placement)}},
        "schema": {"id": "fig2mesh_tileset", "classes": {"figure": {"properties": properties}}},
        "metadata": {"class": "figure", "properties": values},
        "geometricError": error,
        "root": root,
    }


def root_tile(asset: Asset, folder: str = "") -> dict[str, Any]:
    """The tile of a figure: its coarsest level of detail, refined by REPLACE down to the finest.

    asset : a placed asset
    folder : where its content lies as seen from the tileset, "" or "name/"; for tilesets of many figures

    `transform` takes TILE to ECEF; the box, in the TILE frame, holds every vertex of every level. Raises ExportError
    for an asset without a placement.
    """
    if asset.placement is None:
        raise ExportError(asset.name, "3D Tiles need a place on the earth", "give --lonlat LON LAT")
    vertices = np.concatenate([tile_from_asset().apply(mesh.vertices) for mesh in asset.lods])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    half = (high - low) / 2 + BOX_MARGIN_M
    box = [*((low + high) / 2).tolist(), half[0], 0.0, 0.0, 0.0, half[1], 0.0, 0.0, 0.0, half[2]]
    volume = {"box": [float(value) + 0.0 for value in box]}

    # A tile's error is that of showing it instead of the finest mesh, and must not grow on the way to finer tiles.
    errors = np.maximum.accumulate([0.0, *(mesh.deviation_m[1] for mesh in asset.lods[1:])]).tolist()
    tile: dict[str, Any] = {}
    for lod, error in enumerate(errors):
        uri = quote(folder + content_name(asset.name, lod))
        children = {"children": [tile]} if tile else {}
        tile = {"boundingVolume": volume, "geometricError": error, "content": {"uri": uri}, **children}
    return {"transform": column_major(ecef_from_tile(asset.placement)), "refine": "REPLACE", **tile}
