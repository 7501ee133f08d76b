"""What is in CZML, GeoJSON and tilesets of many figures, for `exporters.inspect`."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import unquote

from exporters.errors import ExportError
from exporters.tiles.check import read_tileset
from georef.untrusted.json_file import is_there, read_json

FORMATS = {".czml": "CZML", ".geojson": "GeoJSON"}


def models_of(path: Path) -> tuple[int, list[Path]]:
    """How many figures a CZML or GeoJSON file has, and the model files beside it that they name.

    Raises ExportError for what is no JSON.
    """
    document = read_json(path, "write it again", ExportError)
    if path.suffix.lower() == ".czml":
        named = [packet["model"].get("gltf") for packet in document if "model" in packet]
    else:
        features = document["features"] if document["type"] == "FeatureCollection" else [document]
        named = [(feature.get("properties") or {}).get("model") for feature in features]
    uris = [uri for uri in named if isinstance(uri, str) and "://" not in uri]
    return len(named), [path.parent / unquote(uri) for uri in uris]


def places_facts(path: Path, gltf_facts: Any) -> dict[str, Any]:
    """Facts about a CZML or GeoJSON file: those of its model where it has one only, else the number of figures.

    gltf_facts : makes the facts of a .glb
    """
    count, models = models_of(path)
    own = {"format": FORMATS[path.suffix.lower()], "files": {path.name: path.stat().st_size}}
    if count != 1 or not models or not is_there(models[0]):
        return own | {"metadata": {"figures": count}}
    facts: dict[str, Any] = gltf_facts(models[0])
    return facts | own | {"files": own["files"] | facts["files"]}


def collection_facts(path: Path) -> dict[str, Any] | None:
    """Facts about a tileset of many figures that fig2mesh wrote; None for other tilesets."""
    document = read_tileset(path)
    asset, root = document.get("asset", {}), document["root"]
    if asset.get("generator") != "fig2mesh" or "transform" in root:
        return None
    said = document.get("metadata", {}).get("properties") or document.get("extras") or {}
    further = sorted(path.parent.glob(f"{path.stem}_*.json"))
    return {
        "format": "3D Tiles " + str(asset.get("version")),
        "files": {file.name: file.stat().st_size for file in (path, *further)},
        "generator": asset["generator"],
        "lods": [],
        "metadata": {"figures": said.get("figures")},
    }
