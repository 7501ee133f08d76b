"""Which stages and effects a request needs, and why the others are left out.

Pure: the main job runs what `plan` says, and `fig2mesh plan` prints it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Final

from fig2mesh.settings import STAGES, Settings

COLOURING: Final = ("unwrap", "textures", "bake")
"""Stages that figures without texture do not need."""

WITH_NORMALS: Final = (".usd", ".usda", ".usdc", ".usdz", ".ply", ".obj")
"""Formats whose files have normals in any case: their readers light everything."""


@dataclass(frozen=True)
class Planned:
    """A stage or an effect; runs : whether it is needed; why : what needs it, or why nothing does."""

    name: str
    runs: bool
    why: str


@dataclass(frozen=True)
class Plan:
    """stages : in their order; effects : on the model."""

    stages: tuple[Planned, ...]
    effects: tuple[Planned, ...]

    @property
    def normals(self) -> bool:
        """Whether the model has shading normals."""
        return any(effect.runs for effect in self.effects if effect.name == "normals")


def plan(settings: Settings, outputs: Sequence[str]) -> Plan:
    """What a request needs.

    outputs : as `-o` takes them
    """
    networks, inferred = settings.parts == "network", settings.textures == "network"
    reasons = {
        "lift": "depths of the joints, " + ("by the pose network" if networks else "by rule"),
        "parts": "part fields, " + ("by the part networks in the drawn outline" if networks else "of the outline"),
        "body": "the parts together",
        "cloud": "points for ball pivoting",
        "solid": f"the closed mesh, by {settings.mesher}",
        "simplify": f"{settings.triangles} triangles" + (f", {settings.lods} levels" if settings.lods > 1 else ""),
        "surface": "normals, parts and deviation of the simplified mesh",
        "unwrap": "texture coordinates",
        "textures": "colours of unseen sides, " + ("by two networks" if inferred else "those in front of them"),
        "bake": f"a texture of {settings.texture_size} texels a side",
        "model": "metres, on the ground",
    }
    without = dict.fromkeys(COLOURING, "no texture is asked for") if settings.textures == "none" else {}
    if settings.mesher == "isosurface":
        without["cloud"] = "the isosurface needs no points"
    stages = tuple(Planned(name, name not in without, without.get(name, reasons[name])) for name in STAGES)
    return Plan(stages, (_normals(settings, outputs), _light(settings)))


def _normals(settings: Settings, outputs: Sequence[str]) -> Planned:
    if settings.light:
        return Planned("normals", True, "for the effect light")
    formats = sorted({suffix for output in outputs if (suffix := PurePath(output).suffix.lower()) in WITH_NORMALS})
    if formats:
        return Planned("normals", True, f"{' '.join(formats)} files are lit by their readers")
    if settings.textures != "none":
        return Planned("normals", True, "the bake asks which way the surface faces")
    return Planned("normals", False, "nothing is lit")


def _light(settings: Settings) -> Planned:
    if settings.light:
        return Planned("light", True, "clients light the surface")
    return Planned("light", False, "colours are shown as drawn")
