"""Styles of drawing: inks, palettes, fills and cloth patterns, chosen once for all views of a body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from fig2mesh.training.drawing.background import BACKGROUNDS, PLAIN

T = TypeVar("T")
Fill = Literal["flat", "steps", "soft", "wash", "hatched", "paper"]

# fmt: off
FILLS: Final[dict[Fill, float]] = {"flat": 0.34, "steps": 0.2, "soft": 0.08, "wash": 0.14, "hatched": 0.1,
                                   "paper": 0.14}
# fmt: on
"""Flat colour, two tones, soft shading, watercolour, engraved shading, bare paper inside the lines."""
PALETTES: Final = {"map": 0.28, "bright": 0.32, "duo": 0.12, "greys": 0.1, "any": 0.18}
PATTERNS: Final = {"none": 0.5, "stripes": 0.14, "plaid": 0.1, "dots": 0.1, "checks": 0.06, "hatching": 0.1}
INKS: Final = {(16, 14, 14): 0.6, (74, 48, 30): 0.2, (26, 32, 74): 0.13, (120, 40, 30): 0.07}
"""Line colours: black, brown, dark blue, rust."""

# fmt: off
SKINS: Final = ((255, 228, 206), (250, 206, 176), (238, 184, 146), (214, 156, 112), (178, 118, 78), (128, 82, 54),
                (84, 54, 40))
# fmt: on
"""From light to dark; every colour between two neighbours may occur."""
# fmt: off
HAIRS: Final = ((30, 26, 26), (58, 40, 30), (92, 58, 34), (140, 92, 48), (206, 162, 88), (236, 208, 140), (170, 72, 36),
                (200, 60, 40), (150, 148, 146), (232, 230, 226))
# fmt: on
# fmt: off
MAP_TINTS: Final = ((200, 118, 96), (222, 168, 128), (216, 190, 120), (150, 166, 116), (112, 146, 134), (120, 152, 166),
                    (96, 110, 140), (164, 118, 136), (120, 92, 70), (232, 218, 190), (196, 176, 142))
# fmt: on
# fmt: off
BRIGHTS: Final = ((226, 40, 44), (250, 140, 30), (252, 208, 46), (86, 176, 70), (30, 150, 150), (40, 130, 220),
                  (30, 50, 140), (130, 70, 170), (240, 110, 160), (255, 255, 255), (40, 40, 44),
                  (140, 220, 230))
# fmt: on


@dataclass(frozen=True)
class Pattern:
    """A cloth pattern.

    kind : one of `PATTERNS`; colour : (3,) 0-255, laid over the cloth's own
    period : length of one repeat, share of the figure's height; angle : radians, in the body's UV space
    share : of the repeat that the pattern's colour takes, 0-1
    """

    kind: str
    colour: tuple[float, float, float]
    period: float
    angle: float
    share: float


@dataclass(frozen=True)
class Style:
    """One way to draw. Lengths are pixels of a picture of 256 pixels; pictures of other sizes scale them.

    fill : one of `FILLS`; colours : (n_materials, 3) float32 0-255; patterns : one per material
    ink : (3,) 0-255 colour of lines; width : of inner lines, 0 for none; outline : factor for the silhouette
    wobble : random displacement of lines; broken : share of the lines' length that is left out
    joints : draw lines between limbs of the same cloth
    light : (3,) unit vector to the light, VIEW
    background : one of `BACKGROUNDS`; glaze : let the paper show through the colours
    slip : (2,) offset of fills against lines, as in cheap prints; beard : "none", "full", "moustache" or "goatee"
    eyes : "dots", "ovals" or "open"
    softness : of the scan, standard deviation of a blur; speckle : of its noise, 0-255
    """

    fill: Fill
    colours: NDArray[np.float32]
    patterns: tuple[Pattern | None, ...]
    ink: tuple[float, float, float]
    width: float
    outline: float
    wobble: float
    broken: float
    joints: bool
    light: tuple[float, float, float]
    background: str
    glaze: bool
    slip: tuple[float, float]
    beard: str
    eyes: str
    softness: float = 0.0
    speckle: float = 0.0


def random_style(materials: Sequence[str], rng: np.random.Generator, colours: NDArray[Any] | None = None) -> Style:
    """Choose a style for a body of `materials` ("skin", "hair", "hat", "shoe", "eye", "cloth.<piece>").

    colours : (n_materials, 3) 0-255; None to choose them
    """
    fill = _choose(rng, FILLS)
    lined = fill == "paper" or rng.random() < (0.75 if fill in ("flat", "steps", "soft") else 0.85)
    width = float(np.exp(rng.normal(np.log(1.2), 0.35))) if lined else 0.0
    name = _choose(rng, PALETTES)
    own = palette(name, materials, rng)
    chosen = own if colours is None else np.asarray(colours, np.float32)
    side, lift = rng.uniform(-1, 1), rng.uniform(0.2, 0.9)
    background = _choose(rng, BACKGROUNDS)
    # Through a glaze, a map's lines would cross the figure; drawn maps leave their figures blank.
    shine = 0.1 if background not in PLAIN else 0.8 if fill == "wash" else 0.3
    light = np.array([side, lift, 0.9]) / np.linalg.norm([side, lift, 0.9])
    return Style(
        fill=fill,
        colours=chosen,
        patterns=tuple(_pattern(material, rng, name) for material in materials),
        ink=_choose(rng, INKS),
        width=float(np.clip(width, 0, 2.2)) if lined else 0.0,
        outline=float(rng.choice([1.0, 1.4, 1.8])),
        wobble=float(rng.choice([0.0, 0.4, 0.9])),
        broken=float(rng.choice([0.0, 0.0, 0.0, 0.12])),
        joints=bool(rng.random() < 0.12),
        light=(float(light[0]), float(light[1]), float(light[2])),
        background=background,
        glaze=bool(rng.random() < shine),
        slip=(float(rng.normal(0, 1)), float(rng.normal(0, 1))) if fill == "wash" or rng.random() < 0.1 else (0.0, 0.0),
        beard=str(rng.choice(["none", "none", "none", "none", "full", "moustache", "goatee"])),
        eyes=str(rng.choice(["dots", "ovals", "open"])),
        softness=float(rng.uniform(0.3, 0.7) * (rng.random() < 0.3)),
        speckle=float(rng.uniform(0, 5) * (rng.random() < 0.3)),
    )


def palette(name: str, materials: Sequence[str], rng: np.random.Generator) -> NDArray[np.float32]:
    """(n_materials, 3) float32 0-255 colours of a kind in `PALETTES`."""
    duo = np.array([(244, 238, 224), _pick(rng, MAP_TINTS + BRIGHTS), _pick(rng, tuple(INKS))], float)
    out = []
    for material in materials:
        if material in ("skin", "eye"):
            place = rng.uniform(0, len(SKINS) - 1)
            low = min(int(place), len(SKINS) - 2)
            colour = np.array(SKINS[low]) * (low + 1 - place) + np.array(SKINS[low + 1]) * (place - low)
        elif material == "hair":
            colour = _pick(rng, HAIRS) + rng.normal(0, 6, 3)
        elif name == "map":
            colour = _pick(rng, MAP_TINTS) + rng.normal(0, 8, 3)
        elif name == "bright":
            colour = _pick(rng, BRIGHTS) + rng.normal(0, 6, 3)
        else:
            colour = rng.uniform(0, 255, 3)
        if name == "greys":
            colour = np.full(3, colour.mean())
        elif name == "duo":
            colour = duo[int(rng.integers(2 if material in ("skin", "eye") else 3))]
        out.append(np.clip(colour, 8, 255))
    colours = np.array(out, np.float32).reshape(-1, 3)
    for index, material in enumerate(materials):
        if material == "eye" and "skin" in materials:
            colours[index] = colours[list(materials).index("skin")]
    return colours


def pattern_coverage(pattern: Pattern, uv: NDArray[np.float32], grain: float) -> NDArray[np.float32]:
    """(H, W) 0-1, coverage by a pattern's own colour.

    uv : (H, W, 2) body texture coordinates; grain : UV units that one figure height takes
    """
    along = uv[..., 0] * np.cos(pattern.angle) + uv[..., 1] * np.sin(pattern.angle)
    across = uv[..., 1] * np.cos(pattern.angle) - uv[..., 0] * np.sin(pattern.angle)
    first, second = (_wave(line / (pattern.period * grain)) for line in (along, across))
    edge = 1 - pattern.share
    if pattern.kind == "stripes":
        field = _step(first, edge)
    elif pattern.kind == "plaid":
        thin = np.maximum(_wave_line(along, pattern, grain), _wave_line(across, pattern, grain))
        field = np.maximum(0.5 * (_step(first, edge) + _step(second, edge)), thin)
    elif pattern.kind == "dots":
        away = np.asarray(np.hypot(1 - first, 1 - second), np.float32)
        field = _step(np.asarray(1 - away, np.float32), 0.35 + 0.4 * edge)
    elif pattern.kind == "checks":
        low, high = _step(first, 0.5), _step(second, 0.5)
        field = low + high - 2 * low * high
    else:
        field = np.maximum(_step(first, 0.75), _step(second, 0.75) if pattern.share > 0.4 else 0)
    return np.asarray(field, np.float32)


def _wave_line(line: NDArray[np.float32], pattern: Pattern, grain: float) -> NDArray[np.float32]:
    """Fine lines between the bands of a plaid."""
    return np.asarray(_step(_wave(np.asarray(line / (pattern.period * grain) + 0.5, np.float32)), 0.93), np.float32)


def _wave(phase: NDArray[np.float32]) -> NDArray[np.float32]:
    """A triangle wave: 1 at whole numbers, 0 half-way."""
    return np.asarray(2 * np.abs((phase % 1) - 0.5), np.float32)


def _step(wave: NDArray[np.float32], edge: float) -> NDArray[np.float32]:
    """1 where the wave exceeds `edge`, with a soft rim."""
    return np.asarray(np.clip((wave - edge) / 0.12 + 0.5, 0, 1), np.float32)


def _pattern(material: str, rng: np.random.Generator, name: str) -> Pattern | None:
    """A random pattern for cloth; None for anything else, and often for cloth."""
    kind, period, angle, share = _choose(rng, PATTERNS), rng.uniform(0.018, 0.06), rng.random(), rng.uniform(0.25, 0.6)
    accent = palette(name, ("cloth",), rng)[0].tolist() if kind != "hatching" else [40.0, 34.0, 30.0]
    if not material.startswith("cloth") or kind == "none":
        return None
    turn = float(rng.choice([0, 0.5, 0.5, 0.25, angle]) * np.pi)
    return Pattern(kind, (accent[0], accent[1], accent[2]), float(period), turn, float(share))


def _choose(rng: np.random.Generator, weights: dict[T, float]) -> T:
    """One of the keys, at random by weight."""
    share = np.cumsum(list(weights.values()))
    return list(weights)[int(np.searchsorted(share, rng.random() * share[-1], side="right"))]


def _pick(rng: np.random.Generator, colours: tuple[tuple[int, int, int], ...]) -> NDArray[np.float64]:
    return np.array(colours[int(rng.integers(len(colours)))], np.float64)
