"""A folder with one tileset of many figures: their contents, the tree, a map of them, and entities for terrain."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from exporters.atomic_file import write_whole
from exporters.errors import ExportError
from exporters.figure_reader import describe, read_figures
from exporters.gis.czml import write_packets
from exporters.gis.geojson import write_collection
from exporters.placed_figure import PlacedFigure
from exporters.tiles.b3dm import b3dm_bytes
from exporters.tiles.check import read_tileset
from exporters.tiles.tileset import CONTENT_SUFFIXES, TilesVersion, check_distance, safe_name
from exporters.tiles.tree import tileset_documents
from exporters.write import OutputPath, check_file

CONTENT_FOLDER = "figures"
INDEX, ENTITIES = "index.geojson", "figures.czml"

MAX_NAME_CHARACTERS = 60
"""Characters of a file name; file systems allow 255 bytes, and a character takes up to four."""


@dataclass(frozen=True)
class WrittenTileset:
    """What `write_figures` has written.

    figures : their number; tallest_m : height of the tallest one; files : the tileset.json last
    """

    figures: int
    tallest_m: float
    files: tuple[Path, ...]


def write_figures(
    sources: Iterable[Path],
    folder: OutputPath,
    *,
    visible_from_m: float | None = None,
    version: TilesVersion = "1.1",
    overwrite: bool = False,
    link: bool = False,
) -> WrittenTileset:
    """Gather figures from files into one tileset, whole or not at all.

    sources : as for `exporters.figure_reader.read_figures`; a file that is met twice is one figure
    folder : the tileset's, or its tileset.json; missing folders are made, foreign files in it are kept
    visible_from_m, version : see `exporters.tiles.tileset.write_tileset`
    overwrite : replace what is there; what a tileset of figures that was there before named and this one does not, goes
    link : give contents of version 1.1 a second name (hard link) instead of copying them, where the disk allows it

    Content goes to `figures/`, under names of its own: two figures of the same name get different ones. Beside the
    tileset are `index.geojson` and, in version 1.1, `figures.czml`. The same figures in another order give the same
    bytes. Memory: about 5 kB per figure; no mesh is loaded whole but for the conversion to version 1.0.

    Raises ExportError where a source has no place or no figure, and where the disk refuses.
    """
    check_distance(visible_from_m)
    main = Path(folder) if Path(folder).name == "tileset.json" else Path(folder) / "tileset.json"
    check_file(folder, main, overwrite)
    pairs = _named(_in_order(_gather(sources)), CONTENT_SUFFIXES[version])
    figures = [figure for _, figure in pairs]
    if not overwrite:
        _check_free(main.parent, figures)

    def fill(stage: Path) -> None:
        (stage / CONTENT_FOLDER).mkdir()
        for source, figure in pairs:
            for origin, target in zip(source.contents, figure.contents, strict=True):
                _content(Path(origin), stage / target, version, link)
        write_tree(figures, stage, visible_from_m=visible_from_m, version=version)

    outdated = list(_own_files(main)) if overwrite and main.is_file() else []
    tallest_m = max(figure.placement.figure_height_m for figure in figures)
    return WrittenTileset(len(figures), tallest_m, write_whole(folder, main, fill, overwrite, outdated))


def write_tree(
    figures: list[PlacedFigure],
    folder: Path,
    *,
    visible_from_m: float | None = None,
    version: TilesVersion = "1.1",
    name: str = "tileset.json",
) -> None:
    """Write the tileset, and `index.geojson` and `figures.czml`, over figures whose contents are there already.

    figures : at least one, in an order that does not change from run to run; `contents` as seen from the folder
    folder : has to be there; files of the same names are replaced, so let `exporters.atomic_file.write_whole` give it
    name : of the tileset file to open
    """
    glb = version == "1.1"
    with (folder / INDEX).open("w", encoding="utf-8", newline="\n") as stream:
        write_collection(figures, stream, models=glb)
    if glb:
        with (folder / ENTITIES).open("w", encoding="utf-8", newline="\n") as stream:
            write_packets(figures, stream, "Figures")
    for file, document in tileset_documents(figures, visible_from_m, version, name):
        text = json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        (folder / file).write_bytes(text.encode() + b"\n")


def _gather(sources: Iterable[Path]) -> list[PlacedFigure]:
    found: dict[tuple[str, ...], PlacedFigure] = {}
    for source in sources:
        empty = True
        for figure in read_figures(source):
            found.setdefault(figure.contents, figure)
            empty = False
        if empty:
            raise ExportError(source, "holds no figure", "give .glb files, tilesets or folders of them")
    if not found:
        raise ExportError("tileset", "no figure is given", "name .glb files, tilesets or folders of them")
    return list(found.values())


def _in_order(figures: list[PlacedFigure]) -> list[PlacedFigure]:
    """In an order that depends on nothing but the figures themselves: name, place, what else is said, content."""
    ordered: list[PlacedFigure] = []
    by_text = sorted(((figure.name, describe(figure), figure) for figure in figures), key=lambda each: each[:2])
    for _, group in groupby(by_text, key=lambda each: each[:2]):
        alike = [figure for _, _, figure in group]
        ordered += sorted(alike, key=_digest) if len(alike) > 1 else alike
    return ordered


def _digest(figure: PlacedFigure) -> list[str]:
    return [hashlib.sha256(Path(content).read_bytes()).hexdigest() for content in figure.contents]


def _named(figures: list[PlacedFigure], suffix: str) -> list[tuple[PlacedFigure, PlacedFigure]]:
    """Each figure with a copy whose contents have the names that they are to have below the folder."""
    taken: set[str] = set()
    numbers: dict[str, int] = {}
    pairs = []
    for figure in figures:
        stem = safe_name(figure.name)[:MAX_NAME_CHARACTERS]
        while True:
            number = numbers[stem] = numbers.get(stem, 0) + 1
            base = stem if number == 1 else f"{stem}_{number}"
            names = [base + (f"_lod{lod}" if lod else "") + suffix for lod in range(len(figure.contents))]
            # Some file systems take Anna and anna for the same file.
            if not any(name.casefold() in taken for name in names):
                break
        taken.update(name.casefold() for name in names)
        pairs.append((figure, replace(figure, contents=tuple(f"{CONTENT_FOLDER}/{name}" for name in names))))
    return pairs


def _content(source: Path, target: Path, version: TilesVersion, link: bool) -> None:
    if version == "1.0":
        target.write_bytes(b3dm_bytes(source.read_bytes(), source))
        return
    if link:
        try:
            os.link(source, target)
            return
        except OSError:
            pass  # another disk, or one that has no links
    shutil.copyfile(source, target)


def _check_free(folder: Path, figures: list[PlacedFigure]) -> None:
    names = [INDEX, ENTITIES, *(content for figure in figures for content in figure.contents)]
    for name in names:
        if (folder / name).exists():
            raise ExportError(folder / name, "exists already", "use --overwrite or choose another folder")


def _own_files(main: Path) -> Iterator[str]:
    """Files beside an earlier tileset of figures, as seen from it, that it names and that are ours to take away."""
    try:
        document = read_tileset(main)
    except ExportError:
        return
    asset = document.get("asset")
    if not isinstance(asset, dict) or asset.get("generator") != "fig2mesh":
        return
    yield from (INDEX, ENTITIES)
    pending = [document["root"]]
    while pending:
        tile: dict[str, Any] = pending.pop()
        uri = unquote(str(tile.get("content", {}).get("uri", "")))
        pending += tile.get("children", [])
        place = Path(uri)
        inner = place.parts[:1] == (CONTENT_FOLDER,) and len(place.parts) == 2
        further = len(place.parts) == 1 and place.name.startswith(f"{main.stem}_") and place.suffix == ".json"
        if ".." in place.parts or not (inner or further):
            continue
        yield uri
        if further and (main.parent / place).is_file():
            pending.append(read_tileset(main.parent / place)["root"])
