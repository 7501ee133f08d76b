"""What is in a file: kind, size, solid, texture, place, as plain data for people and scripts."""

from __future__ import annotations

import itertools
import os
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from exporters.errors import DAMAGE, ExportError
from exporters.facts import file_sizes, solid_facts
from exporters.georeference import placement_of_tile
from exporters.gis.inspect import collection_facts, places_facts
from exporters.gltf.reader import Gltf, read_gltf
from exporters.solid import merged_by_position
from exporters.texture_files import texture_size
from exporters.tiles.check import read_tileset
from exporters.usd.process import usd_facts_apart
from exporters.validate import read_triangles
from georef.errors import PlacementError


def inspect(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Facts about a file or tileset, JSON-serialisable; what a format does not say is None.

    path : any kind that `exporters.validate.validate` takes
    returns : format, files (name → bytes), name, copyright, generator, vertices, triangles, bounds_m [low, high] in
        the frame of the file, size_m, watertight, solid, components, genus, volume_m3, texture_px [width, height],
        parts, observed (part → share that the drawing showed), placement (lon_deg, lat_deg, height_m, heading_deg and
        what else is recorded), lods, metadata

    Raises ExportError for what cannot be read.
    """
    path = Path(path)
    if not path.exists():
        raise ExportError(path, "is not there", "check the name")
    try:
        found = _inspect_any(path)
    except ExportError:
        raise
    except (PlacementError, *DAMAGE) as error:
        # Files from elsewhere are damaged in more ways than can be listed; all of them end here.
        reason = " ".join(str(error).split())[:120]
        raise ExportError(path, f"damaged ({type(error).__name__}: {reason})", "see fig2mesh validate") from error
    keys = ("format", "files", "name", "copyright", "generator", "vertices", "triangles", "bounds_m", "size_m")
    more = ("watertight", "solid", "components", "genus", "volume_m3", "texture_px", "parts", "observed")
    last = ("placement", "lods", "metadata")
    return {key: found.get(key) for key in (*keys, *more, *last)}


def _inspect_any(path: Path) -> dict[str, Any]:
    suffix = path.suffix.lower()
    if path.is_dir() or suffix == ".json":
        tileset = path / "tileset.json" if path.is_dir() else path
        return collection_facts(tileset) or _inspect_tileset(tileset)
    if suffix in (".czml", ".geojson"):
        return places_facts(path, _inspect_gltf)
    if suffix in (".glb", ".gltf"):
        return _inspect_gltf(path)
    if suffix in (".usda", ".usdc", ".usdz"):
        return usd_facts_apart(path)
    if suffix in (".ply", ".obj"):
        return _inspect_triangles(path)
    raise ExportError(path, f"cannot inspect suffix {suffix or 'none'}", "see exporters.write.FORMATS")


def _inspect_gltf(path: Path) -> dict[str, Any]:
    gltf = read_gltf(path)
    try:
        return _gltf_facts(gltf)
    except DAMAGE as error:
        raise ExportError(path, f"broken glTF ({error})", "see validate") from error


def _gltf_facts(gltf: Gltf) -> dict[str, Any]:
    asset = gltf.document.get("asset", {})
    extras = asset.get("extras", {})
    meshes = range(len(gltf.items("meshes")))
    solids = gltf.scene_solids()
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in solids)])
    vertices = np.concatenate([np.empty((0, 3), np.float32), *(vertices for vertices, _ in solids)])
    faces = [faces + start for (_, faces), start in zip(solids, starts, strict=False)]
    tables = gltf.document.get("extensions", {}).get("EXT_structural_metadata", {}).get("propertyTables", [])
    uris = [item["uri"] for kind in ("buffers", "images") for item in gltf.items(kind) if "uri" in item]
    beside = [gltf.path.parent / unquote(uri) for uri in uris if not uri.startswith("data:")]
    return {
        "format": "glTF 2.0 binary" if gltf.path.suffix.lower() == ".glb" else "glTF 2.0",
        "files": file_sizes(gltf.path, *beside),
        "name": next((node["name"] for node in gltf.items("nodes") if "name" in node), None),
        "copyright": asset.get("copyright"),
        "generator": asset.get("generator"),
        "vertices": sum(
            len(gltf.mesh_arrays(mesh, primitive)[0])
            for mesh in meshes
            for primitive in range(len(gltf.items("meshes")[mesh]["primitives"]))
        ),
        **solid_facts(vertices, np.concatenate([np.empty((0, 3), np.int64), *faces])),
        "texture_px": texture_size(gltf.image(0)) if gltf.items("images") else None,
        "parts": _part_names(gltf, tables[0]) if tables else None,
        "observed": _observed(gltf, tables[0]) if tables else None,
        "placement": extras.get("georeference"),
        "metadata": extras.get("metadata"),
    }


def _part_names(gltf: Gltf, table: dict[str, Any]) -> list[str]:
    column = table["properties"]["name"]
    text, offsets = gltf.view(column["values"]), np.frombuffer(gltf.view(column["stringOffsets"]), "<u4")
    return [text[begin:end].decode() for begin, end in itertools.pairwise(offsets.tolist())]


def _observed(gltf: Gltf, table: dict[str, Any]) -> dict[str, float] | None:
    """Share of each part that the drawing itself showed; None in files without."""
    column = table["properties"].get("observedShare")
    if column is None:
        return None
    shares = np.frombuffer(gltf.view(column["values"]), "<f4")
    return {name: round(float(share), 3) for name, share in zip(_part_names(gltf, table), shares, strict=True)}


def _inspect_tileset(path: Path) -> dict[str, Any]:
    document = read_tileset(path)
    lods: list[dict[str, Any]] = []
    tile: dict[str, Any] | None = document["root"]
    while tile is not None:
        uri = tile.get("content", {}).get("uri")
        if uri and uri.lower().endswith((".glb", ".gltf")):
            lods.append({"uri": uri, "geometric_error_m": tile["geometricError"]})
        children = tile.get("children", [])
        tile = children[0] if len(children) == 1 else None
    files = file_sizes(path, *(path.parent / unquote(lod["uri"]) for lod in lods))
    facts: dict[str, Any] = {"format": "3D Tiles " + str(document.get("asset", {}).get("version")), "files": files}
    if not lods:
        return facts | {"lods": [], "generator": document.get("asset", {}).get("generator")}
    for lod in lods:
        inside = _inspect_gltf(path.parent / unquote(lod["uri"]))
        lod |= {key: inside[key] for key in ("vertices", "triangles", "texture_px", "solid")}
    placement = None
    if "transform" in document["root"]:
        recorded = document.get("asset", {}).get("extras", {}).get("georeference", {})
        try:
            # What the transform does is the truth; the record beside it adds what no matrix can hold.
            placement = recorded | placement_of_tile(document["root"]["transform"])
        except ValueError as error:
            raise ExportError(path, f"broken transform ({error})", "see validate") from error
    # The chain runs from coarse to fine: `inside` is the finest.
    return inside | facts | {"placement": placement, "lods": lods[::-1]}


def _inspect_triangles(path: Path) -> dict[str, Any]:
    mesh = read_triangles(path)
    vertices, faces = merged_by_position(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    image = getattr(getattr(mesh.visual, "material", None), "image", None)
    ply = path.suffix.lower() == ".ply"
    beside = [] if ply else [path.with_suffix(".mtl"), path.with_name(f"{path.stem}_texture.png")]
    return {
        "format": "Stanford PLY" if ply else "Wavefront OBJ",
        "files": file_sizes(path, *beside),
        "name": path.stem,
        "vertices": len(mesh.vertices),
        **solid_facts(vertices, faces),
        "texture_px": list(image.size) if image is not None else None,
        **_comments(path),
    }


def _comments(path: Path) -> dict[str, Any]:
    """Credits and place from the comments that our PLY and OBJ writers put at the top."""
    facts: dict[str, Any] = {}
    place: dict[str, Any] = {}
    with path.open("rb") as stream:
        for raw in stream:
            word, _, rest = raw.decode("ascii", "replace").strip().partition(" ")
            if word not in ("ply", "format", "comment", "#"):
                break
            key, _, value = rest.replace(": ", " ", 1).partition(" ")
            if key in ("copyright", "generator"):
                facts[key] = value
            elif key in ("lon_deg", "lat_deg", "height_m", "heading_deg", "figure_height_m"):
                with suppress(ValueError):
                    place[key] = float(value)
            elif key in ("crs", "height_datum"):
                place[key] = value
    return facts | {"placement": place or None}
