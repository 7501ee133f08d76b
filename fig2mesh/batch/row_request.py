"""What a row asks for: its words as options of the main job, its files and their digests."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fig2mesh.batch.row_files import digest_of, input_files, inside, sheet_files, stand
from fig2mesh.batch.row_options import RowOptions, options_of
from fig2mesh.batch.task import Batch, Task
from fig2mesh.errors import InputError

if TYPE_CHECKING:
    from exporters.profiles import Profile
    from fig2mesh.convert.place import PlaceRequest
    from georef.mapsheet import MapSheet

FORMATS = ("glb", "gltf", "usda", "usdc", "usdz", "ply", "obj", "czml", "geojson")
"""What a row may ask for; .glb is always made."""


def check_formats(formats: Iterable[str], where: str) -> None:
    """Raise InputError, about `where`, for a suffix that a row may not ask for."""
    for each in formats:
        if each.lower().lstrip(".") not in FORMATS:
            raise InputError(where, each[:40] or "empty", f"choose from {', '.join(FORMATS)}; .glb is always made")


class RowRequest:
    """A row's request, as far as its words and its files' digests go.

    values : parameters of the main job by name; options : what the row says besides; place : where it stands
    inputs : path → digest of every file that it depends on; key : digest of all that its outputs depend on

    Raises InputError naming the column.
    """

    def __init__(self, batch: Batch, task: Task) -> None:
        from exporters.gis.time_span import time_span
        from fig2mesh.batch.keys import key_of

        if task.problem is not None:
            finding, _, remedy = task.problem.partition("; ")
            raise InputError(task.where, finding, remedy or "correct the row")
        self.batch, self.task = batch, task
        self.options: RowOptions = options_of(task.values, batch.defaults, task.title)
        check_formats(self.options.formats, "column format")
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
        self.inputs: dict[str, str] = {
            self._seen(file): digest_of(file) for name in sorted(files) for file in files[name]
        }
        texts = {name: self._seen(v) if isinstance(v, Path) else str(v) for name, v in self.values.items()}
        self.key = key_of(
            options=texts,
            formats=self.options.formats,
            date=self.options.date,
            inputs=self.inputs,
            attributes=self.options.attributes,
            title=task.title,
        )

    def _seen(self, file: Path) -> str:
        real, root = Path(os.path.realpath(file)), self.batch.roots.root
        return (real.relative_to(root) if real.is_relative_to(root) else real).as_posix()

    def _place(self) -> PlaceRequest:
        from fig2mesh.convert.place import PlaceRequest

        fields = PlaceRequest.__dataclass_fields__
        request = PlaceRequest(**{name: self.values[name] for name in fields})
        if not (request.somewhere or self.batch.unplaced):
            raise InputError("columns lon, lat", "no place", "give lon and lat, or map, x and y; or pass --unplaced")
        return request

    def sheet(self) -> MapSheet | None:
        """The map that the place is from, if any. Raises InputError."""
        from fig2mesh.convert.place import open_map

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
        return record["status"] == "done" and stand(self.batch.folder, record["outputs"])

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

    def check_words(self) -> None:
        """Check all that can be without reading the figure. Raises InputError."""
        from fig2mesh.convert.asset import settings_of

        self.profile()
        settings_of(device="cpu", **self.settings())
        self.sheet()

    def check(self) -> None:
        """Check the words, and read the figure's files as far as they are given. Raises InputError."""
        from fig2mesh.parse.read import read_given

        self.check_words()
        read_given(**self.files())

    def files(self) -> dict[str, Any]:
        """Arguments of `fig2mesh.parse.read.read_figure`."""
        names = {"figure": "path", "mask": "mask", "keypoints": "keypoints", "part_labels": "part_labels"}
        return {argument: self.values[name] for name, argument in names.items()} | {"bbox": self.values["bbox"]}

    def settings(self) -> dict[str, Any]:
        """Arguments of `fig2mesh.convert.asset.settings_of`, but for the device."""
        from fig2mesh.convert.asset import SETTING_OPTIONS

        return {name: self.values[name] for name in SETTING_OPTIONS}


@lru_cache(maxsize=8)
def _open_map(request: PlaceRequest, digests: tuple[str, ...]) -> MapSheet | None:
    """The sheet of a request; the same one is read once."""
    from fig2mesh.convert.place import open_map

    return open_map(request)
