"""Facts about tilesets of one figure with its levels of detail, or of many."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import unquote

from exporters.errors import ExportError
from exporters.facts import file_sizes
from exporters.georeference import placement_of_tile
from exporters.gltf.inspect import gltf_facts
from exporters.tiles.check import read_tileset
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_shape import NUMBER, Required, check_shape


def tileset_facts(path: Path) -> dict[str, Any]:
    """Return facts about a tileset.json; see `exporters.inspect.inspect`."""
    document = read_tileset(path)
    if (collection := _collection_facts(document, path)) is not None:
        return collection
    lods: list[dict[str, Any]] = []
    tile: dict[str, Any] | None = document["root"]
    while tile is not None:
        uri = tile.get("content", {}).get("uri")
        if uri and uri.lower().endswith((".glb", ".gltf")):
            check_shape(tile, {"geometricError": Required(NUMBER)}, f"tile of {uri[:40]}")
            lods.append({"uri": uri, "geometric_error_m": tile["geometricError"]})
        children = tile.get("children", [])
        tile = children[0] if len(children) == 1 else None
    files = file_sizes(path, *(path.parent / unquote(lod["uri"]) for lod in lods))
    facts: dict[str, Any] = {"format": "3D Tiles " + str(document.get("asset", {}).get("version")), "files": files}
    if not lods:
        return facts | {"lods": [], "generator": document.get("asset", {}).get("generator")}
    for lod in lods:
        inside = gltf_facts(path.parent / unquote(lod["uri"]))
        lod |= {key: inside[key] for key in ("vertices", "triangles", "texture_px", "solid", "outline")}
    placement = None
    if "transform" in document["root"]:
        extras = document.get("asset", {}).get("extras")
        recorded = extras.get("georeference") if isinstance(extras, dict) else None
        try:
            # The transform takes precedence; the record adds values that a matrix does not contain.
            place = placement_of_tile(document["root"]["transform"])
        except DamagedFile as error:
            raise ExportError(path, f"invalid transform ({error})", "run fig2mesh validate") from error
        placement = (recorded if isinstance(recorded, dict) else {}) | place
    # The chain runs from coarse to fine: `inside` is the finest.
    return inside | facts | {"placement": placement, "lods": lods[::-1]}


def _collection_facts(document: dict[str, Any], path: Path) -> dict[str, Any] | None:
    """Return facts about a tileset of many figures by fig2mesh; None for other tilesets."""
    asset, root = document.get("asset", {}), document["root"]
    if asset.get("generator") != "fig2mesh" or "transform" in root:
        return None
    metadata, extras = document.get("metadata"), document.get("extras")
    recorded = (metadata.get("properties") if isinstance(metadata, dict) else None) or extras
    further = sorted(path.parent.glob(f"{path.stem}_*.json"))
    return {
        "format": "3D Tiles " + str(asset.get("version")),
        "files": {file.name: file.stat().st_size for file in (path, *further)},
        "generator": asset["generator"],
        "lods": [],
        "metadata": {"figures": recorded.get("figures") if isinstance(recorded, dict) else None},
    }
