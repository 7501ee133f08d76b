"""Noise, blur, distance, brush strokes and letters for drawn pictures, in NumPy alone.

Pictures are (H, W) or (H, W, C) float32; pixel centres lie at +0.5, row 0 on top; positions are (x, y) in pixels.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

FloatImage = NDArray[np.float32]

LETTERS: Final = {
    letter: bytes.fromhex(columns)
    for letter, columns in {
        "A": "7e1111117e",
        "B": "7f49494936",
        "C": "3e41414122",
        "D": "7f4141221c",
        "E": "7f49494941",
        "F": "7f09090901",
        "G": "3e4149497a",
        "H": "7f0808087f",
        "I": "00417f4100",
        "K": "7f08142241",
        "L": "7f40404040",
        "M": "7f020c027f",
        "N": "7f0408107f",
        "O": "3e4141413e",
        "P": "7f09090906",
        "R": "7f09192946",
        "S": "4649494931",
        "T": "01017f0101",
        "U": "3f4040403f",
        "V": "1f2040201f",
        "W": "3f4038403f",
        "Y": "0708700807",
        "Z": "6151494543",
    }.items()
}
"""Letters of 5 x 7 dots: one byte per column, the lowest bit on top."""


def noise(rng: np.random.Generator, shape: tuple[int, int], cells: float, octaves: int = 1) -> FloatImage:
    """(H, W) smooth random field of mean 0 and variance about 1, with `cells` cells across the wider side.

    octaves : number of fields, each twice as fine and half as strong as the one before, that are added up
    """
    total = np.zeros(shape, np.float64)
    power = 0.0
    for octave in range(octaves):
        pitch = max(shape) / (cells * 2**octave)
        down, across = (_spline(count, pitch) for count in shape)
        grid = rng.standard_normal((down.shape[1], across.shape[1]))
        total += 0.5**octave * (down @ grid @ across.T)
        power += 0.25**octave
    # The square of a cubic B-spline has the integral 151/315 along each axis.
    return np.asarray(total / (151 / 315 * np.sqrt(power)), np.float32)


def blur(picture: FloatImage, sigma: float) -> FloatImage:
    """Gaussian blur along rows and columns; the border is repeated outwards."""
    if sigma <= 0:
        return picture
    reach = max(int(np.ceil(2.5 * sigma)), 1)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights /= weights.sum()
    for axis in (0, 1):
        width = [(reach, reach) if a == axis else (0, 0) for a in range(picture.ndim)]
        padded = np.moveaxis(np.pad(picture, width, mode="edge"), axis, 0)
        count = picture.shape[axis]
        mixed = sum(float(weight) * padded[tap : tap + count] for tap, weight in enumerate(weights))
        picture = np.moveaxis(np.asarray(mixed, np.float32), 0, axis)
    return np.ascontiguousarray(picture)


def distance(mask: NDArray[np.bool_], reach: int) -> FloatImage:
    """(H, W) distance to the nearest pixel of a mask, exact up to `reach` pixels, infinite beyond."""
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    squared = np.where(mask, np.float32(0), np.float32(np.inf))
    for axis in (0, 1):
        source, squared = squared, squared.copy()
        ahead, behind = np.moveaxis(squared, axis, 0), np.moveaxis(source, axis, 0)
        for step in range(1, reach + 1):
            np.minimum(ahead[step:], behind[:-step] + np.float32(step * step), out=ahead[step:])
            np.minimum(ahead[:-step], behind[step:] + np.float32(step * step), out=ahead[:-step])
    return np.asarray(np.sqrt(squared), np.float32)


def warp(picture: NDArray[Any], right: FloatImage, down: FloatImage, *, nearest: bool = False) -> NDArray[Any]:
    """Sample the picture at each pixel's position plus (right, down) pixels; the border is repeated outwards."""
    height, width = picture.shape[:2]
    row = np.clip(np.arange(height, dtype=np.float32)[:, None] + down, 0, height - 1)
    column = np.clip(np.arange(width, dtype=np.float32) + right, 0, width - 1)
    if nearest:
        return np.asarray(picture[np.rint(row).astype(int), np.rint(column).astype(int)])
    top, left = np.minimum(row.astype(int), height - 2), np.minimum(column.astype(int), width - 2)
    fy, fx = row - top, column - left
    if picture.ndim == 3:
        fy, fx = fy[..., None], fx[..., None]
    upper = picture[top, left] * (1 - fx) + picture[top, left + 1] * fx
    lower = picture[top + 1, left] * (1 - fx) + picture[top + 1, left + 1] * fx
    return np.asarray(upper * (1 - fy) + lower * fy, np.float32)


