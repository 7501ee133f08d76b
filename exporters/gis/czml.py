"""CZML: figures as CesiumJS entities, which, unlike tilesets, can be clamped to terrain.

https://github.com/AnalyticalGraphicsInc/czml-writer/wiki/CZML-Structure
https://cesium.com/learn/cesiumjs/ref-doc/ModelGraphics.html
"""

from __future__ import annotations

import html
import json
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Asset
from exporters.gltf.glb import write_glb
from exporters.placed_figure import PlacedFigure, ecef_matrix, figure_of
from exporters.profiles import GENERAL, Profile
from georef.placement import GeoPlacement


def packet(figure: PlacedFigure, identifier: str, model: str) -> dict[str, Any]:
    """Return the packet of a figure.

    identifier : unique in its document; model : path of its model relative to the file
    """
    place = figure.placement
    return {
        "id": identifier,
        "name": figure.name,
        "description": description(figure),
        "position": {"cartographicDegrees": [place.lon_deg, place.lat_deg, place.height_m]},
        "orientation": {"unitQuaternion": entity_quaternion(place)},
        "model": {"gltf": quote(model), "heightReference": height_reference(place)},
        "properties": {
            "heading_deg": place.heading_deg,
            "figure_height_m": place.figure_height_m,
            **({"source": figure.source} if figure.source else {}),
            **({"credit": figure.copyright} if figure.copyright else {}),
            **({"observed_share": figure.observed} if figure.observed is not None else {}),
        },
    }


def height_reference(place: GeoPlacement) -> str:
    """Return the heightReference of CesiumJS; RELATIVE_TO_GROUND where clamped feet are not on the ground."""
    if place.altitude_mode == "absolute":
        return "NONE"
    return "RELATIVE_TO_GROUND" if place.height_m else "CLAMP_TO_GROUND"


def entity_quaternion(place: GeoPlacement) -> list[float]:
    """Unit quaternion (x, y, z, w) of a CesiumJS Entity in ECEF whose model's nose points to the heading.

    CesiumJS maps a model's front, +Z of glTF, to the entity's +x, its +X to +y and its up to +z.
    """
    left, back, up = ecef_matrix(place)[:3, :3].T
    return quaternion(np.stack([-back, left, up], axis=1))


def quaternion(rotation: NDArray[np.float64]) -> list[float]:
    """Unit quaternion (x, y, z, w) of a (3, 3) rotation, w or else the first non-zero component positive.

    Shepperd (1978): divides by the largest component, for numerical stability.
    """
    trace = float(np.trace(rotation))
    squares = [*(1 - trace + 2 * float(rotation[axis, axis]) for axis in range(3)), 1 + trace]
    largest = int(np.argmax(squares))
    pairs = {
        (0, 1): rotation[0, 1] + rotation[1, 0],
        (0, 2): rotation[0, 2] + rotation[2, 0],
        (1, 2): rotation[1, 2] + rotation[2, 1],
        (0, 3): rotation[2, 1] - rotation[1, 2],
        (1, 3): rotation[0, 2] - rotation[2, 0],
        (2, 3): rotation[1, 0] - rotation[0, 1],
    }
    values = [
        squares[largest] if axis == largest else float(pairs[min(axis, largest), max(axis, largest)])
        for axis in range(4)
    ]
    sign = next((math.copysign(1.0, value) for value in [values[3], *values[:3]] if value), 1.0)
    length = math.hypot(*values) * sign
    return [value / length + 0.0 for value in values]


def description(figure: PlacedFigure) -> str:
    """Return an HTML table of the facts about a figure; all text in it is escaped."""
    place = figure.placement
    ground = "above the terrain" if place.altitude_mode == "clamp" else "above the ellipsoid"
    rows = {
        "Source": figure.source,
        "Credit": figure.copyright,
        "Place": f"{place.lon_deg:.6f}, {place.lat_deg:.6f}, {place.height_m:.2f} m {ground}",
        "Looks to": f"{place.heading_deg:.1f}°",
        "Height": f"{place.figure_height_m:g} m",
        "Parts": ", ".join(figure.parts),
        "Shown by the drawing": "" if figure.observed is None else f"{figure.observed:.0%} of the surface",
    }
    cells = (f"<tr><th>{key}</th><td>{html.escape(value)}</td></tr>" for key, value in rows.items() if value)
    return f"<table>{''.join(cells)}</table>"


def write_czml(asset: Asset, path: Path, profile: Profile = GENERAL) -> None:
    """Write a placed asset as a CZML document, with its model as `<stem>.glb` next to it.

    profile : of the client of the model

    Raises ExportError for an asset without a placement or triangles.
    """
    model = path.with_suffix(".glb")
    figure = figure_of(replace(asset, lods=asset.lods[:1]), (model.name,))
    write_glb(asset, model, profile)
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        write_packets([figure], stream, asset.name)


def write_packets(figures: Iterable[PlacedFigure], stream: TextIO, name: str) -> None:
    """Write a CZML document, one packet per line.

    figures : `contents` relative to the file; the finest of each is its model
    name : of the document
    """
    head = {"id": "document", "name": name, "version": "1.0"}
    stream.write("[\n" + json.dumps(head, ensure_ascii=False))
    for number, figure in enumerate(figures, 1):
        text = json.dumps(
            packet(figure, f"figure_{number}", figure.contents[0]),
            ensure_ascii=False,
            allow_nan=False,
            separators=(",", ":"),
        )
        stream.write(",\n" + text)
    stream.write("\n]\n")
