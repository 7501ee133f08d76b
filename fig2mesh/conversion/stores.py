"""Stores of stage results: in memory, in the folder of `--save-stages`, or in files named by the keys of results.

A store only loads and saves; the runner decides what is needed.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

from fig2mesh.conversion.record_file import read_record, write_record
from fig2mesh.errors import FigureError, InputError, OutputError
from fig2mesh.stages.stage import Kept, Stage

log = logging.getLogger("fig2mesh")

T = TypeVar("T")


class Store(Protocol):
    """Where results of stages are kept; keyed : whether it goes by keys, which cost a digest of code and figure."""

    keyed: ClassVar[bool]

    def load(self, stage: Stage, key: str) -> object | None:
        """The result kept for a stage, or None."""

    def save(self, stage: Stage, key: str, value: object) -> None:
        """Store a result, if the store keeps results of this stage."""


class NoStore:
    """Store that keeps nothing."""

    keyed: ClassVar[bool] = False

    def load(self, stage: Stage, key: str) -> None:
        return None

    def save(self, stage: Stage, key: str, value: object) -> None:
        return None


@dataclass
class MemoryStore:
    """Store in memory; a change of settings or figure changes the keys of all results that depend on it."""

    keyed: ClassVar[bool] = True
    results: dict[str, object] = field(default_factory=dict)

    def load(self, stage: Stage, key: str) -> object | None:
        return self.results.get(key)

    def save(self, stage: Stage, key: str, value: object) -> None:
        self.results[key] = value


@dataclass(frozen=True)
class FolderStore:
    """One file per stage, named after it: `--save-stages DIR`.

    read : names of the stages whose files are used; the others are run again, and written
    """

    keyed: ClassVar[bool] = False
    folder: Path
    read: frozenset[str] = frozenset()

    def load(self, stage: Stage, key: str) -> object | None:
        """The result in a stage's file, or None if it is to be run. Raises FigureError for missing or damaged files."""
        if stage.name not in self.read or stage.kept is Kept.NEVER:
            return None
        found: object = self.read_file(stage.name, stage.makes)
        return found

    def save(self, stage: Stage, key: str, value: object) -> None:
        """Write the file of a stage. Raises OutputError if it cannot be written."""
        if stage.kept is not Kept.NEVER:
            self.write_file(stage.name, value)

    def read_file(self, name: str, kind: Any) -> Any:
        """Contents of `folder/name.npz`; kind : their type. Raises FigureError."""
        path = self.folder / f"{name}.npz"
        if not path.exists():
            raise FigureError(path, "no such file", "run once with --save-stages and without --resume-from")
        return read_record(path, name, kind)

    def write_file(self, name: str, value: object) -> None:
        """Write `folder/name.npz`, whole or not at all. Raises OutputError."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write_record(self.folder / f"{name}.npz", name, value)
        except OSError as error:
            found = f"{self.folder / name}.npz: {error.strerror}"
            raise OutputError("--save-stages", found, "choose a folder that can be written") from None


@dataclass
class KeyedStore:
    """Files named by the keys of results, so that they are never outdated, only unused.

    Any number of processes on any number of machines may share a folder: results of one key are equal, and appear
    whole or not at all.

    fresh : read nothing, store everything; made, reused : names of results that were made, and that were read
    """

    keyed: ClassVar[bool] = True
    folder: Path
    fresh: bool = False
    made: list[str] = field(default_factory=list)
    reused: list[str] = field(default_factory=list)

    def load(self, stage: Stage, key: str) -> object | None:
        found: object | None = None
        if stage.kept is Kept.ALWAYS:
            found = self._load(stage.name, key, stage.makes)
        return found

    def save(self, stage: Stage, key: str, value: object) -> None:
        self.made.append(stage.name)
        if stage.kept is Kept.ALWAYS:
            self._save(stage.name, key, value)

    def make(self, name: str, key: str, kind: Any, run: Callable[[], T]) -> T:
        """A result that is not of a stage: read if an intact file exists, else made and stored; kind : its type."""
        found: T | None = self._load(name, key, kind)
        if found is None:
            found = run()
            self.made.append(name)
            self._save(name, key, found)
        return found

    def _path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.npz"

    def _load(self, name: str, key: str, kind: Any) -> Any:
        if self.fresh or not self._path(key).is_file():
            return None
        try:
            found = read_record(self._path(key), name, kind)
        except InputError as error:
            log.debug("%s; making it again", error)
            with suppress(OSError):
                self._path(key).unlink()
            return None
        self.reused.append(name)
        return found

    def _save(self, name: str, key: str, value: object) -> None:
        try:
            self._path(key).parent.mkdir(parents=True, exist_ok=True)
            write_record(self._path(key), name, value)
        except OSError as error:
            # A result that is not stored is made again; the outputs will report a full disk.
            log.debug("%s: not stored (%s)", self._path(key), error.strerror)
