"""Pictures of the near and the far side of each layer, for points that the drawing does not show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.image_frame import ImageFrame
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.split import Layer, Split
from fig2mesh.skeleton import PART
from fig2mesh.texture.axes import bone_axes
from fig2mesh.texture.heads import DrawnFace, head_materials
from fig2mesh.texture.materials import Materials
from fig2mesh.texture.patterns import patterned, striped
from fig2mesh.texture.pen import Pen, lined_pairs, reinked
from fig2mesh.texture.tints import continued_tints, drawn_tints
from fig2mesh.texture.window import PITCH, LayerWindow, window_around
from fig2mesh.texture.wrap import (
    PATTERN_WINDOW,
    RimColours,
    Sheet,
    back_materials,
    covered,
    front_materials,
    rim_colours,
    settled,
)

MIN_SURE: Final = 0.6
"""Least median share of the votes for the materials of a rim."""

HATCHED: Final = 0.6
"""Least share of ink in a print by lines, whose hatching is its pattern."""

ON_BONE: Final = 0.35
"""Distance from a limb's bone, its radii, within which lies what belongs to the limb."""


@dataclass(frozen=True)
class RasterDrawing:
    """Drawing on the raster of the plain pictures.

    picture : (h, w, 3) float32 0-255, colours continued beyond the silhouette
    own : (h, w) bool, the figure; factor : IMAGE pixels per pixel; pitch : FIGURE units per pixel
    joints : (21, 2) FIGURE x, y; profile : drawn from the side; ink : see `Materials`
    """

    picture: NDArray[np.float32]
    own: NDArray[np.bool_]
    materials: Materials
    pen: Pen | None
    frame: ImageFrame
    factor: int
    pitch: float
    joints: NDArray[np.float64]
    profile: bool = False


@dataclass(frozen=True)
class LayerPictures:
    """near, far : (h, w, 3) float32 0-255, colours of the sides towards and away from the viewer."""

    near: NDArray[np.float32]
    far: NDArray[np.float32]


def layer_pictures(
    drawing: RasterDrawing,
    canvas: Canvas,
    layer: Layer,
    foreign: NDArray[np.bool_],
    face: DrawnFace | None,
) -> LayerPictures:
    """Pictures of one layer.

    foreign : (h, w) bool, pixels of the drawing that are not the layer's although the split has them there
    """
    # A figure of one pixel may lie between those of the canvas.
    everywhere = np.ones_like(layer.region)
    region = next(each for each in (layer.region, layer.shown, canvas.inside, everywhere) if each.any())
    window = window_around(region, canvas, drawing.frame, drawing.factor)
    sheet = _sheet(drawing, canvas, layer, foreign, face, window)
    front_share = front_materials(sheet)
    front = front_share.argmax(axis=-1)
    rim = rim_colours(sheet, front)
    mirrored = drawing.profile or _unsure(sheet, rim)
    if drawing.profile:
        back_share = front_share
    elif mirrored:
        back_share = covered(sheet, front_share)
    else:
        back_share = back_materials(sheet, rim, front)
    near, far = (settled(share, sheet.region, PITCH) for share in (front_share, back_share))
    index = near.argmax(axis=-1), far.argmax(axis=-1)
    tints = _tints(drawing, window, sheet, *index)
    reach = window.reach(drawing.own.shape)
    kinds = [_upsampled(window, share, reach) for share in (near, far)]
    shown = (drawing.own & ~foreign)[reach] & np.asarray(_shown(window, layer, canvas, reach))
    colour, pen = drawing.materials.colour, _cut(drawing.pen, reach)
    lined = lined_pairs(colour, kinds[0], shown, pen)
    pictures = []
    for kind, tint in zip(kinds, tints, strict=True):
        plain = reinked(colour, kind, lined, pen)
        if tint is not None:
            plain = plain + np.stack([window.to_picture(tint[..., c], reach) for c in range(3)], axis=-1)
        pictures.append(plain)
    region, head = (window.to_picture(mask.astype(np.float64), reach) > 0.5 for mask in (sheet.region, sheet.head))
    marked = drawing.materials.index[reach]
    if not mirrored:
        # Lines of seams, folds and plackets are no pattern; hatching and the lines of a profile are.
        marked = np.where(drawing.materials.ink[reach], kinds[0], marked)
    drawn = patterned(marked, kinds[0], shown, region, PATTERN_WINDOW / drawing.pitch)
    stripes = striped(front, sheet.shown & sheet.region & ~sheet.head, PATTERN_WINDOW / PITCH)
    drawn |= shown & (window.to_picture(stripes.astype(np.float64), reach) > 0.5)
    drawn &= ~head & (kinds[0] == kinds[1])
    original = drawing.picture[reach]
    pictures = [np.where(drawn[..., None], original, picture) for picture in pictures]
    near_picture, far_picture = (_whole(picture, reach, drawing.own.shape) for picture in pictures)
    return LayerPictures(near_picture, far_picture)


def _unsure(sheet: Sheet, rim: RimColours) -> bool:
    """Whether a rim shows strokes rather than colours, as prints do: its colours would be accidents."""
    own = sheet.region & sheet.shown
    return bool((own.any() and sheet.ink[own].mean() > HATCHED) or np.median(rim.share) < MIN_SURE)


