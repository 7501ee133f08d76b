"""STAC: a static catalogue of figures for archives, a collection with one item per figure next to its files.

https://github.com/radiantearth/stac-spec/tree/v1.1.0
https://github.com/stac-extensions/file
"""

from __future__ import annotations

import json
import posixpath
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from exporters.atomic_file import atomic_text, write_text
from exporters.file_digest import sha256_of
from exporters.gis.geojson import OWN_PROPERTIES, feature, free_names
from exporters.gis.stac_extent import Extent
from exporters.gis.time_span import stamp, time_span
from exporters.media_types import media_type
from exporters.placed_figure import PlacedFigure

STAC_VERSION = "1.1.0"

FILE_EXTENSION = "https://stac-extensions.github.io/file/v2.1.0/schema.json"

COLLECTION_FILE, ITEM_SUFFIX = "collection.json", ".stac.json"

# fmt: off
RESERVED = (
    "bands", "constellation", "created", "data_type", "datetime", "description", "end_datetime", "gsd", "instruments",
    "keywords", "license", "mission", "nodata", "platform", "providers", "roles", "start_datetime", "statistics",
    "title", "unit", "updated",
)
# fmt: on
"""Properties with a defined meaning and format in STAC's common metadata, which a user's column may not follow."""

SHA2_256 = "1220"
"""Prefix of a multihash: function 0x12, digest of 0x20 bytes; https://github.com/multiformats/multicodec."""


@dataclass(frozen=True, slots=True)
class StacFile:
    """A file of a catalogue.

    path : relative to the folder of the collection, with slashes
    size : bytes
    sha256 : hexadecimal digest
    roles : of the asset; if empty, by the suffix, see `exporters.media_types`
    """

    path: str
    size: int
    sha256: str
    roles: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class StacItem:
    """A figure of a catalogue.

    figure : its record with place and attributes
    id : unique, and the name of its folder in that of the collection
    files : all files of the figure
    datetime : date of the drawing or of its picture, see `exporters.gis.time_span.time_span`
    """

    figure: PlacedFigure
    id: str
    files: tuple[StacFile, ...]
    datetime: str

    def __post_init__(self) -> None:
        if self.id in ("", ".", "..") or re.search(r"[/\\]", self.id):
            raise ValueError(f"{self.id!r} is not a folder name")

    @property
    def path(self) -> str:
        """Path of the item's own file, relative to the folder of the collection."""
        return f"{self.id}/{self.id}{ITEM_SUFFIX}"


def stac_file(folder: Path, path: str, roles: tuple[str, ...] = ()) -> StacFile:
    """Return the record of an existing file; its bytes are read once. Arguments as in `StacFile`."""
    file = folder / path
    return StacFile(path, file.stat().st_size, sha256_of(file), roles)


def item_document(item: StacItem, collection: str) -> dict[str, Any]:
    """Return a figure as a STAC item: a Point, attributes, and every file as an asset.

    collection : id of the collection that it belongs to

    Properties are those of `exporters.gis.geojson.feature` without the model, which is an asset, and without unknown
    values. A column of the user's table with a name that is reserved in STAC is renamed, as `title_2`. A period of time
    becomes `start_datetime` and `end_datetime`, and `datetime` null.

    Raises ExportError, naming the item, for an invalid date.
    """
    found = feature(item.figure, None)
    point = found["geometry"]["coordinates"]
    span = time_span(item.datetime, f"date of {item.id}")
    moment = span.start == span.end
    times: dict[str, str | None] = {"datetime": stamp(span.start) if moment else None}
    if not moment:
        times |= {"start_datetime": stamp(span.start), "end_datetime": stamp(span.end)}
    known = {name: found["properties"][name] for name in OWN_PROPERTIES if name != "model"}
    attributes = item.figure.attributes
    names = free_names(tuple(name for name, _ in attributes), (*OWN_PROPERTIES, *RESERVED))
    known |= {name: value for name, (_, value) in zip(names, attributes, strict=True)}
    folder = posixpath.dirname(item.path)
    up = posixpath.relpath(COLLECTION_FILE, folder)
    return {
        "type": "Feature",
        "stac_version": STAC_VERSION,
        "stac_extensions": [FILE_EXTENSION],
        "id": item.id,
        "geometry": found["geometry"],
        "bbox": [*point, *point],
        "properties": {
            **times,
            "title": item.figure.name or item.id,
            **{name: value for name, value in known.items() if value is not None},
        },
        "links": [{"rel": rel, "href": up, "type": "application/json"} for rel in ("root", "parent", "collection")],
        "assets": _assets(item.files, folder, item.id),
        "collection": collection,
    }


