"""Backgrounds of drawn figures: white, tinted or stained paper, and maps."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.training.drawing.marks import LETTERS, FloatImage, blur, composite, noise, stroke, write

# fmt: off
BACKGROUNDS: Final = {"white": 0.22, "tint": 0.12, "paper": 0.26, "coast": 0.14, "realms": 0.1, "fields": 0.08,
                      "town": 0.08}
# fmt: on
"""Kind → probability."""

PLAIN: Final = ("white", "tint", "paper")
"""Kinds that are not maps."""

PAPERS: Final = ((250, 247, 238), (244, 234, 212), (236, 220, 188), (226, 205, 165), (238, 236, 230), (222, 214, 200))
# fmt: off
TINTS: Final = ((233, 196, 178), (206, 214, 178), (242, 222, 160), (188, 206, 210), (222, 190, 198), (214, 196, 160),
                (186, 200, 172))
# fmt: on
SEAS: Final = ((186, 206, 206), (206, 218, 214), (160, 190, 198), (222, 222, 206))
INKS: Final = ((50, 40, 34), (96, 66, 44), (30, 30, 34), (70, 64, 84))
ROOFS: Final = ((206, 100, 78), (184, 88, 70), (120, 110, 104), (216, 150, 110))


def draw_background(kind: str, shape: tuple[int, int], rng: np.random.Generator) -> FloatImage:
    """Draw a background of a kind in `BACKGROUNDS`, (H, W, 3) float32 0-255."""
    if kind == "white":
        return np.full((*shape, 3), 255, np.float32)
    if kind == "tint":
        return np.broadcast_to(rng.uniform(185, 252, 3).astype(np.float32), (*shape, 3)).copy()
    paper = _paper(shape, rng)
    if kind == "paper":
        return paper
    maps = {"coast": _coast, "realms": _realms, "fields": _fields, "town": _town}
    chart = maps[kind](np.full_like(paper, 255), rng)
    if rng.random() < 0.5:
        chart = composite(chart, _pick(rng, INKS), _graticule(shape, rng))
    chart = composite(chart, _pick(rng, INKS), _lettering(shape, rng))
    return blur(np.asarray(chart * paper / 255, np.float32), 0.35 * shape[0] / 256)


def _paper(shape: tuple[int, int], rng: np.random.Generator) -> FloatImage:
    """Paper with grain, blotches, sometimes stains and folds."""
    scale = shape[0] / 256
    tone = 1 + 0.012 * rng.standard_normal(shape).astype(np.float32) + 0.018 * noise(rng, shape, 4, 3)
    for _ in range(int(rng.poisson(0.8))):
        rim = noise(rng, shape, 3, 3) - rng.uniform(1.0, 1.8)
        tone -= rng.uniform(0.02, 0.08) * np.clip(rim * 3, 0, 1) + 0.05 * np.exp(-((rim * 8) ** 2))
    if rng.random() < 0.25:
        fold = np.zeros(shape, np.float32)
        for place in rng.uniform(0.2, 0.8, 2):
            stroke(fold, [[place * shape[1], 0], [place * shape[1] + rng.normal(0, 3), shape[0]]], 1.2 * scale)
        tone -= 0.1 * fold
    return np.asarray(np.clip(np.array(_pick(rng, PAPERS)) * tone[..., None], 0, 255), np.float32)


def _coast(chart: FloatImage, rng: np.random.Generator) -> FloatImage:
    """Land and sea with water lines along the shore, hills with hachures, rivers."""
    shape = chart.shape[:2]
    scale = shape[0] / 256
    height = noise(rng, shape, rng.uniform(1.5, 3), 5) + rng.uniform(-0.4, 0.8)
    ink = _pick(rng, INKS)
    land, sea = _pick(rng, TINTS if rng.random() < 0.6 else PAPERS), _pick(rng, SEAS)
    chart = np.where((height > 0)[..., None], np.float32(land), np.float32(sea)).astype(np.float32)
    slope = np.maximum(_slope(height), 1e-4)
    away = -height / slope  # pixels out to sea, roughly
    for ring in range(1, int(rng.integers(2, 5))):
        gap = 3.5 * ring * scale
        chart = composite(chart, ink, 0.4 / ring * np.clip(1 - np.abs(away - gap) / scale, 0, 1).astype(np.float32))
    chart = composite(chart, ink, np.clip(1.1 - np.abs(away) / scale, 0, 1).astype(np.float32))
    river = noise(rng, shape, 2, 4)
    thin = np.clip(1 - np.abs(river) / np.maximum(_slope(river), 1e-4) / scale, 0, 1)
    chart = composite(chart, _pick(rng, (*SEAS, ink)), (thin * (height > 0.1)).astype(np.float32))
    return composite(chart, ink, 0.7 * _hachures(height, rng))


def _realms(chart: FloatImage, rng: np.random.Generator) -> FloatImage:
    """Areas in flat tints with dashed borders between them, and roads."""
    shape = chart.shape[:2]
    scale = shape[0] / 256
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    x, y = x + 12 * scale * noise(rng, shape, 5, 3), y + 12 * scale * noise(rng, shape, 5, 3)
    seeds = rng.uniform(0, 1, (int(rng.integers(4, 9)), 2)) * shape[::-1]
    away = np.stack([np.hypot(x - sx, y - sy) for sx, sy in seeds])
    tints = np.array([_pick(rng, TINTS) for _ in seeds], np.float32)
    first, second = np.sort(away, axis=0)[:2]
    rim = np.exp(-(second - first) / (14 * scale)) if rng.random() < 0.5 else np.ones(shape)
    chart = composite(chart, tints[away.argmin(axis=0)], rim.astype(np.float32))
    dashes = np.sin((x + y) / (1.3 * scale)) > -0.3
    border = np.clip(1.5 - (second - first) / (2 * scale), 0, 1) * dashes
    return composite(
        composite(chart, _pick(rng, INKS), border.astype(np.float32)), _pick(rng, INKS), _roads(shape, rng)
    )


def _fields(chart: FloatImage, rng: np.random.Generator) -> FloatImage:
    """Long parcels side by side, ditches and a winding canal."""
    shape = chart.shape[:2]
    scale = shape[0] / 256
    along, across = _turned(shape, rng, bend=4)
    strip = rng.uniform(8, 18) * scale
    ditch = np.clip(1 - np.abs((across / strip + 0.5) % 1 - 0.5) * strip / scale, 0, 1)
    block = rng.uniform(50, 90) * scale
    ditch = np.maximum(ditch, np.clip(1.3 - np.abs((along / block + 0.5) % 1 - 0.5) * block / scale, 0, 1))
    column, row = np.floor(across / strip).astype(int), np.floor(along / block).astype(int)
    tinted = rng.random((61, 61))[column % 61, row % 61] < rng.uniform(0, 0.35)
    chart = composite(chart, _pick(rng, TINTS), tinted.astype(np.float32))
    chart = composite(chart, _pick(rng, INKS), 0.7 * ditch.astype(np.float32))
    canal = np.abs(across - rng.uniform(-60, 60) * scale - 20 * scale * noise(rng, shape, 2)) / scale
    chart = composite(chart, _pick(rng, INKS), (canal < 4.5).astype(np.float32))
    return composite(chart, _pick(rng, ((140, 168, 140), (150, 180, 176))), (canal < 3.5).astype(np.float32))


def _town(chart: FloatImage, rng: np.random.Generator) -> FloatImage:
    """Blocks of houses between streets."""
    shape = chart.shape[:2]
    scale = shape[0] / 256
    ink = _pick(rng, INKS)
    along, across = _turned(shape, rng, bend=10)
    block = rng.uniform(24, 48, 2) * scale
    row, column = np.floor(along / block[0]).astype(int), np.floor(across / block[1]).astype(int)
    # Distance inwards from the block's edge.
    inward = np.minimum(*(np.minimum(p % b, b - p % b) for p, b in ((along, block[0]), (across, block[1])))) / scale
    kind = rng.random((53, 53))[row % 53, column % 53]
    house = (inward > 2.5) & (inward < 8) & (kind < 0.7)
    lot = rng.uniform(3, 5) * scale
    wall = ((along % lot < scale) | (across % lot < scale)) & house
    chart = composite(
        chart, _pick(rng, ((150, 172, 130), (172, 186, 150))), ((inward > 2.5) & (kind > 0.86)).astype(np.float32)
    )
    gone = rng.random((97, 97))[np.floor(along / lot).astype(int) % 97, np.floor(across / lot).astype(int) % 97] < 0.15
    chart = composite(chart, _pick(rng, ROOFS), (house & ~gone).astype(np.float32))
    chart = composite(chart, ink, 0.55 * wall.astype(np.float32))
    return composite(chart, ink, 0.6 * np.clip(1 - np.abs(inward - 2), 0, 1).astype(np.float32))


def _turned(shape: tuple[int, int], rng: np.random.Generator, bend: float) -> tuple[FloatImage, FloatImage]:
    """Two perpendicular coordinates in pixels, rotated at random and slightly bent."""
    angle, scale = rng.uniform(0, np.pi), shape[0] / 256
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32) - np.float32(shape[0] / 2)
    along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    return (
        (along + bend * scale * noise(rng, shape, 2)).astype(np.float32),
        (across + bend * scale * noise(rng, shape, 2)).astype(np.float32),
    )


def _hachures(height: FloatImage, rng: np.random.Generator) -> FloatImage:
    """Short strokes down the slopes of the higher ground."""
    ink = np.zeros(height.shape, np.float32)
    scale = height.shape[0] / 256
    down, right = _gradient(blur(height, 4 * scale))
    for y, x in rng.uniform(3, np.array(height.shape) - 3, (int(rng.integers(0, 160)), 2)):
        row, column = int(y), int(x)
        steep = np.array([right[row, column], down[row, column]])
        if height[row, column] > 0.7 and (size := float(np.hypot(*steep))) > 1e-6:
            stroke(ink, [[x, y], np.array([x, y]) - steep / size * rng.uniform(3, 6) * scale], 0.9 * scale)
    return ink


def _roads(shape: tuple[int, int], rng: np.random.Generator) -> FloatImage:
    """Double and single lines across the map, and towns as rings."""
    ink = np.zeros(shape, np.float32)
    scale = shape[0] / 256
    for _ in range(int(rng.integers(1, 4))):
        ends = rng.uniform(-0.1, 1.1, (2, 2)) * shape[::-1]
        t = np.linspace(0, 1, 9)[:, None]
        way = ends[0] * (1 - t) + ends[1] * t + np.cumsum(rng.normal(0, 3 * scale, (9, 2)), axis=0)
        hollow = np.zeros(shape, np.float32)
        stroke(ink, way, 3 * scale)
        stroke(hollow, way, 1.6 * scale)
        ink *= 1 - hollow
        stroke(ink, way[rng.integers(9)], 5 * scale)
    return ink


def _graticule(shape: tuple[int, int], rng: np.random.Generator) -> FloatImage:
    """Faint meridians and parallels."""
    scale = shape[0] / 256
    gap, tilt, bend = rng.uniform(35, 90) * scale, rng.normal(0, 0.1), rng.normal(0, 0.15)
    y, x = np.mgrid[: shape[0], : shape[1]].astype(np.float32) - np.float32(rng.uniform(0, shape[0]))
    lines = [x + tilt * y + bend * x * y / shape[0], y - tilt * x + bend * x * x / shape[0]]
    near = np.minimum(*(np.abs((line / gap + 0.5) % 1 - 0.5) * gap for line in lines))
    return np.asarray(0.5 * np.clip(1 - near / scale, 0, 1), np.float32)


def _lettering(shape: tuple[int, int], rng: np.random.Generator) -> FloatImage:
    """Random letters as words, anywhere, most of them nearly level."""
    ink = np.zeros(shape, np.float32)
    scale = shape[0] / 256
    for _ in range(int(rng.integers(0, 9))):
        text = "".join(rng.choice(list(LETTERS), int(rng.integers(3, 11))).tolist())
        height = rng.choice([5.0, 7.0, 7.0, 10.0, 14.0]) * scale
        spacing = float(rng.choice([1.0, 1.0, 3.0, 6.0]))
        write(ink, text, rng.uniform(-0.1, 0.9, 2) * shape[::-1], height, float(rng.normal(0, 0.25)), spacing)
    return ink * np.float32(0.85)


def _gradient(field: FloatImage) -> tuple[FloatImage, FloatImage]:
    down, right = np.gradient(field)
    return np.asarray(down, np.float32), np.asarray(right, np.float32)


def _slope(field: FloatImage) -> NDArray[np.float32]:
    return np.asarray(np.hypot(*_gradient(field)), np.float32)


def _pick(rng: np.random.Generator, options: tuple[Any, ...]) -> Any:
    return options[int(rng.integers(len(options)))]
