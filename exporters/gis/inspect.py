"""Facts about CZML and GeoJSON files."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import unquote

from exporters.errors import ExportError
from exporters.gltf.inspect import gltf_facts
from georef.untrusted.json_file import is_plain_file, read_json
from georef.untrusted.json_shape import Nullable, Required, check_shape

FORMATS = {".czml": "CZML", ".geojson": "GeoJSON"}

_FEATURE = {"properties": Nullable(dict)}

FEATURES = _FEATURE | {"type": Required(str), "features": [_FEATURE]}
"""Shape of the used members of GeoJSON."""


def models_of(path: Path) -> tuple[int, list[Path]]:
    """Return the number of figures of a CZML or GeoJSON file, and the local model files that they name.

    Raises ExportError for files that are not JSON, DamagedFile for other JSON.
    """
    document = read_json(path, "write it again", ExportError)
    if path.suffix.lower() == ".czml":
        check_shape(document, [{"model": dict}])
        named = [packet["model"].get("gltf") for packet in document if "model" in packet]
    else:
        check_shape(document, FEATURES)
        features = document.get("features", []) if document["type"] == "FeatureCollection" else [document]
        named = [(feature.get("properties") or {}).get("model") for feature in features]
    uris = [uri for uri in named if isinstance(uri, str) and "://" not in uri]
    return len(named), [path.parent / unquote(uri) for uri in uris]


def places_facts(path: Path) -> dict[str, Any]:
    """Return facts about a CZML or GeoJSON file: those of its model if it has only one, else the number of figures."""
    count, models = models_of(path)
    own = {"format": FORMATS[path.suffix.lower()], "files": {path.name: path.stat().st_size}}
    if count != 1 or not models or not is_plain_file(models[0]):
        return own | {"metadata": {"figures": count}}
    facts = gltf_facts(models[0])
    return facts | own | {"files": own["files"] | facts["files"]}
