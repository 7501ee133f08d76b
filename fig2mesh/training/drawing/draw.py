"""Turn the view of a body into a picture that looks drawn.

`random_style` chooses once for all views of a body; `draw` applies it. Every random choice comes from the given
generator. VIEW: x to the right as seen, y up, z to the viewer.

Measured on one core: 30 ms per picture of 256 x 256, 130 ms per one of 512 x 512 shrunk to it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import PART
from fig2mesh.training.drawing.background import PLAIN, draw_background
from fig2mesh.training.drawing.faces import Face, draw_face
from fig2mesh.training.drawing.marks import FloatImage, blur, composite, distance, noise, warp
from fig2mesh.training.drawing.styles import Style, pattern_coverage, random_style

JUMP: Final = 0.05
"""Depth step that makes a contour, FIGURE units; a slope may add to it."""


class Layers(NamedTuple):
    """Layers of a view of a body.

    labels : (H, W) uint8, `PART_NAMES`; 0 where nothing
    material : (H, W) int, index of the material; -1 where nothing
    uv : (H, W, 2) float32, body texture coordinates
    depth : (H, W) float32, VIEW z in FIGURE units; -inf where nothing
    normals : (H, W, 3) float32, VIEW
    """

    labels: NDArray[np.uint8]
    material: NDArray[np.integer]
    uv: NDArray[np.float32]
    depth: NDArray[np.float32]
    normals: NDArray[np.float32]


def draw(
    layers: Layers,
    materials: Sequence[str],
    rng: np.random.Generator,
    *,
    style: Style | None = None,
    face: Face | None = None,
    shrink: int = 1,
    paper: FloatImage | None = None,
) -> NDArray[np.uint8]:
    """Draw a picture, (H / shrink, W / shrink, 3) uint8, opaque.

    materials : names, as `random_style` takes them; eyes count as skin, since faces are drawn
    style : None for a random one
    face : position of the face; None where it is not visible
    shrink : edge of the squares of pixels averaged into one, for smooth edges
    paper : (H, W, 3) 0-255 background; None to draw one of the style's kind
    """
    style = random_style(materials, rng) if style is None else style
    layers = layers._replace(material=_without_eyes(layers.material, materials))
    seen = layers.material >= 0
    shape = (seen.shape[0], seen.shape[1])
    scale = shape[0] / 256
    paper = draw_background(style.background, shape, rng) if paper is None else paper
    picture = _filled(paper, layers, seen, style, rng)
    lines = ink(layers, style, rng)
    if face is not None:
        hair = style.colours[list(materials).index("hair")] if "hair" in materials else np.array([60, 44, 34])
        canvas = seen & (layers.labels == PART["head"]) & (layers.material == _skin(materials))
        picture = draw_face(picture, face, canvas, style, hair, rng)
    picture = composite(picture, style.ink, lines)
    picture = blur(picture, style.softness * scale)
    if style.speckle:
        picture = np.asarray(picture + style.speckle * rng.standard_normal((*shape, 1)), np.float32)
    if shrink > 1:
        picture = picture.reshape(shape[0] // shrink, shrink, shape[1] // shrink, shrink, 3).mean(axis=(1, 3))
    return np.asarray(np.clip(np.rint(picture), 0, 255), np.uint8)


def contours(layers: Layers, joints: bool = False) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """(H, W) bool each: pixels of the silhouette's contour, and pixels on the nearer side of the contours inside it.

    joints : count changes of the part label even where material and surface go on
    """
    seen = layers.material >= 0
    outer, inner = np.zeros(seen.shape, np.bool_), np.zeros(seen.shape, np.bool_)
    for axis in (0, 1):
        see, depth = np.moveaxis(seen, axis, 0), np.moveaxis(layers.depth, axis, 0)
        kind, part = np.moveaxis(layers.material, axis, 0), np.moveaxis(layers.labels, axis, 0)
        rim, line = np.moveaxis(outer, axis, 0), np.moveaxis(inner, axis, 0)
        both = see[1:] & see[:-1]
        step = np.full(both.shape, np.inf, np.float32)
        np.subtract(depth[1:], depth[:-1], out=step, where=both)
        size = np.abs(np.pad(step, ((1, 1), (0, 0)), constant_values=np.inf))
        # A steep but smooth surface has steep neighbours; a jump has none on at least one side. Beside the silhouette
        # only the other side is known.
        jump = size[1:-1] > JUMP + 2 * np.minimum(size[:-2], size[2:])
        edge = both & ((kind[1:] != kind[:-1]) | jump | ((part[1:] != part[:-1]) & joints))
        line[1:] |= edge & (step > 0)
        line[:-1] |= edge & (step <= 0)
        rim[1:] |= see[1:] & ~see[:-1]
        rim[:-1] |= see[:-1] & ~see[1:]
    return outer, inner


def ink(layers: Layers, style: Style, rng: np.random.Generator) -> FloatImage:
    """(H, W) float32 0-1, coverage of the pixels by lines: no wider than 4 px at 256, all 0 for a width of 0."""
    shape = (layers.material.shape[0], layers.material.shape[1])
    scale = shape[0] / 256
    swell = np.clip(1 + 0.3 * noise(rng, shape, 14), 0.5, 1.6)
    stray = [style.wobble * scale * np.clip(noise(rng, shape, 16), -2, 2) for _ in range(2)]
    gaps = noise(rng, shape, 30)
    if style.width == 0:
        return np.zeros(shape, np.float32)
    lines = np.zeros(shape, np.float32)
    for mask, width in zip(contours(layers, style.joints), (style.width * style.outline, style.width), strict=True):
        wide = np.minimum(width * swell, 4) * scale
        away = distance(mask, int(np.ceil(wide.max() / 2 + 1)))
        # A line finer than a pixel is paler instead.
        reach = np.clip(np.maximum(wide, 1) / 2 + 0.5 - away, 0, 1) * np.minimum(wide, 1)
        np.maximum(lines, reach, out=lines, casting="same_kind")
    if style.wobble:
        lines = np.asarray(warp(lines, *stray), np.float32)
    if style.broken:
        lines = lines * np.clip((gaps + 1.6 - 3 * style.broken) * 3, 0, 1).astype(np.float32)
    return np.asarray(lines, np.float32)


def uv_grain(layers: Layers) -> float:
    """UV units that one figure height takes, from the median stretch over the picture."""
    seen = layers.material >= 0
    rows = np.flatnonzero(seen.any(axis=1))
    if not len(rows):
        return 1.0
    same = (
        seen[1:] & seen[:-1] & (layers.material[1:] == layers.material[:-1]) & (layers.labels[1:] == layers.labels[:-1])
    )
    step = np.hypot(*np.moveaxis(np.diff(layers.uv, axis=0), -1, 0))[same]
    return max(float(np.median(step)) * (rows[-1] - rows[0] + 1), 1e-6) if len(step) else 1.0


def _filled(
    paper: FloatImage,
    layers: Layers,
    seen: NDArray[np.bool_],
    style: Style,
    rng: np.random.Generator,
) -> FloatImage:
    """The figure's filled areas on the paper, without lines."""
    shape, scale = paper.shape[:2], paper.shape[0] / 256
    shade = layers.normals @ np.asarray(style.light, np.float32)
    if style.fill == "paper":
        blank = composite(
            paper, (255, 255, 255), seen * np.float32(rng.choice([0.7, 1.0] if _is_map(style) else [0.0, 0.6, 1.0]))
        )
        dark = (style.colours.mean(axis=1) < 70)[np.maximum(layers.material, 0)] & seen
        return composite(blank, style.ink, dark * np.float32(rng.random() < 0.4))
    colour = style.colours[np.maximum(layers.material, 0)]
    if style.fill != "hatched":
        grain = uv_grain(layers)
        for index, pattern in enumerate(style.patterns):
            if pattern is not None and (here := layers.material == index).any():
                colour = composite(colour, pattern.colour, here * pattern_coverage(pattern, layers.uv, grain))
    if style.fill == "steps":
        colour = colour * np.where(shade < rng.uniform(0.35, 0.6), rng.uniform(0.68, 0.85), 1)[..., None]
        if rng.random() < 0.3:
            colour = composite(colour.astype(np.float32), (255, 255, 255), (0.35 * (shade > 0.96)).astype(np.float32))
    elif style.fill == "soft":
        colour = colour * (0.6 + 0.4 * np.clip(shade, 0, 1))[..., None]
    cover = seen.astype(np.float32)
    if style.fill == "wash":
        pools = 1 + 0.1 * noise(rng, shape, 6, 3) - 0.12 * np.clip(1 - shade, 0, 1)
        rim = blur(cover, 2.5 * scale) * cover
        strength = np.clip(1.15 - 0.45 * rim, 0, 1.2) * pools
        colour = 255 - (255 - colour) * np.clip(strength, 0.2, 1.2)[..., None]
        stray = [1.2 * scale * noise(rng, shape, 10, 2) for _ in range(2)]
    else:
        stray = [np.zeros(shape, np.float32)] * 2
    if style.fill == "wash" or style.slip != (0.0, 0.0):
        right, down = (stray[axis] + np.float32(style.slip[axis] * scale) for axis in (0, 1))
        # Colour and cover move together: pixels beyond the figure have a colour too, but no cover.
        colour, cover = warp(colour, right, down, nearest=True), warp(cover, right, down)
    if style.glaze:
        colour = colour * paper / 255
    picture = composite(paper, colour, np.asarray(cover, np.float32))
    return _hatched(picture, layers, shade, seen, style, rng) if style.fill == "hatched" else picture


