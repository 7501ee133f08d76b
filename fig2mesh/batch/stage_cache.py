"""What stages made, kept under a name that says what it was made from: nothing is ever outdated, only unused.

The names are those of `fig2mesh.batch.keys`. Any number of processes on any number of machines may share a folder:
results of one name are equal, and appear whole or not at all.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fig2mesh.errors import InputError

if TYPE_CHECKING:
    from fig2mesh.convert.pipeline import Step

log = logging.getLogger("fig2mesh")

KEPT: Final = ("lift", "solid", "simplify", "surface", "unwrap", "bake")
"""Stages whose results are small and slow to make; "parts" is 50 MB a figure, and only what comes before the mesh and
the textures needs it."""

MEASURES: Final = "measures"
"""Name of what is measured on the model, which takes longer than writing it."""

READ: Final = "figure"
"""Name of the result of reading and parsing, which comes before the stages."""


@dataclass
class StageCache:
    """Results in files below `folder`.

    fresh : nothing is read, all is kept; ran, reused : stages that ran, and that were read
    """

    folder: Path
    fresh: bool = False
    ran: list[str] = field(default_factory=list)
    reused: list[str] = field(default_factory=list)

    def make(self, stage: str, key: str, run: Callable[[], Any]) -> Any:
        """The result of a stage: read if it is there and sound, else made and kept."""
        found = self._load(stage, key)
        if found is None:
            found = run()
            self.ran.append(stage)
            self._save(stage, key, found)
        return found

    def make_only(
        self,
        goals: Sequence[str],
        road: Sequence[Step],
        results: dict[str, Any],
        keys: dict[str, str],
        advance: Callable[[str], object],
    ) -> None:
        """Put what `goals` name into `results`, with as little work as what is kept allows."""
        steps = {step.name: step for step in road}

        def need(name: str) -> None:
            if name in results:
                return
            step = steps[name]

            def run() -> Any:
                for each in step.needs:
                    need(each)
                advance(name)
                return step.run(*(results[each] for each in step.needs))

            if name in KEPT:
                results[name] = self.make(name, keys[name], run)
            else:
                results[name] = run()
                self.ran.append(name)

        for goal in goals:
            need(goal)

    def _path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.npz"

    def _load(self, stage: str, key: str) -> Any:
        from fig2mesh.convert.stage_file import read_result

        if self.fresh or not self._path(key).is_file():
            return None
        try:
            found = read_result(self._path(key), stage)
        except InputError as error:
            log.debug("%s; it is made anew", error)
            with suppress(OSError):
                self._path(key).unlink()
            return None
        self.reused.append(stage)
        return found

    def _save(self, stage: str, key: str, value: Any) -> None:
        from fig2mesh.convert.stage_file import write_result

        try:
            self._path(key).parent.mkdir(parents=True, exist_ok=True)
            write_result(self._path(key), stage, value)
        except OSError as error:
            # What is not kept is made again; a disk that is full will be reported by the outputs.
            log.debug("%s: not kept (%s)", self._path(key), error.strerror)
