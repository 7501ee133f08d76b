"""One figure of a collection, from its row to its files and its record; runs in workers, on this machine or others."""

from __future__ import annotations

import errno
import os
import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fig2mesh.batch.ledger import BEGUN, WORK, Ledger
from fig2mesh.batch.row_files import Roots, digest_of, input_files, inside, sheet_files
from fig2mesh.batch.row_options import RowOptions, options_of
from fig2mesh.batch.rows import Value
from fig2mesh.errors import FigureError, InputError, OutputError

if TYPE_CHECKING:
    from exporters.asset import Asset
    from exporters.placed_figure import Attributes
    from exporters.profiles import Profile
    from fig2mesh.place import Placed, PlaceRequest
    from georef.mapsheet import MapSheet

FORMATS = ("gltf", "usda", "usdc", "usdz", "ply", "obj", "czml", "geojson")
"""What a row may ask for besides .glb."""

FULL = (errno.ENOSPC, errno.EDQUOT)

LASTING = ("claimed", "files")
"""What a record says of the folder, whatever becomes of the row: whether a batch has begun it, files that are ours."""

Advance = Callable[[str], object]


@dataclass(frozen=True)
class Batch:
    """What all rows have in common.

    roots : where their files are; folder : of the outputs; defaults : options where a row has none, column → value;
    fresh : nothing that is kept is used; overwrite : folders of figures that no batch has begun may be replaced;
    unplaced : rows need no place
    """

    roots: Roots
    folder: Path
    defaults: dict[str, Any]
    fresh: bool = False
    overwrite: bool = False
    unplaced: bool = False


@dataclass(frozen=True)
class Task:
    """A row with its name. number, where, values, problem : as in `Row`; name : of its folder; title : for people."""

    number: int
    where: str
    name: str
    title: str
    values: dict[str, Value]
    problem: str | None = None


@dataclass(frozen=True)
class Outcome:
    """How a row went.

    status : done, or failed; error : one line, None if done; ours : the fault is ours, not the input's
    lost : its worker could not record it; full : the disk is; unchanged : nothing was to do
    seconds : of work; ran, reused : stages; counts : work done, by kind
    """

    number: int
    name: str
    status: str
    error: str | None = None
    ours: bool = False
    lost: bool = False
    full: bool = False
    unchanged: bool = False
    seconds: float = 0.0
    ran: tuple[str, ...] = ()
    reused: tuple[str, ...] = ()
    counts: dict[str, int] = field(default_factory=dict)


def check_row(batch: Batch, task: Task) -> Outcome:
    """Read everything that a row names, and say what is wrong; nothing is written, no network runs."""
    try:
        request = _Request(batch, task)
        request.check()
    except InputError as error:
        return Outcome(task.number, task.name, "failed", batch.roots.shorten(_line(error)))
    except Exception as error:
        return Outcome(task.number, task.name, "failed", _line(error), ours=True)
    return Outcome(task.number, task.name, "done")


def convert_row(batch: Batch, task: Task, advance: Advance = lambda stage: None) -> Outcome:
    """Convert a row, unless its outputs are there and of the same input; nothing that goes wrong is raised.

    advance : told the name of each stage before it runs
    """
    ledger = Ledger(batch.folder)
    start = time.perf_counter()
    before = ledger.read(task.name)
    record: dict[str, Any] = {"status": BEGUN, **{name: before[name] for name in LASTING if before and name in before}}
    fault: BaseException | None = None
    try:
        try:
            request = _Request(batch, task)
            record["key"] = request.key
            if not batch.fresh and before is not None and before.get("key") == request.key and request.stands(before):
                return _outcome(task, before, unchanged=True)
            _claim(batch, task, ledger, record)
            record |= request.convert(advance) | {"status": "done"}
        except InputError as error:
            fault = error
            # What the disk refuses may go well next time; what is wrong with the input will not.
            record |= {"status": "failed", "error": batch.roots.shorten(_line(error))}
            record["lasting"] = "key" in record and isinstance(error, FigureError)
        except Exception as error:
            fault = error
            found = f"internal error: {type(error).__name__}: {_line(error)}"
            record |= {"status": "failed", "error": batch.roots.shorten(found), "ours": True}
        record["full"] = fault is not None and _full(fault)
        record["seconds"] = round(time.perf_counter() - start, 3)
        ledger.write(task.name, record)
    except OSError as error:
        record |= {"status": "failed", "error": f"its record cannot be kept ({error.strerror})"}
        record["full"] = error.errno in FULL
    return _outcome(task, record)


