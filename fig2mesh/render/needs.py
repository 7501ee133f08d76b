"""Properties of the surface that a picture needs, derived from its mode and effects."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from typing import Literal

from fig2mesh.render.effects import Effect, Mode

AO_SAMPLES = 8
"""Rays into the hemisphere over each point; the four sets of a pixel of 2 x 2 samples are rotated differently."""


@dataclass(frozen=True)
class Needs:
    """Work for each visible point.

    normals : compute its normal
    labels : find its part
    textures : look up its colour in the drawing or the texture
    sight : trace a ray towards the viewer of the drawing, to find whether the drawing shows it
    lamp : light that falls on it: "none", "head" (next to the camera, for clay), "key", "sun"
    shadow : trace a ray towards the lamp
    ao_samples : number of rays into its hemisphere
    edges : compare it with its neighbours
    blend : look up both colours where the drawing shows it at an angle
    """

    normals: bool = False
    labels: bool = False
    textures: bool = False
    sight: bool = False
    lamp: Literal["none", "head", "key", "sun"] = "none"
    shadow: bool = False
    ao_samples: int = 0
    edges: bool = False
    blend: bool = False

    @property
    def points(self) -> bool:
        """Whether its position is needed: secondary rays start there, and ink lines compare positions."""
        return self.sight or self.shadow or self.ao_samples > 0 or self.edges


def needs(mode: Mode, effects: Set[Effect], *, fields: bool = True) -> Needs:
    """Minimum work that shows `mode` with `effects`.

    fields : the surface is that of part fields, whose colours depend on normal and visibility; a mesh has a texture
    """
    textures = mode == "textured"
    lamp: Literal["none", "head", "key", "sun"] = "head" if mode == "clay" else "none"
    if "light" in effects:
        lamp = "key"
    elif "sun" in effects:
        lamp = "sun"
    edges = "outline" in effects
    return Needs(
        normals=mode == "normals" or lamp != "none" or "ao" in effects or edges or (textures and fields),
        labels=mode == "parts" or edges or (textures and fields),
        textures=textures,
        sight=textures and fields,
        lamp=lamp,
        shadow="shadow" in effects,
        ao_samples=AO_SAMPLES if "ao" in effects else 0,
        edges=edges,
        blend="blend" in effects,
    )
