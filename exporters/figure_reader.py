"""Reader of figures and their places from files: a .glb, the tileset of one figure or many, a folder of such files."""

from __future__ import annotations

import itertools
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
from exporters.placed_figure import PlacedFigure, area_mean, doubts_of, ecef_matrix, monotone_errors, vector
from exporters.tiles.b3dm import part_table
from georef.geodesy import tile_from_asset
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_shape import NUMBER, Numbers, Required, check_shape

SAME_PLACE_M = 1e-3
"""Tolerance between a tile's transform and the place recorded in its content: the accuracy that fig2mesh guarantees."""

INTEGER_SCALES = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}

CORNER_ENDS = np.array(list(itertools.product((0, 1), repeat=3)))
"""(8, 3): for each corner of a box, which of its two ends along each axis."""

Box = NDArray[np.float64]


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
        low, high = _bounds(gltf)
        table = part_table(gltf)
        shares = table.get("observedShare", [])
        if not all(isinstance(share, float) for share in shares):
            raise DamagedFile("observedShare does not consist of numbers")
        metadata = gltf.extras.get("metadata")
        score, doubts = doubts_of(metadata)
        return PlacedFigure(
            name=next((str(node["name"]) for node in gltf.items("nodes") if node.get("name")), path.stem),
            placement=placement,
            low=vector(low),
            high=vector(high),
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


def _bounds(gltf: Gltf) -> tuple[Box, Box]:
    """Corners, in the TILE frame, of a box round all meshes of the scene, outlines included.

    From the accessors' min and max, which glTF requires, so compressed files need not be decompressed.
    """
    corners = []
    for mesh, matrix in gltf.instances():
        for primitive in gltf.primitives(mesh):
            if "POSITION" not in primitive["attributes"]:
                raise DamagedFile(f"meshes/{mesh} has no positions")
            accessor = gltf.item("accessors", primitive["attributes"]["POSITION"])
            if len(accessor.get("min", ())) != 3 or len(accessor.get("max", ())) != 3:
                raise DamagedFile(f"the positions of meshes/{mesh} have no min and max")
            ends = np.array([accessor["min"], accessor["max"]], dtype=np.float64)
            if accessor.get("normalized"):
                if accessor["componentType"] not in INTEGER_SCALES:
                    raise DamagedFile(f"normalised positions of componentType {accessor['componentType']}")
                ends = np.maximum(ends / INTEGER_SCALES[accessor["componentType"]], -1.0)
            corners.append(ends[CORNER_ENDS, [0, 1, 2]] @ matrix[:3, :3].T + matrix[:3, 3])
    if not corners:
        raise DamagedFile("no mesh in the scene")
    points = tile_from_asset().apply(np.concatenate(corners))
    if not np.isfinite(points).all():
        raise DamagedFile("vertices are not finite")
    return points.min(axis=0), points.max(axis=0)


def _observed(gltf: Gltf, shares: NDArray[np.float64]) -> float | None:
    """Share of the surface area that is observed in the drawing; None where the mesh is compressed."""
    used = gltf.document.get("extensionsUsed", [])
    if len(gltf.items("meshes")) - len(gltf.outlines) != 1 or any(
        "compression" in each or "quantization" in each for each in used
    ):
        return None
    if not gltf.primitives(0) or "_FEATURE_ID_0" not in gltf.primitives(0)[0]["attributes"]:
        raise DamagedFile("vertices have no part")
    positions, faces = gltf.mesh_arrays()
    ids = gltf.accessor(gltf.primitives(0)[0]["attributes"]["_FEATURE_ID_0"])
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
