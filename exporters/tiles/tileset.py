"""3D Tiles of one figure: a folder of tileset.json and one content file per level of detail.

Version 1.1 has binary glTF as content; version 1.0, for clients that do not know the other, batched 3D models.

https://docs.ogc.org/cs/22-025r4/22-025r4.html
https://docs.ogc.org/cs/18-053r2/18-053r2.html
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
from typing import Any, Literal
from urllib.parse import quote

from exporters.asset import Asset
from exporters.errors import ExportError
from exporters.georeference import georeference
from exporters.gltf.glb import glb_bytes
from exporters.placed_figure import PlacedFigure, ecef_matrix, figure_of
from exporters.profiles import GENERAL, Profile
from exporters.tiles.b3dm import b3dm_bytes

TilesVersion = Literal["1.0", "1.1"]

CONTENT_SUFFIXES: dict[TilesVersion, str] = {"1.0": ".b3dm", "1.1": ".glb"}
"""What content is, by version of 3D Tiles."""

MIN_VISIBLE_HEIGHTS = 10.0
"""Heights of a figure from which it should at least be drawn; with less, it vanishes while it is large on screen."""

VISIBLE_RANGE_PER_ERROR = 1080 / (16 * 2 * math.tan(math.radians(30)) * 1080 / 1920)
"""103.9: metres of distance per metre of geometric error at which CesiumJS stops drawing a tileset.

It draws where error * height / (distance * 2 tan(fov_y / 2)) > 16 pixels; here for a screen of 1920 x 1080 and the
default field of view of 60 degrees across. Other screens differ by their number of rows.
"""

BOX_MARGIN_M = 1e-3
"""Rounding, of a viewer's float32 too, must not push a vertex out of its volume; nor may a volume be flat."""


def content_name(name: str, lod: int, version: TilesVersion = "1.1") -> str:
    """File name of a level of detail of the asset called `name`: `name.glb`, `name_lod1.glb`, ..."""
    return safe_name(name) + (f"_lod{lod}" if lod else "") + CONTENT_SUFFIXES[version]


def safe_name(name: str) -> str:
    """The name with everything that could leave its folder or hide the file replaced by an underscore."""
    return re.sub(r"[^\w.-]+", "_", name).strip(".") or "figure"


def write_tileset(
    asset: Asset,
    path: Path | str,
    visible_from_m: float | None = None,
    version: TilesVersion = "1.1",
    profile: Profile = GENERAL,
) -> None:
    """Write a figure as a tileset of its own.

    asset : a placed asset; `deviation_m` of its levels of detail becomes the tiles' geometric errors
    path : a folder, made if it is not there, or the tileset.json in one; files of the same names are replaced
    visible_from_m : distance from which the figure is drawn at all, on a screen of 1080 rows; None: `visible_range`
    version : of 3D Tiles
    profile : what the client of its content takes

    Raises ExportError for a profile that compresses content of version 1.0, an asset without a placement or a distance
    that is not positive.
    """
    path = Path(path)
    folder = path.parent if path.name == "tileset.json" else path
    if version == "1.0" and profile.compressed:
        found = f"--profile {profile.name} compresses, and clients of 3D Tiles 1.0 read no such content"
        raise ExportError("--tiles-version", found, "leave either away")
    document = tileset(asset, visible_from_m, version)
    folder.mkdir(parents=True, exist_ok=True)
    for lod in range(len(asset.lods)):
        name = content_name(asset.name, lod, version)
        data = glb_bytes(asset, lod, profile)
        (folder / name).write_bytes(b3dm_bytes(data, name) if version == "1.0" else data)
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    (folder / "tileset.json").write_bytes(text.encode() + b"\n")


