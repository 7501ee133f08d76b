"""Draws the pictorial map in `maps/lake_zurich/`: land, lakes, rivers, roads, hills, names, and three people on it.

    python -m examples.draw_map [OUT]

writes to OUT, by default back into `maps/lake_zurich/`: map.jpg; map.jgw, the world file that places it, and map.prj,
which says in what (WGS 84 longitude and latitude, linear in the pixels); figures.csv, one row a figure: its picture,
where its feet are on the sheet (pixels, as in IMAGE: middles of pixels at +0.5), its height in metres at the sheet's
scale, and its box.

Shores, streams and towns are where they are to about 300 m, drawn by hand for this map; nothing is copied from others.
"""

from __future__ import annotations

import base64
import csv
import io
import json
import math
import random
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pyproj
import resvg_py
from PIL import Image

from examples.map_symbols import (
    INK,
    LAND,
    PALE,
    ROAD,
    SHORE,
    WATER,
    along,
    box,
    church,
    curve,
    ellipse,
    hill,
    house,
    line,
    shape,
    text,
    tree,
)

HERE = Path(__file__).resolve().parent
FIGURES, MAPS = HERE / "figures", HERE / "maps"
SHEET = json.loads((MAPS / "lake_zurich" / "sheet.json").read_text(encoding="utf-8"))
WEST, SOUTH, EAST, NORTH = SHEET["edges"]
WIDTH, HEIGHT = 2040, 1560
METRES_PER_DEGREE = (75_600.0, 111_180.0)
"""East and north, at the middle of the sheet: pixels are square there, 20 m."""

Point = tuple[float, float]

PEOPLE = tuple(tuple(person) for person in SHEET["people"])
"""Figure and where its feet are, longitude and latitude."""
TALL = 310
"""Pixels from top to sole."""


def pixel(lon: float, lat: float) -> Point:
    """Where a place is on the sheet, pixels from its upper left corner."""
    return (lon - WEST) / (EAST - WEST) * WIDTH, (NORTH - lat) / (NORTH - SOUTH) * HEIGHT


def place(x: float, y: float) -> Point:
    """Longitude and latitude of a point of the sheet."""
    return WEST + x / WIDTH * (EAST - WEST), NORTH - y / HEIGHT * (NORTH - SOUTH)


def path(points: Sequence[Point], closed: bool = False) -> str:
    """A smooth curve through places: Catmull-Rom as Bézier."""
    at = [pixel(*point) for point in points]
    around = [at[-1], *at, at[0], at[1]] if closed else [at[0], *at, at[-1]]
    words = [f"M{at[0][0]:.1f},{at[0][1]:.1f}"]
    for a, b, c, d in zip(around, around[1:], around[2:], around[3:], strict=False):
        first = (b[0] + (c[0] - a[0]) / 6, b[1] + (c[1] - a[1]) / 6)
        second = (c[0] - (d[0] - b[0]) / 6, c[1] - (d[1] - b[1]) / 6)
        words.append("C" + " ".join(f"{x:.1f},{y:.1f}" for x, y in (first, second, c)))
    return " ".join(words) + ("Z" if closed else "")


def waters() -> Iterable[str]:
    for name, river in SHEET["rivers"].items():
        width = 9 if name == "Limmat" else 6
        yield line(path(river), SHORE, width + 2.5)
        yield line(path(river), WATER, width - 1.5)
    for number, lake in enumerate(SHEET["lakes"].values()):
        d, name = path(lake, closed=True), f"water{number}"
        yield f'<clipPath id="{name}"><path d="{d}"/></clipPath><path d="{d}" fill="{WATER}"/>'
        # Lines along the shore, fainter towards the middle.
        for width, opacity in ((52, 0.16), (34, 0.24), (18, 0.34)):
            band = line(d, "#5f9cab", width, f'opacity="{opacity}"') + line(d, WATER, width - 3)
            yield f'<g clip-path="url(#{name})">{band}</g>'
        yield line(d, SHORE, 3.2)


