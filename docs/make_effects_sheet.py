"""One picture of the modes and effects of `fig2mesh render` on the shipped farmer: docs/effects.jpg.

python docs/make_effects_sheet.py OUT.jpg
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fig2mesh.mesh.preview import LIGHT
from fig2mesh.parse.read import read_figure
from fig2mesh.render.job import field_scene
from fig2mesh.render.picture import PictureRequest, render
from fig2mesh.render.sun import parse_time, sun_at, towards_sun
from fig2mesh.settings import PRESETS

FIGURE = Path(__file__).parents[1] / "examples" / "figures" / "farmer"
LONLAT, AFTERNOON = (8.5417, 47.3769), "2026-06-21T16:30+02:00"
CELL, LABEL, COLUMNS = (300, 400), 26, 5
INK = (40, 40, 44)

CELLS: tuple[tuple[str, str, dict[str, object]], ...] = (
    ("textured", "", {}),
    ("clay", "", {}),
    ("normals", "", {}),
    ("depth", "", {}),
    ("parts", "", {}),
    ("textured", "light", {}),
    ("textured", "light,shadow", {"ground": True, "pitch_deg": 18.0}),
    ("textured", "sun,shadow", {"ground": True, "pitch_deg": 18.0}),
    ("textured", "ao", {"ground": True, "pitch_deg": 18.0}),
    ("textured", "light,shadow,ao,outline", {"ground": True, "pitch_deg": 18.0, "yaw_deg": 40.0}),
    ("clay", "outline", {"yaw_deg": 40.0}),
    ("textured", "perspective", {"yaw_deg": 40.0, "pitch_deg": 40.0}),
    ("textured", "", {"yaw_deg": 65.0}),
    ("textured", "blend", {"yaw_deg": 65.0}),
    ("clay", "smooth-union", {"yaw_deg": 40.0}),
)
"""Mode, effects, further fields of the request."""


def sheet() -> Image.Image:
    """All cells in reading order, each with what it shows written above."""
    figure = read_figure(FIGURE / "image.png", keypoints=FIGURE / "keypoints.json")
    scene, smooth = (
        field_scene(figure, PRESETS["standard"], PictureRequest("textured", effects))
        for effects in (frozenset(), frozenset(["smooth-union"]))
    )
    plain = PictureRequest(size=CELL, samples=3, background=LIGHT)
    sun = towards_sun(sun_at(*LONLAT, parse_time(AFTERNOON)), 180.0)
    rows = -(-len(CELLS) // COLUMNS)
    page = Image.new("RGB", (COLUMNS * CELL[0], rows * (CELL[1] + LABEL)), LIGHT)
    pen = ImageDraw.Draw(page)
    for index, (mode, effects, more) in enumerate(CELLS):
        names = frozenset(effects.split(",")) - {""}
        request = replace(plain, mode=mode, effects=names, sun=sun, **more)  # type: ignore[arg-type]
        picture = render(smooth if "smooth-union" in names else scene, request).rgba
        row, column = divmod(index, COLUMNS)
        place = column * CELL[0], row * (CELL[1] + LABEL)
        page.paste(Image.fromarray(np.ascontiguousarray(picture[..., :3])), (place[0], place[1] + LABEL))
        text = effects.replace(",", ", ") or f"--mode {mode}"
        if "yaw_deg" in more and not effects:
            text = "from the side"
        pen.text((place[0] + 10, place[1] + 5), text, fill=INK, font=ImageFont.load_default(16))
    return page


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "build/effects.jpg")
    target.parent.mkdir(parents=True, exist_ok=True)
    sheet().save(target, quality=88)
    print(target)