def tileset(asset: Asset, visible_from_m: float | None = None, version: TilesVersion = "1.1") -> dict[str, Any]:
    """The tileset.json of an asset; arguments and errors as for `write_tileset`."""
    check_distance(visible_from_m)
    root = root_tile(asset, version=version)
    assert asset.placement is not None  # root_tile has checked
    height_m = asset.placement.figure_height_m
    properties: dict[str, Any] = {"name": {"type": "STRING", "required": True, "semantic": "NAME"}}
    values: dict[str, Any] = {"name": asset.name}
    if asset.copyright:
        # 3D Tiles' own `asset` has no copyright field; viewers show credits from the copyright of the glTF content.
        properties["copyright"] = {"type": "STRING", "required": True}
        values["copyright"] = asset.copyright
    metadata = {
        "schema": {"id": "fig2mesh_tileset", "classes": {"figure": {"properties": properties}}},
        "metadata": {"class": "figure", "properties": values},
    }
    extras = {"georeference": georeference(asset.placement)}
    return {
        "asset": {"version": version, "generator": "fig2mesh", "extras": extras},
        **(metadata if version == "1.1" else {"extras": values}),
        "geometricError": visible_error(visible_from_m, height_m, root["geometricError"]),
        "root": root,
    }


def check_distance(visible_from_m: float | None) -> None:
    """Raise ExportError unless a distance to be seen from is one, or None."""
    if visible_from_m is not None and not (math.isfinite(visible_from_m) and visible_from_m > 0):
        raise ExportError("--visible-from", f"{visible_from_m:g} m", "give a positive distance in metres")


def visible_range(height_m: float) -> float:
    """Distance, metres, from which a figure of a height is drawn unless asked otherwise: 2 km for one of 1.79 m.

    From that many heights away a figure covers one and a half of 1080 rows.
    """
    return 2000.0 * (height_m / 1.79)


def visible_error(visible_from_m: float | None, height_m: float, least: float) -> float:
    """Geometric error, metres, of a tileset whose figure is drawn from that far; not below `least`, its root's.

    visible_from_m : None takes `visible_range` of height_m
    """
    distance = visible_range(height_m) if visible_from_m is None else visible_from_m
    return max(distance / VISIBLE_RANGE_PER_ERROR, least)


def too_near_note(visible_from_m: float | None, tallest_m: float) -> str | None:
    """A warning of one line where the distance is little for the height of the tallest figure, else None."""
    if visible_from_m is None or visible_from_m >= MIN_VISIBLE_HEIGHTS * tallest_m:
        return None
    return (
        f"--visible-from: from farther than {visible_from_m:g} m a figure {tallest_m:g} m tall is not drawn; "
        f"without the option its range is {visible_range(tallest_m):.0f} m"
    )


def root_tile(asset: Asset, folder: str = "", version: TilesVersion = "1.1") -> dict[str, Any]:
    """The tile of a figure, see `figure_tile`.

    asset : a placed asset
    folder : where its content lies as seen from the tileset, "" or "name/"

    Raises ExportError for an asset without a placement.
    """
    names = tuple(folder + content_name(asset.name, lod, version) for lod in range(len(asset.lods)))
    return figure_tile(figure_of(asset, names))


def figure_tile(figure: PlacedFigure, facts: dict[str, Any] | None = None) -> dict[str, Any]:
    """The tile of a figure: its coarsest level of detail, refined by REPLACE down to the finest.

    figure : its contents as seen from the tileset
    facts : what each of its tiles is to have besides, such as metadata

    `transform` takes TILE to ECEF; the box, in the TILE frame, holds every vertex of every level.
    """
    centre = [round((low + high) / 2, 6) for low, high in zip(figure.low, figure.high, strict=True)]
    half = [
        math.ceil((max(high - middle, middle - low) + BOX_MARGIN_M) * 1e6) / 1e6
        for low, middle, high in zip(figure.low, centre, figure.high, strict=True)
    ]
    box = [*centre, half[0], 0.0, 0.0, 0.0, half[1], 0.0, 0.0, 0.0, half[2]]
    volume = {"box": [value + 0.0 for value in box]}
    tile: dict[str, Any] = {}
    for uri, error in zip(figure.contents, figure.errors, strict=True):
        # A tile's error is that of showing it instead of the finest mesh.
        children = {"children": [tile]} if tile else {}
        content = {"content": {"uri": quote(uri)}}
        tile = {"boundingVolume": volume, "geometricError": error, **(facts or {}), **content, **children}
    # Column by column; adding zero turns -0.0 into 0.0, as the same place must not be written in two ways.
    transform = (ecef_matrix(figure.placement).T.ravel() + 0.0).tolist()
    return {"transform": transform, "refine": "REPLACE", **tile}