def frame() -> Iterable[str]:
    """Neat line, graticule, and degrees along them."""
    inset = 40
    yield f'<g opacity="0.28" stroke="{INK}" stroke-width="1.4">'
    lons, lats = [8.4 + 0.1 * i for i in range(6)], [47.2, 47.25, 47.3, 47.35, 47.4]
    for lon in lons:
        x = pixel(lon, NORTH)[0]
        yield f'<path d="M{x:.1f},{inset} V{HEIGHT - inset}"/>'
    for lat in lats:
        y = pixel(WEST, lat)[1]
        yield f'<path d="M{inset},{y:.1f} H{WIDTH - inset}"/>'
    yield "</g>"
    rim = f"M0,0 H{WIDTH} V{HEIGHT} H0Z M{inset},{inset} V{HEIGHT - inset} H{WIDTH - inset} V{inset}Z"
    yield f'<path d="{rim}" fill="{PALE}" fill-rule="evenodd"/>'
    # Minutes, dark and light in turn.
    step_x, step_y = WIDTH / (EAST - WEST) / 60, HEIGHT / (NORTH - SOUTH) / 60
    for i in range(int((EAST - WEST) * 60) + 1):
        x = pixel(math.ceil(WEST * 60) / 60, NORTH)[0] + i * step_x
        if i % 2 == 0:
            for y in (inset - 12, HEIGHT - inset):
                left, right = max(x, inset), min(x + step_x, WIDTH - inset)
                if right > left:
                    yield box(left, y, right - left, 12, INK, 0)
    for i in range(int((NORTH - SOUTH) * 60) + 1):
        y = pixel(WEST, math.floor(NORTH * 60) / 60)[1] + i * step_y
        if i % 2 == 0:
            for x in (inset - 12, WIDTH - inset):
                top, bottom = max(y, inset), min(y + step_y, HEIGHT - inset)
                if bottom > top:
                    yield box(x, top, 12, bottom - top, INK, 0)
    for gap, width in ((inset, 2), (inset - 12, 2), (inset - 18, 4)):
        yield box(gap, gap, WIDTH - 2 * gap, HEIGHT - 2 * gap, "none", width)
    for lon in lons:
        x = pixel(lon, NORTH)[0]
        for y in (18, HEIGHT - 6):
            yield text(x, y, f"{lon:.1f}° E", 17, halo=False)
    for lat in lats:
        y = pixel(WEST, lat)[1]
        for x, turn in ((16, -90), (WIDTH - 16, 90)):
            yield f'<g transform="rotate({turn} {x} {y:.1f})">{text(x, y + 4, f"{lat:.2f}° N", 17, halo=False)}</g>'


def title() -> Iterable[str]:
    x, y = 1660, 132
    yield shape(f"M{x - 300},{y - 66} q300,-26 600,0 l-14,36 14,62 q-300,24 -600,0 l14,-60Z", PALE, 3.5)
    yield text(x, y - 8, "AROUND LAKE ZÜRICH", 43, 'font-weight="bold" letter-spacing="2"', halo=False)
    yield text(x, y + 27, "its people, its towns and its hills", 25, 'font-style="italic"', halo=False)
    # A bar of five kilometres.
    left, low, km = 1500, 236, 1000 / METRES_PER_DEGREE[0] / (EAST - WEST) * WIDTH
    for i in range(5):
        yield box(left + i * km, low, km, 9, PALE if i % 2 else INK)
    for i in (0, 1, 5):
        yield text(left + i * km, low - 8, f"{i} km" if i == 5 else str(i), 19)


