"""Stage of the pipeline: one function, and the few facts that its signature does not hold."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any, get_type_hints

from fig2mesh.settings import Settings


class Kept(Enum):
    """Storage policy of a stage's result."""

    NEVER = "fast to recompute"
    ON_REQUEST = "large: only in the folder of --save-stages"
    ALWAYS = "small and slow to compute"


@dataclass(frozen=True)
class Unless:
    """A stage is left out where `setting` has `value`; its result is then None. why : shown to the user."""

    setting: str
    value: object
    why: str


@dataclass(frozen=True)
class Stage:
    """Stage of the pipeline.

    function : makes the result; its signature is explained in `fig2mesh.stages`
    why : description of the stage under given settings, shown by `fig2mesh plan` and in reports
    kept : whether stores keep the result
    unless : setting under which the stage is left out
    """

    function: Callable[..., object]
    why: Callable[[Settings], str]
    kept: Kept = Kept.ALWAYS
    unless: Unless | None = None

    @property
    def name(self) -> str:
        """Name of the function, of its file, of its result, and of the stage on the command line."""
        return self.function.__name__

    @cached_property
    def _parameters(self) -> Mapping[str, inspect.Parameter]:
        return inspect.signature(self.function).parameters

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """Names of the results, and inputs of the pipeline, that the function takes."""
        return tuple(name for name, each in self._parameters.items() if each.kind is not each.KEYWORD_ONLY)

    @cached_property
    def arguments(self) -> tuple[str, ...]:
        """Names of the settings that the function takes."""
        return tuple(name for name, each in self._parameters.items() if each.kind is each.KEYWORD_ONLY)

    @cached_property
    def reads(self) -> tuple[str, ...]:
        """Names of all settings on which the result depends, `unless` included."""
        condition = () if self.unless is None else (self.unless.setting,)
        return tuple(dict.fromkeys((*self.arguments, *condition)))

    @cached_property
    def makes(self) -> Any:
        """Type of the result."""
        return get_type_hints(self.function)["return"]

    def left_out(self, settings: Settings) -> str | None:
        """Reason why the stage is left out under these settings; None where it is not."""
        if self.unless is not None and getattr(settings, self.unless.setting) == self.unless.value:
            return self.unless.why
        return None

    def run(self, settings: Settings, results: Mapping[str, object]) -> object:
        """Call the function with what it needs of `results` and `settings`."""
        needed = (results[name] for name in self.needs)
        return self.function(*needed, **{name: getattr(settings, name) for name in self.arguments})