def write_stac(
    items: Iterable[StacItem],
    folder: Path,
    *,
    id: str,
    title: str = "",
    description: str = "Drawn figures of pictorial maps as textured, georeferenced 3D models.",
    license: str = "other",
    license_link: str | None = None,
    keywords: tuple[str, ...] = (),
    files: Iterable[StacFile] = (),
) -> int:
    """Write `collection.json`, and for each figure `<id>/<id>.stac.json`, into a folder; returns the number of items.

    items : read once, so they may exceed memory; the collection links to them in order
    folder : base of the paths of files; folders of items are created if missing
    id, title, description, keywords : of the collection
    license : SPDX identifier, or "other" with `license_link`, address of its text
    files : of the collection as a whole, such as `tileset.json` and `index.gpkg`

    Files of the same names are replaced, each atomically. The same figures give the same bytes. References are
    relative, so the folder may be moved and served unchanged. They are IRIs, as in STAC: letters of all scripts remain,
    other characters are percent-encoded. `fig2mesh` uses names without such characters, because PySTAC takes
    references between local files for plain paths.

    Raises ExportError for an invalid date, ValueError for a license that is not an identifier, and OSError where a
    file cannot be written.
    """
    if not re.fullmatch(r"[\w.+-]+", license):
        raise ValueError(f"license {license!r} is not an identifier")
    head = {
        "type": "Collection",
        "stac_version": STAC_VERSION,
        "stac_extensions": [FILE_EXTENSION],
        "id": id,
        **({"title": title} if title else {}),
        "description": description,
        **({"keywords": list(keywords)} if keywords else {}),
        "license": license,
        "assets": _assets(files, "", ""),
    }
    links = [{"rel": "root", "href": f"./{COLLECTION_FILE}", "type": "application/json"}]
    if license_link is not None:
        links.append({"rel": "license", "href": license_link})
    extent = Extent()
    with atomic_text(folder / COLLECTION_FILE) as stream:
        stream.write(_text(head)[:-1] + ',"links":[\n' + ",\n".join(map(_text, links)))
        for item in items:
            document = item_document(item, id)
            extent.add(document["geometry"]["coordinates"], time_span(item.datetime))
            (folder / item.path).parent.mkdir(parents=True, exist_ok=True)
            write_text(folder / item.path, json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1) + "\n")
            link = {"rel": "item", "href": _href(item.path, ""), "type": "application/geo+json"}
            stream.write(",\n" + _text(link | {"title": document["properties"]["title"]}))
        stream.write('\n],"extent":' + _text(extent.document()) + "}\n")
    return extent.count


def _assets(files: Iterable[StacFile], folder: str, stem: str) -> dict[str, dict[str, Any]]:
    """Return assets by the endings of their names, such as `glb` and `lod1.glb`, which are the same for all figures.

    folder : of the document, relative to that of the collection; stem : usual beginning of the file names
    """
    assets: dict[str, dict[str, Any]] = {}
    for file in files:
        name = posixpath.relpath(file.path, folder or ".")
        key = re.sub(rf"^{re.escape(stem)}[._-]+(?=.)", "", name) if stem else name
        while key in assets:
            key += "_"
        kind = media_type(file.path)
        assets[key] = {
            "href": _href(file.path, folder),
            "type": kind.type,
            "title": f"{posixpath.basename(file.path)} ({kind.title})",
            "roles": list(file.roles) or [kind.role],
            "file:size": file.size,
            "file:checksum": SHA2_256 + file.sha256.lower(),
        }
    return assets


def _href(path: str, folder: str) -> str:
    """Return a path as an IRI reference from a folder, both relative to the collection's; it begins with ./ or ../"""
    relative = posixpath.relpath(path, folder or ".")
    text = re.sub(r"[\x00-\x7f]+", lambda match: quote(match[0]), relative)
    return text if text.startswith("../") else f"./{text}"


def _text(document: dict[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