def rose() -> Iterable[str]:
    x, y, r = 1905, 1420, 62
    yield f'<circle cx="{x}" cy="{y}" r="{0.62 * r}" fill="none" stroke="{INK}" stroke-width="1.8"/>'
    for turn, reach in ((45, 0.62), (0, 1.0)):
        for i in range(4):
            angle = math.radians(turn + 90 * i)
            tip = (x + reach * r * math.sin(angle), y - reach * r * math.cos(angle))
            for side, fill in ((-1, INK), (1, PALE)):
                a = angle + side * math.pi / 4
                foot = (x + 0.18 * r * math.sin(a), y - 0.18 * r * math.cos(a))
                yield shape(curve("M", x, y, "L", *foot, "L", *tip, "Z"), fill, 1.4)
    yield text(x, y - r - 8, "N", 30, 'font-weight="bold"')


def houses(town: dict[str, Any], draw: random.Random) -> Iterable[tuple[float, str]]:
    """A church and some houses round it, each with how far down it stands."""
    (x, y), size = pixel(*town["at"]), town["size"]
    yield y, church(x, y, 13 + 2 * size)
    for _ in range({1: 2, 2: 4, 4: 12}[size]):
        dx, dy = draw.uniform(-1, 1) * 8 * (1 + size), draw.uniform(-0.5, 0.5) * 6 * (1 + size)
        yield y + dy, house(x + dx, y + dy + 2, draw.uniform(12, 16))


def names() -> Iterable[str]:
    """Lettering of waters, towns and hills."""
    for number, (words, name) in enumerate(SHEET["names_along"].items()):
        yield along(path(name["along"]), words, name["size"], name["spacing"], f"name{number}")
    for words, town in SHEET["towns"].items():
        (x, y), size, (dx, dy) = pixel(*town["at"]), town["size"], town["name_px"]
        shown, style = (words.upper() if size == 4 else words), 'font-weight="bold"' if size > 1 else ""
        yield text(x + dx, y + dy, shown, {1: 24, 2: 28, 4: 40}[size], style, town["anchor"])
    for words, hills in SHEET["hills"].items():
        if words:
            yield text(*pixel(*hills["name_at"]), words, 23, 'font-style="italic"')


def people() -> list[dict[str, str | float]]:
    """One row a figure: picture, feet on the sheet, height at its scale, box."""
    rows: list[dict[str, str | float]] = []
    for name, lon, lat in PEOPLE:
        with Image.open(FIGURES / name / "mask.png") as mask:
            left, top, right, bottom = mask.getbbox()
        scale = TALL / (bottom - top)
        x, y = (round(v, 1) for v in pixel(lon, lat))
        feet = feet_of(name, top, bottom)
        box = [x + (left - feet) * scale, y - TALL, x + (right - feet) * scale, y]
        metres = TALL * METRES_PER_DEGREE[1] * (NORTH - SOUTH) / HEIGHT
        rows.append(
            {
                "name": name.replace("_", " "),
                "figure": f"../../figures/{name}/image.png",
                "keypoints": f"../../figures/{name}/keypoints.json",
                "map": "map.jpg",
                "x": x,
                "y": y,
                "height-m": round(metres, 1),
                "box_on_map": " ".join(str(round(v)) for v in box),
            }
        )
    return rows


def feet_of(name: str, top: int, bottom: int) -> float:
    """The column of the drawing between the feet that stand."""
    joints = json.loads((FIGURES / name / "keypoints.json").read_text(encoding="utf-8"))["keypoints"]
    feet = [[(joints[f"{side}_ankle"][i] + joints[f"{side}_foot"][i]) / 2 for i in range(2)] for side in "lr"]
    lowest = max(y for _, y in feet)
    standing = [x for x, y in feet if y > lowest - 0.12 * (bottom - top)]
    return sum(standing) / len(standing)


def drawn_person(row: dict[str, str | float]) -> str:
    folder = (MAPS / "lake_zurich" / str(row["figure"])).resolve().parent
    image, mask = Image.open(folder / "image.png"), Image.open(folder / "mask.png")
    cut = image.crop(mask.getbbox())
    stream = io.BytesIO()
    cut.save(stream, "PNG")
    x0, y0, x1, y1 = map(float, str(row["box_on_map"]).split())
    data = base64.b64encode(stream.getvalue()).decode()
    shade = ellipse(float(row["x"]), float(row["y"]) - 4, 0.36 * (x1 - x0), 13, INK, 'opacity="0.3"')
    place = f'x="{x0}" y="{y0}" width="{x1 - x0}" height="{y1 - y0}" preserveAspectRatio="none"'
    return shade + f'<image {place} href="data:image/png;base64,{data}"/>'


