"""Plan of a request: the stages and effects that it needs, and why the others are left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Final

from fig2mesh.settings import Settings
from fig2mesh.stages.stage import Stage
from fig2mesh.stages.table import STAGES

WITH_NORMALS: Final = (".usd", ".usda", ".usdc", ".usdz", ".ply", ".obj")
"""Formats whose files always have normals, because their readers light every surface."""


@dataclass(frozen=True)
class Planned:
    """A stage or an effect; runs : whether it is needed; why : the reason."""

    name: str
    runs: bool
    why: str


@dataclass(frozen=True)
class Plan:
    """stages : in the order in which they run; effects : on the model."""

    stages: tuple[Planned, ...]
    effects: tuple[Planned, ...]


def plan(settings: Settings, outputs: Sequence[str], stages: Sequence[Stage] = STAGES) -> Plan:
    """Plan the stages and effects for some outputs.

    outputs : as `-o` takes them
    """
    found = []
    for stage in stages:
        left_out = stage.left_out(settings)
        found.append(Planned(stage.name, left_out is None, left_out or stage.why(settings)))
    return Plan(tuple(found), (normals_of(settings, outputs), _light(settings)))


def normals_of(settings: Settings, outputs: Sequence[str]) -> Planned:
    """Whether the model needs shading normals; outputs : as `-o` takes them."""
    if settings.light:
        return Planned("normals", True, "for the effect light")
    formats = sorted({suffix for output in outputs if (suffix := PurePath(output).suffix.lower()) in WITH_NORMALS})
    if formats:
        return Planned("normals", True, f"{' '.join(formats)} files are lit by their readers")
    if settings.textures != "none":
        return Planned("normals", True, "the bake needs the direction of the surface")
    return Planned("normals", False, "nothing is lit")


def _light(settings: Settings) -> Planned:
    if settings.light:
        return Planned("light", True, "clients light the surface")
    return Planned("light", False, "colours are shown as drawn")
