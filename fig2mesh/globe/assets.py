"""Files shown on a globe: their kinds, dependencies and metadata.

https://docs.ogc.org/cs/22-025r4/22-025r4.html (tileset.json)
https://github.com/AnalyticalGraphicsInc/czml-writer/wiki/CZML-Guide
https://www.rfc-editor.org/rfc/rfc7946 (GeoJSON)
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal
from urllib.parse import SplitResult, unquote, urlsplit

from exporters.georeference import placement_of_record
from exporters.gltf.reader import Gltf, read_gltf
from exporters.tiles.check import TILESET
from fig2mesh.errors import InputError
from georef.geodesy import cesium_entity_heading_deg
from georef.untrusted.damage import DamagedFile, decoding
from georef.untrusted.json_file import is_plain_file, read_json
from georef.untrusted.json_shape import Required, check_shape

Kind = Literal["model", "tileset", "czml", "geojson"]

# fmt: off
SUFFIXES: dict[str, Kind] = {
    ".glb": "model", ".gltf": "model", ".json": "tileset", ".czml": "czml", ".geojson": "geojson",
}
# fmt: on


@dataclass(frozen=True)
class GlobeAsset:
    """A file to be shown, and its dependencies.

    kind : type of data source in CesiumJS
    main : the file itself, relative to `folder`, as in a URL
    folder : base of the URLs in the files
    needs : other files, relative to `folder`
    facts : JSON-serialisable: name, credit, metadata, and for models the place and number of triangles
    """

    kind: Kind
    main: str
    folder: Path
    needs: tuple[str, ...] = ()
    facts: dict[str, Any] = field(default_factory=dict)

    @property
    def files(self) -> tuple[str, ...]:
        """All files, relative to `folder`."""
        return (self.main, *self.needs)


def find_assets(paths: tuple[Path, ...]) -> tuple[GlobeAsset, ...]:
    """Find the assets in files and folders.

    paths : .glb, .gltf, tileset.json, .czml or .geojson; or folders: their tileset.json, or else all models, CZML and
        GeoJSON files in them

    Raises InputError for files that are missing, of another kind, damaged or without a place on the earth.
    """
    return tuple(_read(path) for given in paths for path in _in_folder(given))


def _in_folder(path: Path) -> list[Path]:
    if not path.exists():
        raise InputError(path, "no such file", "check the path")
    if not path.is_dir():
        return [path]
    if (path / "tileset.json").is_file():
        return [path / "tileset.json"]
    found = sorted(p for p in path.iterdir() if p.suffix.lower() in SUFFIXES and p.suffix.lower() != ".json")
    if not found:
        raise InputError(path, "contains no tileset.json and no models", "give a folder of 3D Tiles, or a file")
    return found


def _read(path: Path) -> GlobeAsset:
    kind = SUFFIXES.get(path.suffix.lower())
    if kind is None:
        remedy = "give .glb, .gltf, tileset.json, .czml or .geojson"
        raise InputError(path, f"unknown suffix {path.suffix}" if path.suffix else "no suffix", remedy)
    try:
        found = {"model": _model, "tileset": _tileset, "czml": _czml, "geojson": _geojson}[kind](path)
        with decoding("metadata that is not valid JSON", ValueError, RecursionError):
            json.dumps(found.facts, allow_nan=False)
        return found
    except DamagedFile as error:
        raise InputError(path, f"damaged ({error})", "see fig2mesh validate") from error


def _model(path: Path) -> GlobeAsset:
    gltf = read_gltf(path)
    record = gltf.extras.get("georeference")
    if record is None:
        raise InputError(path, "has no place on the earth", "write it with --lonlat, or give 3D Tiles or CZML")
    place = placement_of_record(record)
    uris = [item["uri"] for kind in ("buffers", "images") for item in gltf.items(kind) if "uri" in item]
    outlines = gltf.outlines
    facts = {
        "name": path.stem,
        "credit": gltf.document.get("asset", {}).get("copyright", ""),
        "metadata": gltf.extras.get("metadata", {}),
        # CesiumJS rotates models so that they face east at heading 0.
        "place": record | {"entity_heading_deg": cesium_entity_heading_deg(place)},
        "triangles": sum(_triangles(gltf, mesh) for mesh, _ in gltf.instances() if mesh not in outlines),
    }
    return GlobeAsset("model", path.name, path.parent, _needed(path, uris), facts)


def _triangles(gltf: Gltf, mesh: int) -> int:
    count = 0
    for primitive in gltf.primitives(mesh):
        accessor = primitive.get("indices", primitive["attributes"].get("POSITION"))
        if accessor is not None and primitive.get("mode", 4) == 4:
            count += gltf.item("accessors", accessor)["count"] // 3
    return count


def _tileset(path: Path) -> GlobeAsset:
    document = _json(path)
    if not isinstance(document, dict) or "root" not in document or "asset" not in document:
        raise InputError(path, "not a tileset", "give a tileset.json of 3D Tiles, or .geojson, .czml, .glb")
    check_shape(document, {"asset": dict, "metadata": {"properties": dict}})
    needs, pending, folder = [], [(path, "")], path.parent
    visited = {path.resolve()}
    while pending:
        file, prefix = pending.pop()
        for uri in _contents(file):
            parts = _split(uri)
            relative = prefix + unquote(parts.path)
            target = folder / relative
            if parts.scheme or parts.netloc:
                raise InputError(file, f"its content {uri[:80]} is not a local file", "give a tileset with local files")
            _check_there(target, file)
            if target.resolve() in visited:
                continue
            visited.add(target.resolve())
            needs.append(relative)
            if target.suffix.lower() == ".json":
                pending.append((target, relative[: len(relative) - len(target.name)]))
            elif target.suffix.lower() == ".gltf":
                inside = read_gltf(target)
                uris = [i["uri"] for kind in ("buffers", "images") for i in inside.items(kind) if "uri" in i]
                above = relative[: len(relative) - len(target.name)]
                needs += [above + need for need in _needed(target, uris)]
    values = document.get("metadata", {}).get("properties", {})
    facts = {
        "name": str(values.get("name") or (path.parent.resolve().name if path.name == "tileset.json" else path.stem)),
        "credit": str(values.get("copyright", "") or document["asset"].get("copyright", "")),
        "metadata": {key: value for key, value in values.items() if key not in ("name", "copyright")},
    }
    return GlobeAsset("tileset", path.name, path.parent, tuple(needs), facts)


def _contents(path: Path) -> Iterator[str]:
    document = _json(path)
    check_shape(document, TILESET)
    pending: list[dict[str, Any]] = [document["root"]]
    while pending:
        tile = pending.pop()
        if "implicitTiling" in tile:
            raise InputError(path, "implicit tiling is not supported", "give a tileset with explicit tiles")
        for content in [tile["content"]] if "content" in tile else tile.get("contents", []):
            check_shape(content, {"url" if "uri" not in content else "uri": Required(str)}, "content")
            yield content["uri"] if "uri" in content else content["url"]  # url: 3D Tiles 0.0
        pending += tile.get("children", [])


def _czml(path: Path) -> GlobeAsset:
    packets = _json(path)
    check_shape(packets, [{"model": dict}])
    if not packets or packets[0].get("id") != "document":
        raise InputError(path, "not a CZML file", "give CZML whose first packet has the id document")
    uris = []
    for packet in packets[1:]:
        model = packet.get("model", {}).get("gltf")
        address = model.get("uri") if isinstance(model, dict) else model
        if isinstance(address, str):
            uris.append(address)
    facts: dict[str, Any] = {"name": str(packets[0].get("name") or path.stem), "credit": "", "metadata": {}}
    return GlobeAsset("czml", path.name, path.parent, tuple(dict.fromkeys(_needed(path, uris))), facts)


def _geojson(path: Path) -> GlobeAsset:
    document = _json(path)
    if not isinstance(document, dict) or document.get("type") not in ("Feature", "FeatureCollection"):
        raise InputError(path, "not a GeoJSON file of features", "give a Feature or FeatureCollection")
    return GlobeAsset("geojson", path.name, path.parent, (), {"name": path.stem, "credit": "", "metadata": {}})


def _json(path: Path) -> Any:
    return read_json(path, "write it again")


def _needed(path: Path, uris: list[str]) -> tuple[str, ...]:
    """Files referenced by URLs in `path`, relative to it; data URLs need none."""
    found = []
    for uri in uris:
        parts = _split(uri)
        if parts.scheme == "data":
            continue
        if parts.scheme or parts.netloc:
            raise InputError(path, f"needs {uri[:80]}, which is not a local file", "put the file next to it")
        relative = unquote(parts.path)
        _check_there(path.parent / relative, path)
        found.append(relative)
    return tuple(found)


def _split(uri: str) -> SplitResult:
    with decoding("invalid URL", ValueError):
        return urlsplit(uri)


def _check_there(target: Path, by: Path) -> None:
    if not is_plain_file(target):
        raise InputError(by, f"needs the missing file {target.name}", "write it again, with all its files")