def svg(rows: Sequence[dict[str, str | float]]) -> str:
    """The sheet; the same one each time."""
    draw = random.Random(7)
    boxes = [tuple(map(float, str(row["box_on_map"]).split())) for row in rows]
    parts = [f'<rect width="{WIDTH}" height="{HEIGHT}" fill="{LAND}"/>', *waters()]
    for road in SHEET["roads"]:
        parts += [line(path(road), INK, 5.4, 'opacity="0.8"'), line(path(road), ROAD, 3.2)]
    things: list[tuple[float, str]] = []
    for hills in SHEET["hills"].values():
        things += [(pixel(lon, lat)[1], hill(*pixel(lon, lat), size, draw)) for lon, lat, size in hills["at_and_size"]]
    for lon, lat, rx, ry in SHEET["forests"]:
        for _ in range(int(26_000 * rx * ry) + 5):
            angle, reach = draw.uniform(0, 2 * math.pi), math.sqrt(draw.random())
            x, y = pixel(lon + rx * reach * math.cos(angle), lat + ry * reach * math.sin(angle))
            if not any(x0 - 14 < x < x1 + 14 and y0 - 6 < y < y1 + 30 for x0, y0, x1, y1 in boxes):
                things.append((y, tree(x, y, draw.uniform(22, 28))))
    for town in SHEET["towns"].values():
        things += list(houses(town, draw))
    parts += [drawing for _, drawing in sorted(things, key=lambda thing: thing[0])]
    parts += names()
    parts += [drawn_person(row) for row in rows]
    parts += [*frame(), *title(), *rose()]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}">'
        + "".join(parts)
        + "</svg>"
    )


def run(out_dir: str | Path = MAPS / "lake_zurich") -> list[Path]:
    """Write map.jpg, map.jgw, map.prj and figures.csv into `out_dir` and return them."""
    out_dir = Path(out_dir)
    out_dir.mkdir(parents=True, exist_ok=True)
    rows = people()
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    files = [str(fonts / f"STIXGeneral{style}.ttf") for style in ("", "Bol", "Italic", "BolIta")]
    png = resvg_py.svg_to_bytes(svg_string=svg(rows), skip_system_fonts=True, font_files=files)
    paper = np.asarray(Image.open(io.BytesIO(bytes(png))).convert("RGB")).astype(np.float32)
    # Grain and a darker rim, as old paper has.
    noise = np.random.default_rng(3).normal(0, 1, (HEIGHT // 4, WIDTH // 4)).astype(np.float32)
    grain = np.asarray(Image.fromarray(noise).resize((WIDTH, HEIGHT), Image.Resampling.BICUBIC))
    y, x = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j].astype(np.float32)
    rim = 1 - 0.10 * np.maximum(abs(x), abs(y)) ** 8
    picture = np.clip((paper + 2.2 * grain[..., None]) * rim[..., None], 0, 255).astype(np.uint8)
    sheet, world, reference, table = (out_dir / name for name in ("map.jpg", "map.jgw", "map.prj", "figures.csv"))
    Image.fromarray(picture).save(sheet, quality=82, optimize=True)
    dx, dy = (EAST - WEST) / WIDTH, (NORTH - SOUTH) / HEIGHT
    # Its last two numbers are the middle of the first pixel.
    world.write_text("".join(f"{value:.12f}\n" for value in (dx, 0, 0, -dy, WEST + dx / 2, NORTH - dy / 2)))
    reference.write_text(pyproj.CRS.from_epsg(4326).to_wkt("WKT1_ESRI") + "\n")
    with table.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return [sheet, world, reference, table]


if __name__ == "__main__":
    for written in run(*sys.argv[1:2]):
        print(written)