def _outcome(task: Task, record: dict[str, Any], unchanged: bool = False) -> Outcome:
    work = record.get("work", {}) if not unchanged else {}
    return Outcome(
        number=task.number,
        name=task.name,
        status=record["status"],
        error=record.get("error"),
        ours=record.get("ours", False),
        full=record.get("full", False),
        unchanged=unchanged,
        seconds=record.get("seconds", 0.0),
        ran=tuple(work.get("ran", ())),
        reused=tuple(work.get("reused", ())),
        counts=work.get("counts", {}),
    )


def _full(error: BaseException | None) -> bool:
    """Whether an error comes from a disk without space."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in FULL:
            return True
        error = error.__cause__ or error.__context__
    return False


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:500] or type(error).__name__


def _claim(batch: Batch, task: Task, ledger: Ledger, record: dict[str, Any]) -> None:
    """Note that the folder of a figure is ours from now on, and clear away what a worker that died has left there."""
    target = batch.folder / task.name
    if target.is_symlink():
        raise OutputError(target, "is a link", "remove it, or name the figure otherwise")
    if not record.get("claimed") and os.path.lexists(target) and not batch.overwrite:
        raise OutputError(target, "exists, and is not of an earlier batch", "pass --overwrite or another -o DIR")
    record["claimed"] = True
    ledger.write(task.name, record)
    if target.is_dir():
        for stale in target.glob(".fig2mesh-*.tmp"):
            shutil.rmtree(stale, ignore_errors=True)


class _Request:
    """A row's request, read and checked as far as its words and its files go."""

    def __init__(self, batch: Batch, task: Task) -> None:
        from exporters.time_span import time_span
        from fig2mesh.batch.keys import key_of

        if task.problem is not None:
            finding, _, remedy = task.problem.partition("; ")
            raise InputError(task.where, finding, remedy or "correct the row")
        self.batch, self.task = batch, task
        self.options: RowOptions = options_of(task.values, batch.defaults, task.title)
        for each in self.options.formats:
            if each.lower().lstrip(".") not in FORMATS:
                raise InputError("column format", each[:40], f"choose from {', '.join(FORMATS)}; .glb is always made")
        trusted = frozenset(
            parameter
            for column, parameter in (("mask", "mask"), ("map", "map_sheet"), ("altitude_datum", "altitude_datum"))
            if column not in task.values
        )
        if self.options.date is not None:
            time_span(self.options.date, "column date")
        self.values = inside(self.options.values, batch.roots, trusted)
        self.place: PlaceRequest = self._place()
        files = input_files(self.values)
        self.inputs = {
            self._seen(file): digest_of(file) for name in sorted(files) for file in files[name]
        }  # fmt: skip
        texts = {name: self._seen(v) if isinstance(v, Path) else str(v) for name, v in self.values.items()}
        self.key = key_of(
            options=texts, formats=self.options.formats, date=self.options.date, inputs=self.inputs,
            attributes=self.options.attributes, title=task.title,
        )  # fmt: skip

    def _seen(self, file: Path) -> str:
        root = self.batch.roots.root
        return (file.relative_to(root) if file.is_relative_to(root) else file).as_posix()

    def _place(self) -> PlaceRequest:
        from fig2mesh.place import PlaceRequest

        fields = PlaceRequest.__dataclass_fields__
        request = PlaceRequest(**{name: self.values[name] for name in fields})
        if not (request.somewhere or self.batch.unplaced):
            raise InputError("columns lon, lat", "no place", "give lon and lat, or map, x and y; or pass --unplaced")
        return request

    def _sheet(self) -> MapSheet | None:
        from fig2mesh.place import open_map

        if self.place.map_sheet is None:
            return open_map(self.place)
        digests = tuple(digest_of(file) for file in sheet_files(self.place.map_sheet))
        return _open_map(replace(self.place, at=None), digests)

    @property
    def targets(self) -> tuple[str, ...]:
        """Outputs as seen from the folder of the figure."""
        name = self.task.name
        suffixes = dict.fromkeys(("glb", *(each.lower().lstrip(".") for each in self.options.formats)))
        return tuple(f"{name}.{suffix}" for suffix in suffixes)

    def stands(self, record: dict[str, Any]) -> bool:
        """Whether a record of the same key says how this ends: its outputs are there, or its failure is lasting."""
        if record["status"] == "failed":
            return bool(record.get("lasting"))
        if record["status"] != "done":
            return False
        try:
            return all(digest_of(self.batch.folder / name) == digest for name, digest in record["outputs"].items())
        except OSError:
            return False

    def profile(self) -> Profile:
        """What the client of the outputs takes. Raises InputError where it does not read them."""
        from exporters.profiles import profile_named
        from exporters.write import needs_place

        profile = profile_named(self.values["profile"])
        profile.check_tools()
        for target in self.targets:
            profile.check(target, Path(target).suffix.lower())
            if needs_place(target) and not self.place.somewhere:
                raise InputError("column format", f"{target} needs a place on earth", "give lon and lat")
        return profile

    def check(self) -> None:
        """Read the figure's files, as far as they are given, and its sheet. Raises InputError."""
        from fig2mesh.convert import settings_of
        from fig2mesh.parse.read import read_given

        self.profile()
        settings_of(device="cpu", **self._settings())
        self._sheet()
        read_given(**self._files())

    def _files(self) -> dict[str, Any]:
        names = {"figure": "path", "mask": "mask", "keypoints": "keypoints", "part_labels": "part_labels"}
        return {argument: self.values[name] for name, argument in names.items()} | {"bbox": self.values["bbox"]}

    def _settings(self) -> dict[str, Any]:
        names = ("quality", "triangles", "texture_size", "lods", "parts", "textures", "contours", "effects", "mesher",
                 "closing", "seed")  # fmt: skip
        return {name: self.values[name] for name in names}

    def convert(self, advance: Advance) -> dict[str, Any]:
        """Make the outputs; returns what the record says of them."""
        from exporters.placed_figure import figure_of
        from fig2mesh.batch.keys import key_of, stage_keys
        from fig2mesh.batch.stage_cache import READ, StageCache
        from fig2mesh.convert import asset_of, settings_of, torch_device
        from fig2mesh.counters import counting
        from fig2mesh.parse.read import read_figure
        from fig2mesh.parts.pieces import clean
        from fig2mesh.pipeline import steps
        from fig2mesh.place import place
        from fig2mesh.plan import plan
        from fig2mesh.report import model_measures
        from fig2mesh.stages import figure_digest

        profile = self.profile()
        settings = settings_of(device=torch_device(self.values["device"]), **self._settings())
        sheet = self._sheet()
        cache = StageCache(None if self.batch.fresh else self.batch.folder / WORK / "stages")
        with counting() as counts:
            advance("read")
            own = ("figure", "mask", "keypoints", "part_labels")
            files = {name: digest_of(self.values[name]) for name in own if self.values[name] is not None}
            key = key_of(stage=READ, files=files, bbox=self.values["bbox"])
            drawn = cache.make(READ, key, lambda: read_figure(**self._files(), name=READ))
            figure, pieces, specks = clean(
                replace(drawn, name=self.task.title), settings.voxel, settings.picture_px
            )  # fmt: skip
            placed = place(self.place, sheet, figure, self.values["figure"])
            normals = any(e.runs for e in plan(settings, self.targets).effects if e.name == "normals")
            road = steps(settings, placed.height_m, normals=normals)
            results: dict[str, Any] = {"figure": figure, "pieces": pieces}
            keys = stage_keys(figure_digest(figure), settings, normals)
            cache.make_only(("model", "simplify"), road, results, keys, advance)
            asset = asset_of(
                self.task.title, results["model"], settings, placed, source=self.values["figure"].name,
                quality=self.values["quality"], credit=self.values["credit"], evidence=self.values["evidence"],
            )  # fmt: skip
            advance("write")
            outputs = self._write(asset, profile)
            measures = model_measures(asset, results, placed.height_m)
        record = {
            "inputs": self.inputs,
            "outputs": {name: digest for name, (_, digest) in outputs.items()},
            "sizes": {name: size for name, (size, _) in outputs.items()},
            "files": sorted(outputs),
            "measures": measures,
            "placement": None if asset.placement is None else asdict(asset.placement),
            "map": placed.map,
            "notes": self._notes(placed, specks, measures),
            "date": self.options.date or _changed(self.values["figure"]),
            "work": {"ran": cache.ran, "reused": cache.reused, "counts": {k: n for k, n in counts.items() if n}},
        }
        if asset.placement is not None:
            contents = tuple(f"{self.task.name}/{name}" for name in self._levels(asset))
            whole = replace(figure_of(asset, contents), attributes=_plain(self.options.attributes))
            record["figure"] = asdict(whole)
        return record

    def _notes(self, placed: Placed, specks: int, measures: dict[str, Any]) -> list[str]:
        notes = [self.batch.roots.shorten(note) for note in placed.notes]
        if specks:
            notes.append(f"{specks} specks of the silhouette are too small to model and were left out")
        if measures["components"] != measures["pieces_drawn"]:
            notes.append(f"{measures['components']} solids for {measures['pieces_drawn']} drawn pieces")
        return notes

    def _levels(self, asset: Asset) -> list[str]:
        """Files of the levels of detail, finest first."""
        name = self.task.name
        return [f"{name}.glb", *(f"{name}_lod{level}.glb" for level in range(1, len(asset.lods)))]

    def _write(self, asset: Asset, profile: Profile) -> dict[str, tuple[int, str]]:
        """Write all outputs, or none; returns size and digest of each, by its path below the batch's folder."""
        from exporters.write import in_order, write, write_whole

        folder = self.batch.folder / self.task.name
        main = folder / self.targets[0]

        def fill(stage: Path) -> None:
            for target in in_order(self.targets):
                write(asset, stage / target, profile=profile)
            for level, name in enumerate(self._levels(asset)[1:], start=1):
                write(replace(asset, lods=(asset.lods[level],)), stage / name, profile=profile)

        before = (Ledger(self.batch.folder).read(self.task.name) or {}).get("files", [])
        outdated = [Path(name).name for name in before]
        files = write_whole(main, main, fill, overwrite=True, outdated=outdated)
        return {
            file.relative_to(self.batch.folder).as_posix(): (file.stat().st_size, digest_of(file))
            for file in sorted(files)
        }


@lru_cache(maxsize=8)
def _open_map(request: PlaceRequest, digests: tuple[str, ...]) -> MapSheet | None:
    """The sheet of a request; the same one is read once."""
    from fig2mesh.place import open_map

    return open_map(request)


def _plain(attributes: Mapping[str, Value]) -> Attributes:
    """Attributes as indexes hold them: lists as text."""
    from exporters.placed_figure import plain_attributes

    return plain_attributes(
        {name: ", ".join(map(str, value)) if isinstance(value, tuple) else value for name, value in attributes.items()}
    )


def _changed(path: Path) -> str:
    """When a file was last changed, ISO 8601, to the second."""
    with suppress(OSError, ValueError, OverflowError):
        return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(int(path.stat().st_mtime)))
    return "1970-01-01T00:00:00Z"