def stroke(coverage: FloatImage, points: Any, width: float) -> None:
    """Draw a line through `points` (N, 2) with a round brush into `coverage` (H, W), 0-1, in place.

    One point makes a dot. A brush finer than a pixel leaves a paler line.
    """
    line = np.asarray(points, np.float32).reshape(-1, 2)
    line = np.repeat(line, 2, axis=0) if len(line) == 1 else line
    for start, end in pairwise(line):
        box = _box(coverage.shape, np.stack([start, end]), width / 2 + 1)
        if box is None:
            continue
        rows, columns, x, y = box
        along = end - start
        length = max(float(along @ along), 1e-9)
        share = np.clip(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / length, 0, 1)
        away = np.hypot(x - start[0] - share * along[0], y - start[1] - share * along[1])
        ink = np.clip(max(width, 1.0) / 2 + 0.5 - away, 0, 1) * min(width, 1.0)
        np.maximum(coverage[rows, columns], ink, out=coverage[rows, columns])


def ellipse(shape: tuple[int, ...], centre: Any, radii: tuple[float, float], angle: float = 0.0) -> FloatImage:
    """(H, W) coverage 0-1 of a filled ellipse with a soft rim of one pixel; angle in radians from x towards y."""
    out = np.zeros(shape[:2], np.float32)
    rx, ry = max(radii[0], 0.3), max(radii[1], 0.3)
    box = _box(shape, np.asarray(centre, np.float32)[None], max(rx, ry) + 1)
    if box is not None:
        rows, columns, x, y = box
        dx, dy = x - centre[0], y - centre[1]
        along, across = dx * np.cos(angle) + dy * np.sin(angle), dy * np.cos(angle) - dx * np.sin(angle)
        out[rows, columns] = np.clip((1 - np.hypot(along / rx, across / ry)) * min(rx, ry) + 0.5, 0, 1)
    return out


def write(coverage: FloatImage, text: str, at: Any, height: float, angle: float = 0.0, spacing: float = 1.0) -> None:
    """Draw `text` from the upper left corner `at`, in place; letters not in `LETTERS` leave a gap.

    height : of the letters, pixels; angle : radians from x towards y; spacing : dots between letters
    """
    dot = height / 7
    step = 5 + spacing
    end = np.asarray(at, np.float32) + len(text) * step * dot * np.array([np.cos(angle), np.sin(angle)], np.float32)
    box = _box(coverage.shape, np.stack([np.asarray(at, np.float32), end]), height + 1)
    if box is None or not text:
        return
    dots = np.zeros((7, 5, len(text)), np.float32)
    for place, letter in enumerate(text):
        for column, bits in enumerate(LETTERS.get(letter, bytes(5))):
            dots[:, column, place] = [bits >> bit & 1 for bit in range(7)]
    rows, columns, x, y = box
    dx, dy = x - at[0], y - at[1]
    along = (dx * np.cos(angle) + dy * np.sin(angle)) / dot
    across = (dy * np.cos(angle) - dx * np.sin(angle)) / dot
    place, row = np.floor(along / step).astype(int), np.floor(across).astype(int)
    column = np.floor(along - place * step).astype(int)
    hit = (place >= 0) & (place < len(text)) & (row >= 0) & (row < 7) & (column < 5)
    ink = np.where(hit, dots[np.clip(row, 0, 6), np.clip(column, 0, 4), np.clip(place, 0, len(text) - 1)], 0)
    np.maximum(coverage[rows, columns], ink, out=coverage[rows, columns])


def composite(picture: FloatImage, colour: Any, coverage: FloatImage) -> FloatImage:
    """Alpha composite a colour, or another picture, over the picture (H, W, 3); `coverage` (H, W) is its alpha."""
    return np.asarray(picture + (np.asarray(colour, np.float32) - picture) * coverage[..., None], np.float32)


def _spline(count: int, pitch: float) -> NDArray[np.float64]:
    """(count, K) weights of uniform cubic B-splines, `pitch` pixels apart, at the pixel centres."""
    at = (np.arange(count) + 0.5) / pitch
    base = np.floor(at).astype(int)
    t = at - base
    weights = np.zeros((count, int(base[-1]) + 4))
    for tap, value in enumerate(((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)):
        weights[np.arange(count), base + tap] = value / 6
    return weights


def _box(
    shape: tuple[int, ...], points: NDArray[np.float32], margin: float
) -> tuple[slice, slice, FloatImage, FloatImage] | None:
    """Rows, columns, x and y of the pixels around some points; None where they are all outside the picture."""
    low, high = np.floor(points.min(axis=0) - margin).astype(int), np.ceil(points.max(axis=0) + margin).astype(int)
    left, top = np.maximum(low, 0).tolist()
    right, bottom = min(int(high[0]), shape[1]), min(int(high[1]), shape[0])
    if left >= right or top >= bottom:
        return None
    x = np.arange(left, right, dtype=np.float32)[None] + np.float32(0.5)
    y = np.arange(top, bottom, dtype=np.float32)[:, None] + np.float32(0.5)
    return slice(top, bottom), slice(left, right), x, y
