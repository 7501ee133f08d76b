"""A row whose files have been resolved: its request, and digests of everything that its outputs depend on."""

from __future__ import annotations

import os
from dataclasses import fields, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fig2mesh.batch.columns import no_place
from fig2mesh.batch.row_files import digest_of, files_unchanged, input_files, resolve, sheet_files
from fig2mesh.batch.task import Batch, RowTask
from fig2mesh.conversion.request import PlaceRequest, Request
from fig2mesh.errors import InputError

if TYPE_CHECKING:
    from exporters.profiles import Profile
    from georef.mapsheet import MapSheet


class ResolvedRow:
    """A row's request with resolved paths.

    request : with paths that can be opened from any folder
    inputs : digest of every file that it depends on, by path
    key : digest of everything that its outputs depend on

    Raises InputError naming the column.
    """

    def __init__(self, batch: Batch, task: RowTask) -> None:
        from exporters.gis.time_span import time_span
        from fig2mesh.conversion.keys import key_of

        if task.problem is not None:
            raise InputError(task.problem.source, task.problem.finding, task.problem.remedy)
        assert task.request is not None
        self.batch, self.task = batch, task
        if task.date is not None:
            time_span(task.date, "column date")
        resolved = resolve(task.request, batch.roots, task.own_files)
        self.request: Request = replace(resolved, outputs=self.targets)
        if not resolved.has_place and (resolved.at is not None or not batch.unplaced):
            raise no_place(resolved, task.attributes)
        files = input_files(resolved)
        self.inputs: dict[str, str] = {
            self._relative(file): digest_of(file) for name in sorted(files) for file in files[name]
        }
        values = {each.name: getattr(resolved, each.name) for each in fields(resolved)}
        self.key = key_of(
            options={name: self._relative(v) if isinstance(v, Path) else str(v) for name, v in values.items()},
            formats=task.formats,
            date=task.date,
            inputs=self.inputs,
            attributes=task.attributes,
            title=task.title,
        )

    def _relative(self, file: Path) -> str:
        real, root = Path(os.path.realpath(file)), self.batch.roots.root
        return (real.relative_to(root) if real.is_relative_to(root) else real).as_posix()

    @property
    def source(self) -> str:
        """The picture as the table names it, so that it can be found again; no folders of this machine."""
        assert self.task.request is not None
        path = self.task.request.figure
        return self._relative(self.request.figure) if path.is_absolute() else path.as_posix()

    def sheet(self) -> MapSheet | None:
        """Map sheet of the place, if any. Raises InputError."""
        from fig2mesh.conversion.place import open_map

        if self.request.map is None:
            return open_map(self.request)
        digests = tuple(digest_of(file) for file in sheet_files(self.request.map))
        return _open_map(replace(self.request.place, at=None), digests)

    @property
    def targets(self) -> tuple[str, ...]:
        """Outputs, relative to the folder of the figure."""
        suffixes = dict.fromkeys(("glb", *(each.lower().lstrip(".") for each in self.task.formats)))
        return tuple(f"{self.task.name}.{suffix}" for suffix in suffixes)

    def is_current(self, record: dict[str, Any]) -> bool:
        """Whether a record of the same key is up to date: its outputs are unchanged, or its failure is permanent."""
        if record["status"] == "failed":
            return bool(record.get("lasting"))
        return record["status"] == "done" and files_unchanged(self.batch.folder, record["outputs"])

    def profile(self) -> Profile:
        """Profile of the outputs' client. Raises InputError if the client does not read them."""
        from exporters.profiles import profile_named
        from exporters.write import needs_place

        profile = profile_named(self.request.profile)
        profile.check_tools()
        for target in self.targets:
            profile.check(target, Path(target).suffix.lower())
            if needs_place(target) and not self.request.has_place:
                raise InputError("column format", f"{target} needs a place on the earth", "give lon and lat")
        return profile

    def check_values(self) -> None:
        """Check everything that needs no reading of the figure. Raises InputError."""
        from fig2mesh.conversion.place import is_drawn_on

        self.profile()
        sheet, at = self.sheet(), self.request.at
        if sheet is not None:
            is_drawn_on(sheet, at, self.request.figure)
        if sheet is not None and at is not None:
            sheet.place(*at, source="columns x, y")

    def check(self) -> None:
        """Check the values, and read the given files of the figure. Raises InputError."""
        from fig2mesh.parse.read import read_given

        self.check_values()
        read_given(**self.request.reading())


@lru_cache(maxsize=8)
def _open_map(request: PlaceRequest, digests: tuple[str, ...]) -> MapSheet | None:
    """Map sheet of a request, cached by the digests of its files."""
    from fig2mesh.conversion.place import open_map

    return open_map(request)
