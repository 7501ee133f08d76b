"""Reader of figures and their places from files: a .glb, the tileset of one figure or many, a folder of such files."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from exporters.errors import ExportError
from exporters.georeference import placement_of_record
from exporters.gltf.reader import Gltf, open_glb
from exporters.gltf.stated import stated_corners
from exporters.level_error import monotone_errors
from exporters.placed_figure import PlacedFigure, area_mean, doubts_of, ecef_matrix, vector
from exporters.tiles.b3dm import part_table
from georef.geodesy import tile_from_asset
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_shape import NUMBER, Numbers, Required, check_shape

SAME_PLACE_M = 1e-3
"""Tolerance between a tile's transform and the place recorded in its content: the accuracy that fig2mesh guarantees."""


def read_figures(path: Path) -> Iterator[PlacedFigure]:
    """Read the figures in a file or folder, with absolute content paths, in the order of their names.

    path : a .glb; a tileset.json that `fig2mesh` wrote, 3D Tiles 1.1, or its folder; or a folder that holds any
        number of those at any depth. In a folder with a tileset, only the files that the tileset names are read

    Raises ExportError naming the file that has no place on the earth, or cannot be read.
    """
    if not path.exists():
        raise ExportError(path, "no such file or folder", "check the path")
    if path.is_dir():
        if (path / "tileset.json").is_file():
            yield from _tileset(path / "tileset.json", frozenset(), set())
            return
        for each in sorted(path.iterdir()):
            hidden = each.name.startswith(".")
            folder = each.is_dir() and not each.is_symlink()  # links could lead back up
            if not hidden and (folder or each.suffix.lower() == ".glb"):
                yield from read_figures(each)
    elif path.suffix.lower() == ".glb":
        yield read_figure(path)
    elif path.suffix.lower() == ".json":
        yield from _tileset(path, frozenset(), set())
    else:
        raise ExportError(path, "not a figure for a tileset", "give .glb files, tilesets or folders of them")


def read_figure(path: Path) -> PlacedFigure:
    """Read the record of one .glb file, its only content. Raises ExportError if it has no place or is not glTF."""
    gltf = open_glb(path)
    record = gltf.extras.get("georeference")
    if not isinstance(record, dict):
        raise ExportError(path, "has no place on the earth", "make it with --lonlat LON LAT")
    try:
        placement = placement_of_record(record)
        corners = tile_from_asset().apply(stated_corners(gltf))
        table = part_table(gltf)
        shares = table.get("observedShare", [])
        if not all(isinstance(share, float) for share in shares):
            raise DamagedFile("observedShare does not consist of numbers")
        metadata = gltf.extras.get("metadata")
        score, doubts = doubts_of(metadata)
        return PlacedFigure(
            name=next((str(node["name"]) for node in gltf.items("nodes") if node.get("name")), path.stem),
            placement=placement,
            low=vector(corners.min(axis=0)),
            high=vector(corners.max(axis=0)),
            contents=(os.path.abspath(path),),
            errors=(0.0,),
            source=str(metadata.get("source", "")) if isinstance(metadata, dict) else "",
            copyright=gltf.document.get("asset", {}).get("copyright", ""),
            parts=tuple(map(str, table.get("name", []))),
            shares=tuple(round(share, 4) for share in shares),
            observed=_observed(gltf, np.array(shares)) if shares else None,
            score=score,
            doubts=doubts,
        )
    except DamagedFile as error:
        raise ExportError(path, f"broken glTF ({error})", "run fig2mesh validate") from error


def _observed(gltf: Gltf, shares: NDArray[np.float64]) -> float | None:
    """Share of the surface area that is observed in the drawing; None where it is compressed or split."""
    used = gltf.document.get("extensionsUsed", [])
    solids = [mesh for mesh in range(len(gltf.items("meshes"))) if mesh not in gltf.outlines]
    if len(solids) != 1 or any("compression" in each or "quantization" in each for each in used):
        return None
    primitives = gltf.primitives(solids[0])
    if len(primitives) != 1 or "_FEATURE_ID_0" not in primitives[0]["attributes"]:
        return None
    positions, faces = gltf.mesh_arrays(solids[0])
    ids = gltf.accessor(primitives[0]["attributes"]["_FEATURE_ID_0"])
    if ids.shape != (len(positions),) or not ((ids >= 0) & (ids < len(shares))).all():
        raise DamagedFile("the vertices' parts are not in the property table")
    rows = ids.astype(np.int64)
    first, second, third = rows[faces].T
    # A triangle belongs to the part of two of its corners, as in exporters.sampling.
    values = shares[np.where(second == third, second, first)]
    return area_mean(values, positions[faces].astype(np.float64))


