"""Colours of surface points, as the frame kernel looks them up: the drawing where it saw them, plain colours elsewhere.

The same pictures as in the atlas (`fig2mesh.mesh.bake`), but found anew for each point of each frame, with two
differences. The border between drawing and plain colours is soft; and creases of unseen sides have no ink, for which
the body's distance would have to be evaluated at every pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.body import Body
from fig2mesh.field.camera import framing
from fig2mesh.field.compiled import sealed
from fig2mesh.image_frame import ImageFrame
from fig2mesh.records import ByteArray, FloatArray
from fig2mesh.texture.sources import Sources

BAND = 0.1
"""The normal's z over which the drawing goes over into the plain colours, upwards from `Sources.grazing`."""

DEPTH_ROWS = 1024
"""Rows of the map of how far forward the body reaches: finer than the drawing's line, 4 MB."""

HIDDEN = 0.005
"""Points this far behind what the drawing saw are hidden, FIGURE units: less than a finger is thick."""

STEEPEST = 0.05
"""The normal's z below which a surface counts as no steeper when it is asked what hides it."""

LEVELS = 5
"""Halvings of the pictures kept for small frames."""


class Colouring(NamedTuple):
    """What the kernel reads; a picture's row of four numbers maps FIGURE x, y to its column and row.

    seen : (h, w, 4) uint8, the drawing; the fourth value is unused
    plain : (K, h, w, 4) uint8, the different plain pictures
    slots : (P,) int64, the plain picture of each part of the body
    front : (h, w) float32, greatest z of the body, FIGURE; -infinity beside it
    maps : (3, 4) float64, for seen, plain and front: column = [0] x + [1], row = [2] y + [3], pixel centres at whole
        numbers
    least : z of the normal from which on the drawing has a share
    """

    seen: NDArray[np.uint8]
    plain: NDArray[np.uint8]
    slots: NDArray[np.int64]
    front: NDArray[np.float32]
    maps: NDArray[np.float64]
    least: float


@dataclass(frozen=True)
class SurfaceColours:
    """Colours of a body's surface; make it with `surface_colours`, once for a figure.

    seen, plain : pictures of halved size after halved size, `Colouring`
    slots, front, least : as in `Colouring`
    maps : of the largest pictures
    """

    seen: tuple[ByteArray, ...]
    plain: tuple[ByteArray, ...]
    slots: NDArray[np.int64]
    front: FloatArray
    maps: NDArray[np.float64]
    least: float

    def at(self, pitch: float) -> Colouring:
        """For frames with pixels of `pitch` FIGURE units: pictures no finer than that, which would sparkle."""
        maps = self.maps.copy()
        chosen = []
        for row, levels in enumerate((self.seen, self.plain)):
            finer = np.log2(max(pitch * abs(maps[row, 0]), 1.0))
            level = min(round(finer), len(levels) - 1)
            # a pixel of the halved picture lies between two of the other
            maps[row] = maps[row] / 2**level
            maps[row, 1::2] += 0.5 / 2**level - 0.5
            chosen.append(levels[level])
        return Colouring(chosen[0], chosen[1], self.slots, self.front, sealed(maps, np.float64), self.least)

    @cached_property
    def megabytes(self) -> float:
        """Memory of all pictures, MB."""
        pictures = sum(picture.nbytes for picture in (*self.seen, *self.plain))
        return (pictures + self.front.nbytes) / 1e6


def surface_colours(body: Body, sources: Sources, frame: ImageFrame) -> SurfaceColours:
    """Look at the body once from the front, to know which points the drawing saw.

    sources : the drawing and the plain pictures of its parts
    frame : of the drawing
    """
    from fig2mesh.render.frame import FrameCamera, render_frame

    pictures = list({id(picture): picture for picture in sources.plain.values()}.values())
    position = {id(picture): slot for slot, picture in enumerate(pictures)}
    slots = [position[id(sources.plain.get(int(label), pictures[0]))] for label in body.labels]
    bounds = body.bounds().astype(np.float64)
    wide, high = bounds[1, :2] - bounds[0, :2]
    rows = DEPTH_ROWS
    columns = max(8, int(np.ceil(rows * wide / high)))
    centre, height = framing(bounds, (columns, rows), margin=0.01)
    distance = float(bounds[1, 2] - centre[2]) + 1.0
    camera = FrameCamera(0.0, size=(columns, rows), height=height, centre=centre, distance=distance)
    depth = render_frame(body, camera, want=frozenset({"depth"})).depth
    assert depth is not None
    front = (float(centre[2]) + distance - depth).astype(np.float32)
    pixel = height / rows
    per_unit = 1.0 / frame.units_per_px
    x, y = frame.origin_px
    scale = sources.plain_scale
    maps = np.array(
        [
            [per_unit, x - 0.5, -per_unit, y - 0.5],
            [per_unit * scale, x * scale - 0.5, -per_unit * scale, y * scale - 0.5],
            [1 / pixel, columns / 2 - centre[0] / pixel - 0.5, -1 / pixel, rows / 2 + centre[1] / pixel - 0.5],
        ]
    )
    return SurfaceColours(
        _halved(_packed(sources.seen)[None], one=True),
        _halved(np.stack([_packed(picture) for picture in pictures])),
        sealed(slots, np.int64),
        sealed(front, np.float32),
        sealed(maps, np.float64),
        float(sources.grazing),
    )


def _packed(picture: NDArray[np.float32]) -> ByteArray:
    """(h, w, 4) uint8: pixels lie on addresses that four bytes divide."""
    result = np.zeros((*picture.shape[:2], 4), np.uint8)
    result[..., :3] = np.clip(np.round(picture), 0, 255)
    return result


def _halved(pictures: ByteArray, one: bool = False) -> tuple[ByteArray, ...]:
    """Pictures (K, h, w, 4) and their means over 2 x 2 pixels, again and again; without the first axis if `one`."""
    levels = [pictures]
    while len(levels) <= LEVELS and min(levels[-1].shape[1:3]) >= 16:
        last = levels[-1]
        last = np.pad(last, ((0, 0), (0, last.shape[1] % 2), (0, last.shape[2] % 2), (0, 0)), mode="edge")
        count, height, width, _ = last.shape
        blocks = last.reshape(count, height // 2, 2, width // 2, 2, 4).astype(np.uint16)
        levels.append(((blocks.sum(axis=(2, 4)) + 2) // 4).astype(np.uint8))
    return tuple(sealed(level[0] if one else level, np.uint8) for level in levels)
