"""The stages in their order. A new stage is a file with its function, and an entry here."""

from __future__ import annotations

from typing import Final

from fig2mesh.settings import Settings
from fig2mesh.stages.bake import bake
from fig2mesh.stages.body import body
from fig2mesh.stages.cloud import cloud
from fig2mesh.stages.contour import contour
from fig2mesh.stages.lift import lift
from fig2mesh.stages.model import model
from fig2mesh.stages.parts import parts
from fig2mesh.stages.simplify import simplify
from fig2mesh.stages.solid import solid
from fig2mesh.stages.stage import Kept, Stage, Unless
from fig2mesh.stages.surface import surface
from fig2mesh.stages.textures import textures
from fig2mesh.stages.unwrap import unwrap


def _lift(settings: Settings) -> str:
    return "depths of the joints, " + ("by rule" if settings.parts == "outline" else "by the pose network")


def _parts(settings: Settings) -> str:
    outline = settings.parts == "outline"
    return "part fields, " + ("of the outline" if outline else "by the part networks in the drawn outline")


def _simplify(settings: Settings) -> str:
    levels = f", {settings.lods} levels" if settings.lods > 1 else ""
    return f"{settings.triangles} triangles{levels}"


def _contour(settings: Settings) -> str:
    forms = {"hull": "an inverted hull", "keep": "a ribbon along the silhouette", "drop": "left off"}
    return f"the drawn contour, {forms[settings.contours]}"


def _textures(settings: Settings) -> str:
    if settings.textures == "paper":
        return "colours of hidden sides, four views painted by two networks"
    return "colours of hidden sides, continued from the rim"


NO_POINTS: Final = Unless("mesher", "isosurface", "the isosurface needs no points")
NO_TEXTURE: Final = Unless("textures", "none", "no texture is requested")

STAGES: Final[tuple[Stage, ...]] = (
    Stage(lift, _lift),
    Stage(parts, _parts, Kept.ON_REQUEST),  # 50 MB per figure
    Stage(body, lambda settings: "the parts together", Kept.NEVER),
    Stage(cloud, lambda settings: "points for ball pivoting", Kept.ON_REQUEST, NO_POINTS),
    Stage(solid, lambda settings: f"the closed mesh, by {settings.mesher}"),
    Stage(simplify, _simplify),
    Stage(surface, lambda settings: "normals, parts and deviation of the simplified mesh"),
    Stage(contour, _contour, unless=NO_TEXTURE),
    Stage(unwrap, lambda settings: "texture coordinates", unless=NO_TEXTURE),
    Stage(textures, _textures, Kept.NEVER, NO_TEXTURE),
    Stage(bake, lambda settings: f"a texture of {settings.texture_size} texels per side", unless=NO_TEXTURE),
    Stage(model, lambda settings: "metres, on the ground", Kept.NEVER),
)
"""Every stage after those whose results it needs."""
