"""What a picture has to find out about the surface, derived from what is asked for."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from typing import Literal

from fig2mesh.render.effects import Effect, Mode

AO_SAMPLES = 8
"""Rays into the hemisphere over each point; a pixel of 2 x 2 samples has four differently turned sets of them."""


@dataclass(frozen=True)
class Needs:
    """What each point that is seen costs.

    normals : its normal
    labels : its part
    textures : its colour from the drawing or the texture
    sight : a ray towards the viewer of the drawing, which tells whether the drawing shows it
    lamp : the light that falls on it: "none", "head" (beside the camera, what makes clay readable), "key", "sun"
    shadow : a ray towards the lamp
    ao_samples : rays into its hemisphere
    edges : comparison with its neighbours
    blend : both colours where the drawing shows it at an angle
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
        """Whether its place in space is needed: further rays start there, and ink compares places."""
        return self.sight or self.shadow or self.ao_samples > 0 or self.edges


def needs(mode: Mode, effects: Set[Effect], *, fields: bool = True) -> Needs:
    """The least that shows `mode` with `effects`.

    fields : the surface is that of part fields, whose points are coloured by normal and sight; the points of a mesh
        find their colours in its texture
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