def _sheet(
    drawing: RasterDrawing,
    canvas: Canvas,
    layer: Layer,
    foreign: NDArray[np.bool_],
    face: DrawnFace | None,
    window: LayerWindow,
) -> Sheet:
    labels = np.asarray(window.of_canvas(layer.labels, canvas))
    region = np.asarray(window.of_canvas(layer.region, canvas), bool)
    if not region.any():
        region = np.zeros(window.shape, bool)
        region[window.shape[0] // 2, window.shape[1] // 2] = True
    points = window.points()
    shown = np.asarray(window.of_canvas(layer.shown, canvas), bool) & ~np.asarray(window.of_picture(foreign), bool)
    index = np.asarray(window.of_picture(drawing.materials.index))
    ink = np.asarray(window.of_picture(drawing.materials.ink), bool)
    axis = bone_axes(labels, drawing.joints, points, PITCH)
    head = np.isin(labels, (PART["head"], PART["hair"]))
    stroke = drawing.materials.width * drawing.pitch / PITCH
    number = len(drawing.materials.colour)
    own_face = None if face is None or not head.any() else face.at(points)
    skin = None
    if own_face is not None:
        skin = head_materials(own_face, head & region, index, shown & ~ink, drawing.materials.colour, PITCH)
    return Sheet(region, shown, index, ink, axis, number, PITCH, stroke, head, own_face, skin)


def _tints(
    drawing: RasterDrawing, window: LayerWindow, sheet: Sheet, near: NDArray[np.int_], far: NDArray[np.int_]
) -> list[NDArray[np.float64] | None]:
    """Tints of the two sides; None where all materials have one colour."""
    flat = drawing.materials.flat
    if flat[np.union1d(near[sheet.region], far[sheet.region])].all():
        return [None, None]
    picture = np.asarray(window.of_picture(drawing.picture))
    clear = sheet.shown & sheet.region & ~sheet.ink
    tints, known = drawn_tints(picture, sheet.index, clear, near, drawing.materials.colour, flat, PITCH)
    inner = ndimage.binary_erosion(sheet.region)
    front = continued_tints(tints, known & sheet.shown, sheet.region, near)
    rim = sheet.region & ~inner & (near == far)
    if drawing.profile:
        rim = sheet.region
    back = continued_tints(front, rim, sheet.region, far)
    return [_outwards(image, sheet.region) for image in (front, back)]


def _outwards(image: NDArray[np.float64], region: NDArray[np.bool_]) -> NDArray[np.float64]:
    _, source = ndimage.distance_transform_edt(~region, return_indices=True)
    return np.asarray(image[tuple(source)])


def _upsampled(window: LayerWindow, share: NDArray[np.float64], reach: tuple[slice, slice]) -> NDArray[np.int_]:
    """(h, w) material with the largest share at pixels of the picture."""
    used = np.flatnonzero(share.reshape(-1, share.shape[-1]).max(axis=0) > 1e-6)
    best: NDArray[np.float32] | None = None
    result = np.zeros((0, 0), int)
    for k in used:
        value = window.to_picture(share[..., k], reach)
        if best is None:
            best, result = value, np.full(value.shape, int(k))
        else:
            better = value > best
            best[better], result[better] = value[better], k
    return result


def _shown(window: LayerWindow, layer: Layer, canvas: Canvas, reach: tuple[slice, slice]) -> NDArray[np.bool_]:
    shown = np.asarray(window.of_canvas(layer.shown, canvas), bool)
    return np.asarray(window.to_picture(shown.astype(np.float64), reach) > 0.5)


def _cut(pen: Pen | None, reach: tuple[slice, slice]) -> Pen | None:
    return None if pen is None else Pen(pen.colour, pen.width, pen.near[reach])


def _whole(picture: NDArray[np.float32], reach: tuple[slice, slice], shape: tuple[int, int]) -> NDArray[np.float32]:
    """Continue a part of a picture to the whole of it by its border."""
    row, column = (
        np.clip(np.arange(size), span.start, min(span.stop, size) - 1) - span.start
        for span, size in zip(reach, shape, strict=True)
    )
    return np.asarray(picture[np.ix_(row, column)], np.float32)


def foreign_pixels(drawing: RasterDrawing, canvas: Canvas, divided: Split) -> NDArray[np.bool_]:
    """(h, w) bool: pixels that the split attributes to a layer although they are slivers of another's areas."""
    from fig2mesh.texture.owners import slivers

    if drawing.own.any() and drawing.materials.ink[drawing.own].mean() > HATCHED:
        return np.zeros_like(drawing.own)
    number, bones = np.full(canvas.sdf.shape, -1), np.zeros(canvas.sdf.shape, bool)
    points = canvas.points()
    for index, layer in enumerate(divided.layers):
        number[layer.shown] = index
        if layer.limb is not None:
            own = points[layer.shown]
            away = np.linalg.norm(own[:, None] - layer.limb.points, axis=-1) - ON_BONE * layer.limb.radius
            bones[layer.shown] |= away.min(axis=1) < 0
    height, width = drawing.own.shape
    rows, columns = np.mgrid[0:height, 0:width]
    at = canvas.pixels(drawing.frame.figure_from_image(np.stack([columns + 0.5, rows + 0.5], axis=-1) * drawing.factor))
    row, column = np.clip(np.round(at).astype(int), 0, np.array(number.shape) - 1).transpose(2, 0, 1)
    layers = np.where(drawing.own, number[row, column], -1)
    return slivers(layers, drawing.materials.index, drawing.materials.ink, bones[row, column], drawing.pitch)
