"""The asset that exporters write, from the results of the stages."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from exporters.asset import Asset, TexturedMesh
from exporters.sampling import observed_share
from fig2mesh.conversion.libraries import __version__
from fig2mesh.conversion.place import Placed
from fig2mesh.conversion.request import Request
from fig2mesh.settings import Settings
from fig2mesh.skeleton import PART_NAMES
from fig2mesh.system.surroundings import valid_text


def asset_of(
    request: Request, name: str, levels: tuple[TexturedMesh, ...], settings: Settings, placed: Placed
) -> Asset:
    """The asset of a request; levels : result of the stage `model`."""
    if not request.evidence:
        levels = tuple(replace(level, parts=None, observed=None) for level in levels)
    facts = {
        "source": valid_text(request.figure.name),
        "seed": settings.seed,
        "quality": request.quality,
        "version": __version__,
    }
    share = observed_share(levels[0])
    if share is not None:
        facts["observed_share"] = round(share, 3)
    return Asset(
        name=name,
        lods=levels,
        placement=placed.placement,
        part_names=_part_names(levels) if request.evidence else {},
        copyright=request.credit,
        lit=settings.light,
        metadata={**facts, **placed.metadata},
    )


def _part_names(levels: tuple[TexturedMesh, ...]) -> dict[int, str]:
    labels = np.unique(np.concatenate([level.parts for level in levels if level.parts is not None]))
    return {int(label): PART_NAMES[label] for label in labels}
