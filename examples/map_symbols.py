"""Symbols and lettering of the pictorial map, as SVG; places are pixels of the sheet, sizes too."""

from __future__ import annotations

import random

INK, LAND, PALE, WATER, SHORE, ROAD = "#4a3728", "#f1e5c4", "#f8f0d8", "#a9cfd6", "#3f7482", "#b5533c"
FOREST, HILL, WALL, ROOF, SPIRE, NAME_OF_WATER = "#6f8f5a", "#d9c08c", "#fbf4e2", "#c0563f", "#4f7d86", "#2f6170"


def curve(*words: str | float) -> str:
    """The data of a path: letters and numbers."""
    return " ".join(word if isinstance(word, str) else f"{word:.1f}" for word in words)


def line(d: str, colour: str, width: float, more: str = "") -> str:
    """A stroke with round ends."""
    ends = 'stroke-linecap="round" stroke-linejoin="round"'
    return f'<path d="{d}" fill="none" stroke="{colour}" stroke-width="{width}" {ends} {more}/>'


def shape(d: str, fill: str, width: float, more: str = "") -> str:
    """A filled outline in ink."""
    return f'<path d="{d}" fill="{fill}" stroke="{INK}" stroke-width="{width}" stroke-linejoin="round" {more}/>'


def box(x: float, y: float, width: float, height: float, fill: str, ink: float = 1.8) -> str:
    """A rectangle from its upper left corner; ink: width of its outline."""
    size = f'x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"'
    return f'<rect {size} fill="{fill}"' + (f' stroke="{INK}" stroke-width="{ink}"/>' if ink else "/>")


def ellipse(x: float, y: float, rx: float, ry: float, fill: str, more: str = "") -> str:
    return f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{rx:.1f}" ry="{ry:.1f}" fill="{fill}" {more}/>'


def hill(x: float, y: float, size: float, draw: random.Random) -> str:
    """A molehill with its shade to the right."""
    w, h = size, 0.62 * size
    left, top = x - 0.1 * w, y - h
    rise = ("C", x - 0.7 * w, y - 0.2 * h, x - 0.45 * w, top, left, top)
    outline = curve("M", x - w, y, *rise, "C", x + 0.3 * w, top, x + 0.6 * w, y - 0.25 * h, x + w, y)
    strokes = []
    for i in range(9):
        t = i / 8
        reach = (0.30 + 0.12 * draw.random()) * h * (1 - 0.5 * t)
        start = (left + t * 0.75 * w, top + (0.08 + 0.72 * t**1.6) * h)
        strokes.append(curve("M", *start, "q", 0.02 * w, 0.5 * reach, -0.05 * w, reach))
    ground = f'<path d="{outline} Z" fill="{HILL}" opacity="0.85"/>'
    return ground + line(outline, INK, 2.6) + line(" ".join(strokes), INK, 1.7, 'opacity="0.75"')


def tree(x: float, y: float, size: float) -> str:
    stem = line(curve("M", x, y, "v", -0.35 * size), INK, 2.2)
    outline = f'stroke="{INK}" stroke-width="1.6"'
    crown = ellipse(x, y - 0.78 * size, 0.42 * size, 0.52 * size, FOREST, outline)
    bow = ("q", 0.24 * size, -0.15 * size, 0.18 * size, -0.45 * size)
    shade = line(curve("M", x + 0.1 * size, y - 0.45 * size, *bow), INK, 1.3, 'opacity="0.7"')
    return stem + crown + shade


def house(x: float, y: float, size: float) -> str:
    w, h = size, 0.75 * size
    roof = curve("M", x - 0.65 * w, y - h, "L", x, y - h - 0.62 * w, "L", x + 0.65 * w, y - h, "Z")
    door = box(x - 0.12 * w, y - 0.5 * h, 0.24 * w, 0.5 * h, INK, 0)
    return box(x - w / 2, y - h, w, h, WALL) + shape(roof, ROOF, 1.8) + door


def church(x: float, y: float, size: float) -> str:
    w, eaves, top = 0.5 * size, y - 1.5 * size, y - 2.7 * size
    spire = curve("M", x - 0.75 * w, eaves, "L", x, top, "L", x + 0.75 * w, eaves, "Z")
    cross = curve("M", x, top, "v", -0.45 * size, "m", -0.15 * size, 0.15 * size, "h", 0.3 * size)
    return box(x - w / 2, eaves, w, 1.5 * size, WALL) + shape(spire, SPIRE, 1.8) + line(cross, INK, 1.8)


def text(
    x: float, y: float, words: str, size: float, style: str = "", anchor: str = "middle", halo: bool = True
) -> str:
    """Lettering; halo: the land's colour round it, so that it can be read over lines."""
    at = f'x="{x:.1f}" y="{y:.1f}" font-family="STIXGeneral" font-size="{size}" text-anchor="{anchor}" {style}'
    ground = f'stroke="{LAND}" stroke-width="6" stroke-linejoin="round" fill="{LAND}" opacity="0.85"'
    return (f"<text {at} {ground}>{words}</text>" if halo else "") + f'<text {at} fill="{INK}">{words}</text>'


def along(d: str, words: str, size: float, spacing: float, name: str) -> str:
    """Lettering of water along a path; name: of the path, unique in the sheet."""
    font = f'font-family="STIXGeneral" font-style="italic" font-size="{size}" letter-spacing="{spacing}"'
    letters = f'<textPath href="#{name}" startOffset="0">{words}</textPath>'
    return f'<path id="{name}" d="{d}" fill="none"/><text {font} fill="{NAME_OF_WATER}">{letters}</text>'
