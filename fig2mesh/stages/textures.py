"""Stage `textures`: colours for the sides that the drawing does not show (paper §4.3-4.4)."""

from __future__ import annotations

from fig2mesh.image_frame import image_frame
from fig2mesh.parts.outline import Outline
from fig2mesh.records import Figure
from fig2mesh.settings import Contours
from fig2mesh.texture.sources import Sources, make_sources


def textures(figure: Figure, parts: Outline, *, contours: Contours, texture_size: int, seed: int) -> Sources:
    """Pictures from which the bake takes the colours of all texels."""
    return make_sources(figure, image_frame(figure), parts, texture_size, seed, contours=contours != "drop")
