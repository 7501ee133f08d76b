"""GeoJSON: figures as points with attributes, for maps; an attribute names the model.

https://www.rfc-editor.org/rfc/rfc7946
"""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO
from urllib.parse import quote

from exporters.asset import Asset
from exporters.gltf.glb import write_glb
from exporters.placed_figure import PlacedFigure, figure_of
from exporters.profiles import GENERAL, Profile

OWN_PROPERTIES: dict[str, type] = {
    "name": str,
    "source": str,
    "credit": str,
    "heading_deg": float,
    "figure_height_m": float,
    "height_m": float,
    "height_datum": str,
    "altitude_mode": str,
    "observed_share": float,
    "score": float,
    "doubts": str,
    "parts": str,
    "model": str,
}
"""Properties of a feature before the columns of the user's table, in order; any may be None."""


def feature(figure: PlacedFigure, model: str | None) -> dict[str, Any]:
    """Return a figure as a Feature with a Point; its properties are `OWN_PROPERTIES` and then the figure's attributes.

    model : path of its model relative to the file, None without one

    The third coordinate is the height above the ellipsoid, as in RFC 7946. A figure that is clamped to the terrain has
    no such height: its `height_m` is above the terrain, and its point has two coordinates.
    Attributes with reserved names are renamed, see `free_names`.
    """
    place = figure.placement
    clamped = place.altitude_mode == "clamp"
    properties: dict[str, Any] = {
        "name": figure.name,
        "source": figure.source or None,
        "credit": figure.copyright or None,
        "heading_deg": place.heading_deg,
        "figure_height_m": place.figure_height_m,
        "height_m": place.height_m,
        "height_datum": place.height_datum,
        "altitude_mode": place.altitude_mode,
        "observed_share": figure.observed,
        "score": figure.score,
        "doubts": figure.doubts or None,
        "parts": ", ".join(figure.parts) or None,  # text, as GIS tables have no lists
        "model": quote(model) if model else None,
    }
    names = free_names(tuple(name for name, _ in figure.attributes), tuple(OWN_PROPERTIES))
    properties |= {name: value for name, (_, value) in zip(names, figure.attributes, strict=True)}
    coordinates = [place.lon_deg, place.lat_deg, *([] if clamped else [place.height_m])]
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": coordinates},
        # Every feature has the same attributes: readers derive the table from the first one.
        "properties": properties,
    }


@functools.lru_cache(maxsize=64)
def free_names(names: tuple[str, ...], taken: tuple[str, ...]) -> tuple[str, ...]:
    """Make column names unique by appending `_2`, or the first free number, to those already taken.

    Comparison ignores case, as in SQL: `Name` next to `name` becomes `Name_2`. The first of several equal names is
    kept; a column that needs no number keeps its name in any case. An empty name becomes `column`.
    """
    used = {name.casefold() for name in taken}
    found = list(names)
    clashing = []
    for index, name in enumerate(names):
        if not name or name.casefold() in used:
            clashing.append(index)
        used.add(name.casefold())
    for index in clashing:
        base = names[index] or "column"
        candidates = itertools.chain([base], (f"{base}_{number}" for number in itertools.count(2)))
        found[index] = next(each for each in candidates if each.casefold() not in used)
        used.add(found[index].casefold())
    return tuple(found)


def write_geojson(asset: Asset, path: Path, profile: Profile = GENERAL) -> None:
    """Write a placed asset as one Feature, with its model as `<stem>.glb` next to it.

    profile : of the client of the model

    Raises ExportError for an asset without a placement or triangles.
    """
    model = path.with_suffix(".glb")
    document = feature(figure_of(replace(asset, lods=asset.lods[:1]), (model.name,)), model.name)
    write_glb(asset, model, profile)
    path.write_bytes(_text(document).encode() + b"\n")


def write_collection(figures: Iterable[PlacedFigure], stream: TextIO, models: bool = True) -> None:
    """Write a FeatureCollection, one feature per line.

    figures : `contents` relative to the file; models : whether to name the finest of them
    """
    stream.write('{"type":"FeatureCollection","features":[')
    for number, figure in enumerate(figures):
        stream.write(",\n" if number else "\n")
        stream.write(_text(feature(figure, figure.contents[0] if models else None)))
    stream.write("\n]}\n")


def _text(document: dict[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
