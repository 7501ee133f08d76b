"""3D Tiles of one figure: a folder of tileset.json and one content file per level of detail.

Version 1.1 has binary glTF as content; version 1.0, for clients that do not support it, batched 3D models.

https://docs.ogc.org/cs/22-025r4/22-025r4.html
https://docs.ogc.org/cs/18-053r2/18-053r2.html
https://github.com/CesiumGS/3d-tiles/tree/main/specification

The tile transform, in float64, takes the figure from the TILE frame (metres, z up) to ECEF; content stays in the
ASSET frame in float32, where a step is 1e-7 m instead of the 0.5 m that float32 has at the earth's surface.
Viewers rotate glTF content from y-up to z-up before they apply the transform.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal
from urllib.parse import quote

from exporters.asset import Asset, TexturedMesh, without_outline
from exporters.errors import ExportError
from exporters.file_names import safe_name
from exporters.georeference import georeference
from exporters.gltf.glb import glb_bytes
from exporters.level_error import MAX_SCREEN_SPACE_ERROR_PX, level_errors
from exporters.placed_figure import PlacedFigure, ecef_matrix, figure_of
from exporters.profiles import GENERAL, Profile
from exporters.tiles.b3dm import b3dm_bytes

TilesVersion = Literal["1.0", "1.1"]

CONTENT_SUFFIXES: dict[TilesVersion, str] = {"1.0": ".b3dm", "1.1": ".glb"}
"""Suffix of content files, by version of 3D Tiles."""

MIN_VISIBLE_HEIGHTS = 10.0
"""Warning threshold of the visible range, in heights of the figure: below it, the figure vanishes while still large."""

VISIBLE_RANGE_PER_ERROR = 1080 / (MAX_SCREEN_SPACE_ERROR_PX * 2 * math.tan(math.radians(30)) * 1080 / 1920)
"""103.9: metres of distance per metre of geometric error at which CesiumJS stops drawing a tileset.

It draws where error * height / (distance * 2 tan(fov_y / 2)) > 16 pixels; here for a screen of 1920 x 1080 and the
default field of view of 60 degrees across. Other screens differ by their number of rows.
"""

BOX_MARGIN_M = 1e-3
"""Margin of boxes: rounding, also to a viewer's float32, must not move a vertex out of its box; no box may be flat."""


def content_name(name: str, lod: int, version: TilesVersion = "1.1") -> str:
    """File name of a level of detail of the asset called `name`: `name.glb`, `name_lod1.glb`, ..."""
    return safe_name(name) + (f"_lod{lod}" if lod else "") + CONTENT_SUFFIXES[version]


def write_tileset(
    asset: Asset,
    path: Path | str,
    visible_from_m: float | None = None,
    version: TilesVersion = "1.1",
    profile: Profile = GENERAL,
) -> None:
    """Write a figure as a tileset.

    asset : a placed asset; for the errors of its levels of detail see `exporters.level_error`
    path : a folder, created if missing, or the tileset.json in one; files of the same names are replaced
    visible_from_m : distance up to which the figure is drawn, on a screen of 1080 rows; None: `visible_range`
    version : of 3D Tiles
    profile : of the client of its content

    Raises ExportError for a profile that compresses content of version 1.0, an asset without a placement or a distance
    that is not positive.
    """
    path = Path(path)
    folder = path.parent if path.name == "tileset.json" else path
    if version == "1.0" and profile.compressed:
        finding = (
            f"cannot be combined with --profile {profile.name}, whose compression clients of 3D Tiles 1.0 cannot read"
        )
        raise ExportError("--tiles-version 1.0", finding, "omit one of them")
    asset = with_visible_outlines(asset)
    document = tileset(asset, visible_from_m, version)
    folder.mkdir(parents=True, exist_ok=True)
    for lod in range(len(asset.lods)):
        name = content_name(asset.name, lod, version)
        data = glb_bytes(asset, lod, profile)
        (folder / name).write_bytes(b3dm_bytes(data, name) if version == "1.0" else data)
    text = json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1)
    (folder / "tileset.json").write_bytes(text.encode() + b"\n")


