"""Placed figures for tilesets of many: lightweight records whose meshes stay on disk."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Asset
from exporters.errors import ExportError
from exporters.level_error import level_errors
from exporters.sampling import face_parts, observed_shares
from exporters.text import plain_text
from georef.geodesy import ecef_from_tile, tile_from_asset
from georef.placement import GeoPlacement

Vector = tuple[float, float, float]
Value = str | int | float | bool | None
"""Value of an attribute; integers have at most 64 bits."""

Attributes = tuple[tuple[str, Value], ...]


@dataclass(frozen=True, slots=True)
class PlacedFigure:
    """Record of a figure in a tileset; about 1 kB, so that 100,000 of them fit into memory.

    name : display name; need not be unique
    placement : its place on the earth
    low, high : corners of the box round all levels of detail and their outlines, TILE frame, metres
    contents : one file per level of detail, finest first: paths with slashes, relative to the tileset's folder, or
        their paths before they are copied there
    errors : per level, the geometric error of its tile, metres; the first is 0
    source : the picture it was made from, "" if unknown
    copyright : attribution line, may be empty
    parts : names of its body parts
    shares : per part, the observed share of its surface; empty if unknown
    observed : the same share for the whole surface; None if unknown
    attributes : further columns of the figure's row in a table, such as artist and year: pairs of name and value,
        stored as `plain_attributes`. Figures of one table have the same columns in the same order
    score : confidence that it is a person, 0-1; None where its joints were given; doubts : about it, as one text
    """

    name: str
    placement: GeoPlacement
    low: Vector
    high: Vector
    contents: tuple[str, ...]
    errors: tuple[float, ...]
    source: str = ""
    copyright: str = ""
    parts: tuple[str, ...] = ()
    shares: tuple[float, ...] = ()
    observed: float | None = None
    attributes: Attributes = ()
    score: float | None = None
    doubts: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "attributes", plain_attributes(self.attributes))
        if not self.contents or len(self.contents) != len(self.errors):
            raise ValueError(f"{self.name}: {len(self.contents)} contents with {len(self.errors)} errors")


def plain_attributes(given: Mapping[str, Any] | Iterable[tuple[str, Any]]) -> Attributes:
    """Convert names and values to types that every index supports: str, int, float, bool or None.

    NumPy scalars become Python scalars. Integers beyond signed 64 bits become text: SQLite has none, and GDAL opens no
    GeoJSON with one. A number that is not finite becomes None, as tables write missing numbers as NaN, which JSON does
    not have. Characters that UTF-8 (lone surrogates) or SQLite (NUL) cannot represent are replaced or removed.

    Raises ValueError for a value of another type.
    """
    pairs = given.items() if isinstance(given, Mapping) else given
    return tuple((plain_text(str(name)), _plain(name, value)) for name, value in pairs)


def _plain(name: str, value: Any) -> Value:
    if value is None or type(value) is bool:
        return value
    if isinstance(value, str):
        return plain_text(value)
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, Integral):
        whole = int(value)
        return whole if -(2**63) <= whole < 2**63 else str(whole)
    if isinstance(value, Real):
        return float(value) if math.isfinite(value) else None
    raise ValueError(f"attribute {name!r} is of type {type(value).__name__}")


def figure_of(asset: Asset, contents: tuple[str, ...]) -> PlacedFigure:
    """Return the record of an asset in memory.

    asset : with a placement; for the errors see `exporters.level_error`
    contents : paths of its levels of detail, existing or to be written, finest first

    Raises ExportError for an asset without a placement.
    """
    if asset.placement is None:
        raise ExportError(asset.name, "the format needs a place on the earth", "give --lonlat LON LAT")
    outlines = [mesh.outline.vertices for mesh in asset.lods if mesh.outline is not None]
    vertices = tile_from_asset().apply(np.concatenate([*(mesh.vertices for mesh in asset.lods), *outlines]))
    mesh = asset.mesh
    score, doubts = doubts_of(asset.metadata)
    shares = observed_shares(mesh) or {}
    labels = [] if mesh.parts is None else np.unique(mesh.parts).tolist()
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    return PlacedFigure(
        name=asset.name,
        placement=asset.placement,
        low=vector(vertices.min(axis=0)),
        high=vector(vertices.max(axis=0)),
        contents=contents,
        errors=level_errors(asset.lods),
        source=str(asset.metadata.get("source", "")),
        copyright=asset.copyright,
        parts=tuple(asset.part_names.get(label, f"part_{label}") for label in labels),
        shares=tuple(round(shares[label], 4) for label in labels) if shares else (),
        observed=_mean_share(shares, face_parts(mesh), corners) if shares else None,
        score=score,
        doubts=doubts,
    )


def doubts_of(metadata: Any) -> tuple[float | None, str]:
    """Score and doubts in the metadata of an asset or of a file; (None, "") where there are none."""
    if not isinstance(metadata, Mapping):
        return None, ""
    score, doubts = metadata.get("score"), metadata.get("doubts")
    usable = isinstance(score, int | float) and not isinstance(score, bool) and math.isfinite(score)
    lines = [str(each) for each in doubts] if isinstance(doubts, list) else []
    return (float(score) if usable and score is not None else None), "; ".join(lines)


def _mean_share(shares: dict[int, float], faces: NDArray[Any], corners: NDArray[np.float64]) -> float:
    by_label = np.zeros(256)
    by_label[list(shares)] = list(shares.values())
    return area_mean(by_label[faces], corners)


def area_mean(values: NDArray[np.float64], corners: NDArray[np.float64]) -> float:
    """Mean of (F,) values of triangles by their area, rounded to 4 digits; corners : (F, 3, 3) any unit."""
    (ax, ay, az), (bx, by, bz) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    area = np.sqrt((ay * bz - az * by) ** 2 + (az * bx - ax * bz) ** 2 + (ax * by - ay * bx) ** 2)
    total = float(area.sum())
    return round(float(area @ values) / total, 4) if total else 0.0


@functools.lru_cache(maxsize=1 << 17)
def ecef_matrix(placement: GeoPlacement) -> NDArray[np.float64]:
    """(4, 4) ECEF from TILE, read-only; cached, as box, transform and orientation of each figure need it."""
    return ecef_from_tile(placement).matrix


def vector(values: NDArray[np.float64]) -> Vector:
    """Convert an array of three numbers to a tuple of Python floats."""
    x, y, z = values.tolist()
    return (x, y, z)
