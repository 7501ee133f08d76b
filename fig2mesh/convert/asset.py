"""What every conversion of a figure does between reading and writing: settings from options, the asset from results."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from exporters.asset import Asset, TexturedMesh
from exporters.sampling import observed_share
from fig2mesh import __version__
from fig2mesh.errors import InputError
from fig2mesh.settings import Quality, Settings, settings_for

if TYPE_CHECKING:
    from fig2mesh.convert.place import Placed


# fmt: off
SETTING_OPTIONS = (
    "quality", "triangles", "texture_size", "lods", "parts", "textures", "contours", "effects", "mesher", "closing",
    "seed",
)
# fmt: on
"""Options of the main job that `settings_of` takes as they are; the device has to be found first."""


def settings_of(*, quality: Quality, effects: tuple[str, ...], **given: Any) -> Settings:
    """The settings that the options of the main job ask for.

    given : other fields of `Settings`; None keeps the preset's
    """
    return settings_for(quality, light=_light(effects), **given)


def _light(effects: tuple[str, ...]) -> bool | None:
    """Whether the surface is lit; None where nothing is said."""
    others = [effect for effect in effects if effect != "none"]
    if "none" in effects and others:
        raise InputError("--effect", f"none beside {others[0]}", "give either none or the effects wanted")
    return "light" in effects if effects else None


def torch_device(name: str) -> str:
    """The device that --device names: "cpu" or "cuda"."""
    if name == "cpu":
        return "cpu"  # torch takes seconds to load
    import torch

    available = torch.cuda.is_available()
    if name == "cuda" and not available:
        raise InputError("--device", "no usable CUDA device", "pass --device cpu or auto")
    return "cuda" if available else "cpu"


def asset_of(
    name: str,
    levels: tuple[TexturedMesh, ...],
    settings: Settings,
    placed: Placed,
    *,
    source: str,
    quality: Quality,
    credit: str,
    evidence: bool,
) -> Asset:
    """The asset that exporters write.

    levels : the result "model" of the pipeline
    source : file name of the drawing
    evidence : with part names and what the drawing showed of each
    """
    if not evidence:
        levels = tuple(replace(level, parts=None, observed=None) for level in levels)
    facts = {"source": source, "seed": settings.seed, "quality": quality, "version": __version__}
    share = observed_share(levels[0])
    if share is not None:
        facts["observed_share"] = round(share, 3)
    return Asset(
        name=name,
        lods=levels,
        placement=placed.placement,
        part_names=_part_names(levels) if evidence else {},
        copyright=credit,
        lit=settings.light,
        metadata={**facts, **placed.metadata},
    )


def _part_names(levels: Any) -> dict[int, str]:
    import numpy as np

    from fig2mesh.skeleton import PART_NAMES

    labels = np.unique(np.concatenate([level.parts for level in levels]))
    return {int(label): PART_NAMES[label] for label in labels}