def with_visible_outlines(asset: Asset) -> Asset:
    """Return the asset without the outlines of coarse levels that never show them: the line is narrower than a pixel.

    A level of detail is shown where its geometric error covers at most `MAX_SCREEN_SPACE_ERROR_PX` pixels, so that a
    sixteenth of its error is the smallest pixel. The finest level, which is also shown from nearby, keeps its outline.
    """

    def visible(mesh: TexturedMesh, error: float) -> TexturedMesh:
        wide = mesh.outline is not None and mesh.outline.width_m >= error / MAX_SCREEN_SPACE_ERROR_PX
        return mesh if wide else without_outline(mesh)

    errors = level_errors(asset.lods)
    return replace(asset, lods=tuple(map(visible, asset.lods, errors)))


def tileset(asset: Asset, visible_from_m: float | None = None, version: TilesVersion = "1.1") -> dict[str, Any]:
    """Return the tileset.json of an asset; arguments and errors as for `write_tileset`."""
    check_distance(visible_from_m)
    root = root_tile(asset, version=version)
    assert asset.placement is not None  # checked by root_tile
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
    """Raise ExportError unless a visible range is positive and finite, or None."""
    if visible_from_m is not None and not (math.isfinite(visible_from_m) and visible_from_m > 0):
        raise ExportError(
            "--visible-from", f"{visible_from_m:g} m is not a positive distance", "give a positive distance in metres"
        )


def visible_range(height_m: float) -> float:
    """Default distance, metres, up to which a figure of a height is drawn: 2 km for one of 1.79 m.

    At that distance a figure covers one and a half of 1080 rows.
    """
    return 2000.0 * (height_m / 1.79)


def visible_error(visible_from_m: float | None, height_m: float, min_error: float) -> float:
    """Geometric error, metres, of a tileset whose figure is drawn up to a distance; at least `min_error`, its root's.

    visible_from_m : None: `visible_range` of height_m
    """
    distance = visible_range(height_m) if visible_from_m is None else visible_from_m
    return max(distance / VISIBLE_RANGE_PER_ERROR, min_error)


def short_range_warning(visible_from_m: float | None, tallest_m: float) -> str | None:
    """Return a one-line warning if the distance is small for the height of the tallest figure, else None."""
    if visible_from_m is None or visible_from_m >= MIN_VISIBLE_HEIGHTS * tallest_m:
        return None
    return (
        f"--visible-from: beyond {visible_from_m:g} m a figure {tallest_m:g} m tall is not drawn; "
        f"the default range is {visible_range(tallest_m):.0f} m"
    )


def root_tile(asset: Asset, folder: str = "", version: TilesVersion = "1.1") -> dict[str, Any]:
    """Return the tile of a figure, see `figure_tile`.

    asset : a placed asset
    folder : of its content, relative to the tileset, "" or "name/"

    Raises ExportError for an asset without a placement.
    """
    names = tuple(folder + content_name(asset.name, lod, version) for lod in range(len(asset.lods)))
    return figure_tile(figure_of(asset, names))


def figure_tile(figure: PlacedFigure, facts: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return the tile of a figure: its coarsest level of detail, refined by REPLACE down to the finest.

    figure : its contents relative to the tileset
    facts : further members of each of its tiles, such as metadata

    `transform` takes TILE to ECEF; the box, in the TILE frame, contains every vertex of every level.
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
        children = {"children": [tile]} if tile else {}
        content = {"content": {"uri": quote(uri)}}
        tile = {"boundingVolume": volume, "geometricError": error, **(facts or {}), **content, **children}
    # Column by column; adding zero turns -0.0 into 0.0, so that equal transforms are written identically.
    transform = (ecef_matrix(figure.placement).T.ravel() + 0.0).tolist()
    return {"transform": transform, "refine": "REPLACE", **tile}
