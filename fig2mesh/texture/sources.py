"""Colour sources of the surface: the drawing itself, and plain pictures for what it does not show.

The plain pictures keep the drawing's flat colours and lose what a draughtsman would not repeat at the back: contours,
buttons, eyes. Those of a layer's two sides are made by `fig2mesh.texture.layer_pictures`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage
from scipy.cluster.vq import kmeans2

from fig2mesh.image_frame import ImageFrame
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.outline import Outline
from fig2mesh.records import Figure
from fig2mesh.texture.bare import without_line
from fig2mesh.texture.drawn_line import drawn_line, paper_beside, with_soft_edge
from fig2mesh.texture.heads import find_face, in_profile
from fig2mesh.texture.layer_pictures import RasterDrawing, foreign_pixels, layer_pictures
from fig2mesh.texture.materials import find_materials
from fig2mesh.texture.painted import BlendedSides
from fig2mesh.texture.pen import DARK, Pen, find_pen, without_contour

CUT_OUT = 64
"""Threshold of mean alpha beside a figure, below which it counts as cut out of its picture."""

UNLIKE = 16.0
"""Least excess of a rim pixel's difference from the paper, RGB 0-255."""

MIN_ALPHA = 64
"""Least alpha of a pixel with a known colour."""

COLOURS = 16
"""Palette size; flat drawings have fewer, shaded ones lose little."""

LINE_WIDTH = 0.014
"""Half the largest width of strokes of ink, FIGURE units: colours that only occur in thinner ones are ink."""

PLAIN_SHARE = 0.625
"""Longest side of the plain pictures relative to the texture's: the texture shows no more of them."""

GRAZING = 0.0
"""Threshold of the normal's z: a contour at the rim is drawn out along the side. At -0.1 fronts come nearer to the
drawing by 0.3 dB or so, and sides have broader stripes; at 0.15 fronts lose 2 to 9 dB."""

GRAZING_BARE = 0.3
"""The same threshold without the contour: nothing is lost, and what is left of its soft edge is not drawn out."""


@dataclass(frozen=True)
class Sources:
    """Colour pictures in IMAGE pixels of the figure.

    seen : (H, W, 3) float32 sRGB 0-255; the drawing, its colours continued beyond the silhouette
    plain : part label → (h, w, 3) float32, colours of that part where something hides it from the viewer
    back : part label → (h, w, 3) float32, colours of that part where it looks away from the viewer; as `plain` for
        labels that it lacks
    plain_scale : IMAGE pixels → pixels of `plain` and `back`
    pen : of the drawing, its width in FIGURE units; None where it has no contours
    painted : the four sides by the texture networks, whose colours then replace `plain` and `back`; None otherwise
    grazing : least z of the smooth normal of a point coloured by the drawing. The smooth normal is compared, not the
        triangle's, so that the border between observed and inferred runs evenly across triangles
    """

    seen: NDArray[np.float32]
    plain: dict[int, NDArray[np.float32]]
    plain_scale: float
    pen: Pen | None = None
    grazing: float = GRAZING
    back: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    painted: BlendedSides | None = None


def make_sources(
    figure: Figure,
    frame: ImageFrame,
    outline: Outline,
    texture_size: int,
    seed: int,
    contours: bool = True,
) -> Sources:
    """Make the drawing and its plain version for each part of `outline`.

    contours : keep the line along the silhouette
    """
    seen = continued(figure.rgba, figure.mask)
    # A whole factor is the same in both directions, so that one number maps pixels.
    factor = max(1, int(max(figure.mask.shape) / (PLAIN_SHARE * texture_size)))
    small = np.asarray(Image.fromarray(seen.astype(np.uint8)).reduce(factor), dtype=np.float32)
    rows, columns = np.mgrid[0 : small.shape[0], 0 : small.shape[1]]
    points = frame.figure_from_image(np.stack([columns + 0.5, rows + 0.5], axis=-1) * factor)
    where = np.round(outline.canvas.pixels(points)).astype(int)
    labels = _lookup(outline.split.labels, where)
    if not labels.any():
        # A figure thinner than a pixel of the plain pictures lies between their centres.
        shown = outline.split.labels > 0
        at = frame.image_from_figure(outline.canvas.points()[shown])[:, ::-1] / factor
        row, column = np.clip(np.floor(at).astype(int), 0, np.array(labels.shape) - 1).T
        labels[row, column] = outline.split.labels[shown]
    own = labels > 0
    palette, index = _palette(small, own, seed)
    pitch = frame.units_per_px * factor
    ink = _ink(palette, index, own, LINE_WIDTH / pitch)
    pen = find_pen(palette, index, ink, own)
    canvas = outline.canvas
    # The line along the silhouette is no material: what it surrounds goes round.
    bare = without_silhouette_line(seen, figure, frame, canvas)
    if bare is not None:
        small = np.asarray(Image.fromarray(bare).reduce(factor), dtype=np.float32)
        index = _nearest(palette, small)
    materials = find_materials(small, palette, index, own, pen, pitch)
    joints = frame.figure_from_image(figure.joints_px)
    profile = in_profile(figure, frame, canvas)
    drawing = RasterDrawing(small, own, materials, pen, frame, factor, pitch, joints, profile)
    foreign = foreign_pixels(drawing, canvas, outline.split)
    face = find_face(figure, frame, canvas)
    plain: dict[int, NDArray[np.float32]] = {}
    back: dict[int, NDArray[np.float32]] = {}
    for layer in outline.split.layers:
        pictures = layer_pictures(drawing, canvas, layer, foreign, face)
        for part in np.unique(layer.labels[layer.labels > 0]).tolist():
            plain[part], back[part] = pictures.near, pictures.far
    grazing = GRAZING
    if pen is not None and not contours:
        seen, grazing = without_contour(seen, figure.mask, pen, pen.width * factor), GRAZING_BARE
    pen = None if pen is None else replace(pen, width=pen.width * pitch)
    return Sources(seen, plain, 1.0 / factor, pen, grazing, back)