def _tileset(path: Path, chain: frozenset[Path], read: set[Path]) -> Iterator[PlacedFigure]:
    """Read the figures of a tileset; chain : the tilesets that lead to it; read : files already read, extended here."""
    from exporters.tiles.check import read_tileset

    document = read_tileset(path)
    if path.resolve() in chain:
        raise ExportError(path, "contains itself", "run fig2mesh validate")
    if path.resolve() in read:
        return  # the same figures again; files that each name the next one twice would take exponential time
    read.add(path.resolve())
    try:
        yield from _tiles(document["root"], path, chain | {path.resolve()}, read)
    except DamagedFile as error:
        raise ExportError(path, f"broken tileset ({error})", "run fig2mesh validate") from error


def _tiles(tile: dict[str, Any], path: Path, chain: frozenset[Path], read: set[Path]) -> Iterator[PlacedFigure]:
    if "transform" in tile:
        yield _figure_of_tiles(tile, path)
        return
    uri = tile.get("content", {}).get("uri", "")
    if uri.lower().endswith(".json"):
        yield from _tileset(path.parent / unquote(uri), chain, read)
    elif uri:
        raise ExportError(path, f"no tile transform for {uri}", "give the .glb files that were made with --lonlat")
    for child in tile.get("children", []):
        yield from _tiles(child, path, chain, read)


def _figure_of_tiles(tile: dict[str, Any], path: Path) -> PlacedFigure:
    """Read the figure of a tile with a transform: its levels are the tile and a chain of single children."""
    levels: list[tuple[Path, float]] = []
    below: dict[str, Any] | None = tile
    while below is not None:
        content, children = below.get("content", {}), below.get("children", [])
        uri = unquote(content.get("uri", ""))
        if not uri.lower().endswith(".glb") or len(children) > 1:
            found = f"content {uri!r} with {len(children)} finer tiles is not a level of detail of a figure"
            raise ExportError(path, found, "give the .glb files instead")
        check_shape(below, {"geometricError": Required(NUMBER)}, f"tile of {uri[:40]}")
        levels.append((path.parent / uri, float(below["geometricError"])))
        below = children[0] if children else None
    records = [read_figure(file) for file, _ in reversed(levels)]
    finest = records[0]
    check_shape(tile["transform"], Numbers(16), "transform")
    matrix = np.asarray(tile["transform"], dtype=np.float64).reshape(4, 4).T
    away = float(np.linalg.norm(ecef_matrix(finest.placement)[:3, 3] - matrix[:3, 3]))
    if away > SAME_PLACE_M:
        raise ExportError(
            path, f"puts {levels[-1][0].name} {away:.3g} m from the place recorded in it", "write it again"
        )
    return PlacedFigure(
        name=finest.name,
        placement=finest.placement,
        low=vector(np.min([record.low for record in records], axis=0)),
        high=vector(np.max([record.high for record in records], axis=0)),
        contents=tuple(record.contents[0] for record in records),
        errors=monotone_errors([0.0, *(error for _, error in levels[-2::-1])]),
        source=finest.source,
        copyright=finest.copyright,
        parts=finest.parts,
        shares=finest.shares,
        observed=finest.observed,
        score=finest.score,
        doubts=finest.doubts,
    )


def describe(figure: PlacedFigure) -> str:
    """Serialise a record without the paths of its contents; equal figures have equal descriptions."""
    values = {name: getattr(figure, name) for name in figure.__dataclass_fields__ if name != "contents"}
    return json.dumps(values | {"placement": vars(figure.placement)}, sort_keys=True, default=str)