def _hatched(
    picture: FloatImage,
    layers: Layers,
    shade: NDArray[np.float32],
    seen: NDArray[np.bool_],
    style: Style,
    rng: np.random.Generator,
) -> FloatImage:
    """Engraved hatching, thicker and crossed where it is darker; it bends with the form."""
    shape, scale = picture.shape[:2], picture.shape[0] / 256
    tone = style.colours.mean(axis=1)[np.maximum(layers.material, 0)] / 255
    pale = composite(picture, (250, 246, 238), seen * np.float32(rng.uniform(0.4, 1)))
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    form = np.where(seen, layers.depth, 0) * shape[0] * 0.15
    angle, gap = rng.uniform(0, np.pi), rng.uniform(2.6, 4) * scale
    dark = np.clip(1.25 - 0.6 * tone - np.clip(shade, 0, 1) * 0.75, 0, 1)
    for turn, start in ((0.0, 0.1), (1.2, 0.55)):
        line = x * np.cos(angle + turn) + y * np.sin(angle + turn) + form
        wave = 2 * np.abs((line / gap) % 1 - 0.5) * gap / 2  # distance from mid-gap, pixels
        width = np.clip((dark - start) * 1.1, 0, 1) * gap * 0.75
        lines = np.clip(width / 2 - (gap / 2 - wave) + 0.5, 0, 1) * np.minimum(width, 1) * seen
        pale = composite(pale, style.ink, lines.astype(np.float32))
    return pale


def _is_map(style: Style) -> bool:
    return style.background not in PLAIN


def _skin(materials: Sequence[str]) -> int:
    """Index of the skin, -2 when there is none."""
    return list(materials).index("skin") if "skin" in materials else -2


def _without_eyes(material: NDArray[np.integer], materials: Sequence[str]) -> NDArray[np.integer]:
    if "eye" not in materials or "skin" not in materials:
        return material
    return np.where(material == list(materials).index("eye"), _skin(materials), material)