def continued(rgba: NDArray[np.uint8], mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Extrapolate the inner colours of a picture outwards, so that no background is mixed in at the rim.

    In scans the outermost pixel is mixed with paper, unless it is a contour no wider than that. Cut-out figures have
    their own colour up to the rim.
    """
    alpha = rgba[..., 3]
    if not mask.all() and alpha[~mask].mean() < CUT_OUT:
        solid = mask & (alpha >= MIN_ALPHA)
    else:
        solid = ndimage.binary_erosion(mask, border_value=1) & (alpha > 250)
        solid |= mask & _unlike_paper(rgba, mask, solid)
    if not solid.any():
        solid = mask
    _, source = ndimage.distance_transform_edt(~solid, return_indices=True)
    return np.asarray(rgba[..., :3][tuple(source)], np.float32)


def _unlike_paper(rgba: NDArray[np.uint8], mask: NDArray[np.bool_], solid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) bool: pixels that differ more from the paper beside them than the figure's inner pixels do."""
    paper = ~ndimage.binary_dilation(mask, iterations=2)
    if not paper.any() or not solid.any():
        return np.zeros_like(mask)
    picture = rgba[..., :3].astype(np.float32)
    ground, inner = (
        picture[tuple(ndimage.distance_transform_edt(~there, return_distances=False, return_indices=True))]
        for there in (paper, solid)
    )
    own, within = (np.linalg.norm(colour - ground, axis=-1) for colour in (picture, inner))
    return np.asarray(own > within + UNLIKE)


def _lookup(image: NDArray[np.uint8], where: NDArray[np.int_]) -> NDArray[np.uint8]:
    rows, columns = where[..., 0], where[..., 1]
    valid = (rows >= 0) & (rows < image.shape[0]) & (columns >= 0) & (columns < image.shape[1])
    return np.where(valid, image[np.clip(rows, 0, image.shape[0] - 1), np.clip(columns, 0, image.shape[1] - 1)], 0)


def without_silhouette_line(
    picture: NDArray[np.float32], figure: Figure, frame: ImageFrame, canvas: Canvas
) -> NDArray[np.uint8] | None:
    """(H, W, 3) sRGB, a figure's picture without the line along its silhouette; None where it has none.

    picture : (H, W, 3) 0-255, its colours continued beyond the silhouette
    """
    down, right = np.gradient(canvas.sdf, canvas.pitch)
    slope = np.stack([right, -down], axis=-1)
    rim = canvas.inside & (canvas.sdf > -canvas.pitch) & (np.linalg.norm(slope, axis=-1) > 0.5)
    if not rim.any():
        return None
    outwards = slope[rim] / np.linalg.norm(slope[rim], axis=-1, keepdims=True)
    points = canvas.points()[rim] - canvas.sdf[rim][:, None] * outwards
    paper = paper_beside(figure.rgba, figure.mask)
    line = drawn_line(picture, frame, points, outwards, np.ones(len(points), bool), paper)
    if not len(line.pens):
        return None
    width = np.nan_to_num(with_soft_edge(line.width, frame.units_per_px))
    return without_line(picture, figure.mask, frame, points, width, line.color, margin_px=2)


def _nearest(palette: NDArray[np.float32], picture: NDArray[np.float32]) -> NDArray[np.int_]:
    """(h, w) index of the palette's colour nearest to each pixel."""
    return np.asarray(np.argmin(((picture[..., None, :] - palette) ** 2).sum(axis=-1), axis=-1))


def _palette(
    picture: NDArray[np.float32], own: NDArray[np.bool_], seed: int
) -> tuple[NDArray[np.float32], NDArray[np.int_]]:
    """(K, 3) colours of the figure and the (h, w) index of the nearest one for every pixel."""
    pixels = picture[own]
    random = np.random.default_rng(seed)
    sample = pixels[random.permutation(len(pixels))[:20_000]].astype(np.float64)
    distinct = np.unique(np.round(sample / 8), axis=0)
    count = min(COLOURS, len(distinct))
    centres, _ = kmeans2(sample, count, minit="++", seed=random, iter=12)
    centres = centres[np.isfinite(centres).all(axis=1)].astype(np.float32)
    index = _nearest(centres, picture)
    # The mean of a cluster is a mixed colour; the median is one that the drawing has.
    for i in range(len(centres)):
        members = picture[own & (index == i)]
        if len(members):
            centres[i] = np.median(members, axis=0)
    return centres.astype(np.float32), np.asarray(index)


def _ink(
    palette: NDArray[np.float32], index: NDArray[np.int_], own: NDArray[np.bool_], width: float
) -> NDArray[np.float64]:
    """(K,) weight of each palette colour: near 0 for dark colours that only occur as strokes, 1 for fills.

    Light colours in thin pieces are patterns: dots, checks, stripes. They keep their weight.
    """
    weight = np.ones(len(palette))
    luminance = palette @ np.array([0.2126, 0.7152, 0.0722]) / 255.0
    light = np.clip((luminance - DARK) / DARK, 0.0, 1.0)
    for i in range(len(palette)):
        area = own & (index == i)
        if area.any():
            core = ndimage.distance_transform_edt(area) > max(width, 1.0)
            if core.any():
                fill = ndimage.distance_transform_edt(~core) <= width + 1.0
                weight[i] = max(float((fill & area).sum() / area.sum()), 0.05) ** 2
            else:
                weight[i] = 0.05**2
    return np.asarray(np.maximum(weight, light))
