"""Counts of the work done for a picture."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Counts:
    """Numbers of operations, summed over pictures.

    camera_rays : from the camera, one for each sample of each pixel, including those in tiles without a part field,
        which are not traced
    normals : computed at points of the surface
    texture_samples : colours looked up in drawings or textures
    sight_rays : towards the viewer of the drawing
    shadow_rays : towards the lamp
    ao_rays : into the hemisphere over a point
    pixels_compared : with their neighbours, for outlines
    """

    camera_rays: int = 0
    normals: int = 0
    texture_samples: int = 0
    sight_rays: int = 0
    shadow_rays: int = 0
    ao_rays: int = 0
    pixels_compared: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))
