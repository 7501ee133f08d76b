"""STAC: a static catalogue of figures, a collection with an item beside the files of each, for archives.

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
"""Properties to which STAC's common metadata gives a meaning and a form that a user's column need not have."""

SHA2_256 = "1220"
"""Head of a multihash: function 0x12, digest of 0x20 bytes; https://github.com/multiformats/multicodec."""


@dataclass(frozen=True, slots=True)
class StacFile:
    """A file of a catalogue.

    path : seen from the folder of the collection, with slashes
    size : bytes
    sha256 : hexadecimal digest
    roles : what it is for; without any, by the end of its name, see `exporters.media_types`
    """

    path: str
    size: int
    sha256: str
    roles: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class StacItem:
    """A figure of a catalogue.

    figure : its place and what is said of it
    id : unique, and the name of its folder in that of the collection
    files : everything that was made of it
    datetime : when it was drawn or its picture made, see `exporters.gis.time_span.time_span`
    """

    figure: PlacedFigure
    id: str
    files: tuple[StacFile, ...]
    datetime: str

    def __post_init__(self) -> None:
        if self.id in ("", ".", "..") or re.search(r"[/\\]", self.id):
            raise ValueError(f"{self.id!r} is no name of a folder")

    @property
    def path(self) -> str:
        """Of the item's own file, seen from the folder of the collection."""
        return f"{self.id}/{self.id}{ITEM_SUFFIX}"


def stac_file(folder: Path, path: str, roles: tuple[str, ...] = ()) -> StacFile:
    """The record of a file that is there; its bytes are read once. Arguments as in `StacFile`."""
    file = folder / path
    return StacFile(path, file.stat().st_size, sha256_of(file), roles)


def item_document(item: StacItem, collection: str) -> dict[str, Any]:
    """A figure as a STAC item: a Point, attributes, and every file as an asset.

    collection : id of the collection that it belongs to

    Properties are those of `exporters.gis.geojson.feature` without the model, which is an asset, and without what is
    unknown. A column of the user's table with a name that STAC gives a meaning to gets another, as `title_2`. A date
    that is no moment becomes `start_datetime` and `end_datetime`, and `datetime` null.

    Raises ExportError, naming the item, for a date that is none.
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

    items : read once, so they may be more than memory holds; the collection links to them in their order
    folder : where the paths of files are seen from; folders of items are made if they are not there
    id, title, description, keywords : of the collection
    license : SPDX identifier, or "other" with `license_link`, address of its text
    files : of the collection as a whole, such as `tileset.json` and `index.gpkg`

    Files of the same names are replaced, each whole or not at all. The same figures give the same bytes. References
    are relative, so the folder may be moved and served as it is. They are IRIs, as STAC has it: letters of all scripts
    stand as they are, other characters are percent-encoded. `fig2mesh` gives names without such characters, because
    PySTAC takes references between files on a disk for plain paths.

    Raises ExportError for a date that is none, ValueError for a license that is no identifier, and OSError where the
    disk refuses.
    """
    if not re.fullmatch(r"[\w.+-]+", license):
        raise ValueError(f"license {license!r} is no identifier")
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
    """Assets by the ends of their names, as `glb` and `lod1.glb`, which are the same for all figures.

    folder : of the document, seen from the collection's; stem : what names of files usually begin with
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
    """A path as an IRI reference from a folder, both seen from the collection's; it begins with ./ or ../"""
    relative = posixpath.relpath(path, folder or ".")
    text = re.sub(r"[\x00-\x7f]+", lambda match: quote(match[0]), relative)
    return text if text.startswith("../") else f"./{text}"


def _text(document: dict[str, Any]) -> str:
    return json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
