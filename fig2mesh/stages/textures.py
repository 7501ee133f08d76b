"""Stage `textures`: colours for the sides that the drawing does not show (paper §4.3-4.4)."""

from __future__ import annotations

from dataclasses import replace

from fig2mesh.field.body import Body
from fig2mesh.image_frame import image_frame
from fig2mesh.parts.outline import Outline
from fig2mesh.records import Figure, Pose3D
from fig2mesh.settings import Contours, Textures
from fig2mesh.texture.sources import Sources, make_sources


def textures(
    figure: Figure,
    lift: Pose3D,
    parts: Outline,
    body: Body,
    *,
    textures: Textures,
    contours: Contours,
    texture_size: int,
    seed: int,
) -> Sources:
    """Pictures from which the bake takes the colours of all texels."""
    frame = image_frame(figure)
    sources = make_sources(figure, frame, parts, texture_size, seed, contours=contours != "drop")
    if textures != "paper":
        return sources
    from fig2mesh.texture.paper import painted_sides
    from fig2mesh.texture.unobserved import shipped

    return replace(sources, painted=painted_sides(body, lift, sources.seen, frame, shipped()))
