"""Writer of a tileset of many figures: contents, tile tree, GeoJSON index, and CZML entities for terrain."""

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
from exporters.file_digest import sha256_of
from exporters.file_names import name_key, safe_name
from exporters.gis.czml import write_packets
from exporters.gis.geojson import write_collection
from exporters.placed_figure import PlacedFigure
from exporters.tiles.b3dm import b3dm_bytes
from exporters.tiles.check import read_tileset
from exporters.tiles.tileset import CONTENT_SUFFIXES, TilesVersion, check_distance
from exporters.tiles.tree import tileset_documents
from exporters.write import OutputPath, check_file
from georef.placement import GeoPlacement

CONTENT_FOLDER = "figures"
INDEX, ENTITIES = "index.geojson", "figures.czml"


@dataclass(frozen=True)
class WrittenTileset:
    """Result of `write_figures`.

    figures : their number; tallest_m : height of the tallest one; files : the tileset.json last
    notes : on figures that are there more than once, one line each
    """

    figures: int
    tallest_m: float
    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()


def write_figures(
    sources: Iterable[Path],
    folder: OutputPath,
    *,
    visible_from_m: float | None = None,
    version: TilesVersion = "1.1",
    overwrite: bool = False,
    link: bool = False,
) -> WrittenTileset:
    """Collect figures from files into one tileset, which is written atomically.

    sources : as for `exporters.figure_reader.read_figures`; duplicate files count once, and so does a figure that is
        there as .glb and as a tileset, of which the latter is kept
    folder : of the tileset, or its tileset.json; missing folders are created, unrelated files in it are kept
    visible_from_m, version : see `exporters.tiles.tileset.write_tileset`
    overwrite : replace existing files; files of an earlier tileset of figures there that are not replaced are removed
    link : hard-link contents of version 1.1 instead of copying them, where the file system allows it

    Content goes to `figures/`, under unique names. Next to the tileset are `index.geojson` and, in version 1.1,
    `figures.czml`. The same figures in another order give the same bytes. Memory: about 5 kB per figure; whole meshes
    are loaded only for the conversion to version 1.0.

    Raises ExportError where a source has no place or no figure, and where a file cannot be written.
    """
    check_distance(visible_from_m)
    main = Path(folder) if Path(folder).name == "tileset.json" else Path(folder) / "tileset.json"
    check_file(folder, main, overwrite)
    found, notes = without_copies(_gather(sources))
    pairs = _named(_in_order(found), CONTENT_SUFFIXES[version])
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
    files = write_whole(folder, main, fill, overwrite, outdated)
    return WrittenTileset(len(figures), tallest_m, files, notes)


def write_tree(
    figures: list[PlacedFigure],
    folder: Path,
    *,
    visible_from_m: float | None = None,
    version: TilesVersion = "1.1",
    name: str = "tileset.json",
) -> None:
    """Write the tileset, `index.geojson` and `figures.czml` for figures whose contents exist already.

    figures : at least one, in a reproducible order; `contents` relative to the folder
    folder : must exist; files of the same names are replaced, so use one from `exporters.atomic_file.write_whole`
    name : of the root tileset file
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
            raise ExportError(source, "contains no figure", "give .glb files, tilesets or folders of them")
    if not found:
        raise ExportError("tileset", "no figure given", "give .glb files, tilesets or folders of them")
    return list(found.values())


def without_copies(figures: list[PlacedFigure]) -> tuple[list[PlacedFigure], tuple[str, ...]]:
    """Figures without models that are there as tilesets too, and notes on these and on others of one name in one spot.

    A model is that of a tileset if name, place and content are those of its finest level.
    """
    spots: dict[tuple[str, GeoPlacement], list[PlacedFigure]] = {}
    for figure in figures:
        spots.setdefault((figure.name, figure.placement), []).append(figure)
    kept, notes = [], []
    for (name, _), alike in spots.items():
        alone = [figure for figure in alike if not _has_tileset(figure)] if len(alike) > 1 else []
        tiled = {sha256_of(Path(each.contents[0])): each for each in alike if alone and _has_tileset(each)}
        same = [(each, tiled.get(sha256_of(Path(each.contents[0])))) for each in alone if tiled]
        copies = [(each, tileset) for each, tileset in same if tileset is not None]
        for each, tileset in copies:
            notes.append(f"{each.contents[0]}: the same figure as {tileset.contents[0]}, {name}; left out")
        left = [figure for figure in alike if all(figure is not each for each, _ in copies)]
        kept += left
        if len(left) > 1:
            notes.append(f"{name}: {len(left)} figures of this name stand in one spot, and hide each other")
    return kept, tuple(notes)


def _has_tileset(figure: PlacedFigure) -> bool:
    return (Path(figure.contents[0]).parent / "tileset.json").is_file()


def _in_order(figures: list[PlacedFigure]) -> list[PlacedFigure]:
    """Sort figures independently of their input order: by name, then place and other facts, then content."""
    ordered: list[PlacedFigure] = []
    by_text = sorted(((figure.name, describe(figure), figure) for figure in figures), key=lambda each: each[:2])
    for _, group in groupby(by_text, key=lambda each: each[:2]):
        alike = [figure for _, _, figure in group]
        ordered += sorted(alike, key=_digest) if len(alike) > 1 else alike
    return ordered


def _digest(figure: PlacedFigure) -> list[str]:
    return [hashlib.sha256(Path(content).read_bytes()).hexdigest() for content in figure.contents]


def _named(figures: list[PlacedFigure], suffix: str) -> list[tuple[PlacedFigure, PlacedFigure]]:
    """Pair each figure with a copy whose contents have their new names in the folder."""
    taken: set[str] = set()
    numbers: dict[str, int] = {}
    pairs = []
    for figure in figures:
        stem = safe_name(figure.name)
        while True:
            number = numbers[stem] = numbers.get(stem, 0) + 1
            base = stem if number == 1 else f"{stem}_{number}"
            names = [base + (f"_lod{lod}" if lod else "") + suffix for lod in range(len(figure.contents))]
            if not any(name_key(name) in taken for name in names):
                break
        taken.update(map(name_key, names))
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
            pass  # another file system, or one without hard links
    shutil.copyfile(source, target)


def _check_free(folder: Path, figures: list[PlacedFigure]) -> None:
    names = [INDEX, ENTITIES, *(content for figure in figures for content in figure.contents)]
    for name in names:
        if (folder / name).exists():
            raise ExportError(folder / name, "already exists", "use --overwrite or choose another folder")


def _own_files(main: Path) -> Iterator[str]:
    """Files of an earlier tileset of figures by fig2mesh, relative to it, which may be removed."""
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
