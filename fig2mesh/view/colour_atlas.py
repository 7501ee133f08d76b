"""Colours in one picture: the drawing and the plain pictures of unseen sides; and a depth map of the front."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fig2mesh.field.body import Body
from fig2mesh.field.camera import orthographic
from fig2mesh.field.trace import trace
from fig2mesh.image_frame import ImageFrame
from fig2mesh.records import ByteArray, FloatArray
from fig2mesh.texture.sources import Sources

MAX_PX: Final = 1280
"""Longest side of the drawing on a page."""

GAP_PX: Final = 8
"""Margin of a picture round the part that is used, so that coarser mipmaps do not mix in its neighbours."""

DEPTH_PX: Final = 768
"""Longest side of the depth map: about two pixels per node of a part's grid."""


@dataclass(frozen=True)
class Slot:
    """One picture in the atlas.

    place : (ax, bx, ay, by), atlas texel = (ax x + bx, ay y + by) of a point (x, y) in FIGURE
    window : (x0, y0, x1, y1), texels of the picture; colours are clamped to it
    """

    place: tuple[float, float, float, float]
    window: tuple[int, int, int, int]


@dataclass(frozen=True)
class ColourAtlas:
    """Atlas of colours.

    picture : (H, W, 3) uint8 sRGB; slots : the drawing first
    slot_of_label : part label → slot of its unseen side; default : slot of other labels
    """

    picture: ByteArray
    slots: tuple[Slot, ...]
    slot_of_label: dict[int, int]
    default: int


@dataclass(frozen=True)
class DepthMap:
    """z : (h, w) float16 FIGURE, of the front surface; -1000 where there is none.

    place : (ax, bx, ay, by) as for `Slot`
    """

    z: NDArray[np.float16]
    place: tuple[float, float, float, float]


NOTHING: Final = -1000.0


def colour_atlas(sources: Sources, frame: ImageFrame, body: Body) -> ColourAtlas:
    """Pack the drawing and each distinct plain picture into an atlas, cropped to the parts that are used."""
    crops = [_crop(_bytes(sources.seen), 1.0, frame, body.bounds())]
    boxes, labels = body.grids.boxes, body.labels[body.grids.owners]
    slot_of_label: dict[int, int] = {}
    # Parts of one layer share a picture. Most of what the drawing does not show looks away from the viewer.
    unseen = sources.plain | sources.back
    for picture in {id(picture): picture for picture in unseen.values()}.values():
        own = [label for label, other in unseen.items() if other is picture]
        mine = boxes[np.isin(labels, own).any(axis=1) & np.isfinite(boxes).all(axis=(1, 2))]
        if len(mine):
            slot_of_label |= dict.fromkeys(own, len(crops))
            bounds = np.stack([mine[:, 0].min(axis=0), mine[:, 1].max(axis=0)])
            crops.append(_crop(_bytes(picture), sources.plain_scale, frame, bounds))
    # The drawing's column, then columns of plain pictures below each other.
    height = max(crop.shape[0] for crop, _ in crops)
    x = y = column = 0
    corners = []
    for crop, _ in crops:
        rows, columns = crop.shape[:2]
        if y and y + rows > height:
            x, y, column = x + column, 0, 0
        corners.append((x, y))
        y, column = y + rows, max(column, columns)
    atlas = np.zeros((height, x + column, 3), np.uint8)
    slots = []
    for (crop, (ax, bx, ay, by)), (x, y) in zip(crops, corners, strict=True):
        rows, columns = crop.shape[:2]
        atlas[y : y + rows, x : x + columns] = crop
        slots.append(Slot((ax, bx + x, ay, by + y), (x, y, x + columns, y + rows)))
    return ColourAtlas(atlas, tuple(slots), slot_of_label, min(1, len(slots) - 1))


def _bytes(picture: FloatArray) -> ByteArray:
    return np.clip(np.round(picture), 0, 255).astype(np.uint8)


def _crop(
    picture: ByteArray, scale: float, frame: ImageFrame, bounds: NDArray[Any]
) -> tuple[ByteArray, tuple[float, float, float, float]]:
    """Crop a picture to `bounds` (2, 3) in FIGURE, reduced to the size for a page; return it and its place.

    scale : pixels of `picture` for each IMAGE pixel
    """
    corners = frame.image_from_figure(np.array([[bounds[0, 0], bounds[1, 1]], [bounds[1, 0], bounds[0, 1]]])) * scale
    size = np.array([picture.shape[1], picture.shape[0]])
    first = np.clip(np.floor(corners[0]).astype(int) - GAP_PX, 0, size - 1)
    last = np.clip(np.ceil(corners[1]).astype(int) + GAP_PX, first + 1, size)
    cut = picture[first[1] : last[1], first[0] : last[0]]
    factor = max(1.0, max(cut.shape[:2]) / MAX_PX)
    columns, rows = (max(1, round(n / factor)) for n in (cut.shape[1], cut.shape[0]))
    image = Image.fromarray(cut)
    if factor > 1:
        image = image.resize((columns, rows), Image.Resampling.BOX)
    x_scale, y_scale = scale * columns / cut.shape[1], scale * rows / cut.shape[0]
    (x, y), units = frame.origin_px, frame.units_per_px
    left, top = ((origin - float(start) / scale) for origin, start in zip((x, y), first, strict=True))
    place = (x_scale / units, left * x_scale, -y_scale / units, top * y_scale)
    return np.asarray(image), place


def depth_map(body: Body) -> DepthMap:
    """Depth of the first surface of the parts from the drawing's viewer, far away along +z.

    Fillets are left out, so that one map serves pages that trace them and pages that do not: points of a fillet lie in
    front of it, and points behind a fillet are hidden.
    """
    body = Body(body.parts)
    low, high = body.bounds().astype(np.float64)
    step = float((high - low)[:2].max()) / (DEPTH_PX - 4)
    columns, rows = (int(np.ceil(extent / step)) + 4 for extent in (high - low)[:2])
    centre = (low + high) / 2
    rays = orthographic(0, size=(columns, rows), height=rows * step, centre=centre, distance=1 + high[2] - centre[2])
    hits = trace(body, rays, with_normals=False)
    z = np.where(hits.hit, 1 + high[2] - hits.depth, NOTHING).reshape(rows, columns)
    place = (1 / step, columns / 2 - centre[0] / step, -1 / step, rows / 2 + centre[1] / step)
    return DepthMap(z.astype(np.float16), place)
