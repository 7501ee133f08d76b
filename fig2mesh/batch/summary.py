"""Files for a whole collection: manifest, tileset, indexes and catalogue, made from the records alone."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from fig2mesh.batch.ledger import WORK, Ledger
from fig2mesh.batch.row_files import digest_of, files_unchanged
from fig2mesh.batch.task import RowTask
from fig2mesh.batch.tasks import read_spool
from fig2mesh.system.processes import run_apart
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json

MANIFEST, TILESET, GEOPACKAGE, LICENSE = "manifest.jsonl", "tileset.json", "index.gpkg", "license.txt"

NO_LICENSE: Final = """The licence of these figures is not stated.
Their attribution, where there is one, is the property "credit" of each item and figure.
"""

REPORTED: Final = ("inputs", "outputs", "measures", "placement", "map", "score", "doubts", "notes")
"""Entries that the manifest copies from the record of a finished row."""


@dataclass(frozen=True)
class Collection:
    """A collection to be summarised.

    folder : of the outputs; spool : of the tasks; columns : attributes of the user for the indexes, in order
    title : of the collection; visible_from_m : of the tileset, None to derive it from the height of each figure
    license : SPDX identifier of the licence, or address of its text; None if it is not known
    """

    folder: Path
    spool: Path
    columns: tuple[str, ...]
    title: str
    visible_from_m: float | None
    license: str | None = None


@dataclass(frozen=True)
class Summary:
    """Result of `summarise`.

    figures : number of figures with a place; tallest_m : height of the tallest of them, 0 without any
    unplaced : number of figures without a place; failed : number of rows
    written : files, empty if all were up to date; left : names of figures of an earlier collection
    """

    figures: int
    tallest_m: float
    unplaced: int
    failed: int
    written: tuple[str, ...]
    left: tuple[str, ...]


def summarise_apart(collection: Collection) -> Summary:
    """Run `summarise` in a separate process, so that its memory (about 5 kB per figure) is freed afterwards."""
    return run_apart(summarise, collection)


def summarise(collection: Collection) -> Summary:
    """Write the files for the whole collection, all or none, unless they are up to date.

    Raises ExportError if writing fails.
    """
    from exporters.placed_figure import PlacedFigure

    folder, ledger = collection.folder, Ledger(collection.folder)
    left = ledger.names()
    digest = hashlib.sha256(
        json.dumps([collection.columns, collection.title, collection.visible_from_m, collection.license]).encode()
    )
    figures: list[PlacedFigure] = []
    dates: list[str] = []
    failed = unplaced = 0
    for task, record in _records(collection):
        left.discard(task.name)
        digest.update(json.dumps([_line(task, record), record.get("figure"), record.get("date")]).encode())
        if record["status"] != "done":
            failed += 1
        elif record.get("figure") is None:
            unplaced += 1
        else:
            figures.append(_figure(record["figure"], collection.columns))
            dates.append(record["date"])
    tallest_m = max((figure.placement.figure_height_m for figure in figures), default=0.0)
    counts = (len(figures), tallest_m, unplaced, failed)
    before = _before(folder)
    if before["digest"] == digest.hexdigest() and files_unchanged(folder, before["files"]):
        return Summary(*counts, (), tuple(sorted(left)))
    from exporters.atomic_file import write_text, write_whole

    def fill(stage: Path) -> None:
        _fill(stage, collection, figures, dates, failed)

    outdated = [name for name in before["files"] if not Path(name).is_absolute() and ".." not in Path(name).parts]
    files = write_whole(folder, folder / MANIFEST, fill, overwrite=True, outdated=outdated)
    names = [file.relative_to(folder).as_posix() for file in files]
    own = {name: digest_of(folder / name) for name in names}
    state = {"digest": digest.hexdigest(), "files": own}
    write_text(_state_path(folder), json.dumps(state))
    return Summary(*counts, tuple(names), tuple(sorted(left)))


def _fill(stage: Path, collection: Collection, figures: Sequence[Any], dates: Sequence[str], failed: int) -> None:
    """Write all files into an empty staging folder."""
    from exporters.file_names import safe_name
    from exporters.gis.geopackage import write_geopackage
    from exporters.gis.stac import StacFile, StacItem, stac_file, write_stac
    from exporters.tiles.gather import write_tree

    with (stage / MANIFEST).open("w", encoding="utf-8", newline="\n") as stream:
        for task, record in _records(collection):
            stream.write(json.dumps(_line(task, record), ensure_ascii=False, allow_nan=False) + "\n")
    write_geopackage(figures, stage / GEOPACKAGE, failed=_failures(collection) if failed else None)
    if not figures:
        return
    write_tree(list(figures), stage, visible_from_m=collection.visible_from_m, name=TILESET)

    def items() -> Iterator[StacItem]:
        placed = zip(figures, dates, strict=True)
        for task, record in _records(collection):
            if record["status"] == "done" and record.get("figure") is not None:
                figure, date = next(placed)
                files = [
                    StacFile(name, record["sizes"][name], sha256) for name, sha256 in sorted(record["outputs"].items())
                ]
                yield StacItem(figure, task.name, tuple(files), date)

    over = [stac_file(stage, name) for name in (TILESET, "index.geojson", GEOPACKAGE)]
    identifier = safe_name(collection.title, "-").strip("-") or "figures"
    license, link = _license(stage, collection.license)
    write_stac(items(), stage, id=identifier, title=collection.title, files=over, license=license, license_link=link)


def _license(stage: Path, license: str | None) -> tuple[str, str | None]:
    """Licence of the catalogue, and the link that STAC asks for where it has no SPDX identifier."""
    if license is not None:
        return ("other", license) if ":" in license else (license, None)
    (stage / LICENSE).write_text(NO_LICENSE, encoding="utf-8", newline="\n")
    return "other", f"./{LICENSE}"


def _records(collection: Collection) -> Iterator[tuple[RowTask, dict[str, Any]]]:
    ledger = Ledger(collection.folder)
    for task in read_spool(collection.spool):
        record = ledger.read(task.name) or {}
        if record.get("status") not in ("done", "failed"):
            record = {"status": "failed", "error": "its record is damaged; run the same command again"}
        yield task, record


def _failures(collection: Collection) -> Iterable[tuple[int, str, str]]:
    for task, record in _records(collection):
        if record["status"] == "failed":
            yield task.number, task.name, str(record.get("error"))


def _line(task: RowTask, record: dict[str, Any]) -> dict[str, Any]:
    """A row of the manifest."""
    facts = {"row": task.number, "where": task.where, "name": task.name, "title": task.title}
    done = record["status"] == "done"
    return {
        **facts,
        "status": record["status"],
        "error": record.get("error"),
        "seconds": record.get("seconds", 0.0),
        **{name: record.get(name) if done else None for name in REPORTED},
    }


def _figure(facts: dict[str, Any], columns: tuple[str, ...]) -> Any:
    from exporters.placed_figure import PlacedFigure
    from georef.placement import GeoPlacement

    known = dict(facts["attributes"])
    tuples = {name: tuple(facts[name]) for name in ("low", "high", "contents", "errors", "parts", "shares")}
    attributes = tuple((column, known.get(column)) for column in columns)
    placement = GeoPlacement(**facts["placement"])
    return PlacedFigure(**{**facts, **tuples, "placement": placement, "attributes": attributes})


def _state_path(folder: Path) -> Path:
    return folder / WORK / "summary.json"


def _before(folder: Path) -> dict[str, Any]:
    """Files that the last run wrote here, and their digest; empty where that is not known."""
    with suppress(OSError, DamagedFile):
        found = parse_json(_state_path(folder).read_bytes())
        if isinstance(found, dict) and isinstance(found.get("files"), dict):
            return {"digest": found.get("digest"), "files": found["files"]}
    return {"digest": None, "files": {}}
