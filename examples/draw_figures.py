"""Renders the drawn figures in `figures/` from their SVG sources.

Each folder holds figure.svg, and next to it what is made from it: image.png (RGBA on transparent ground), mask.png
(255 where the figure is) and keypoints.json. The joints are circles in the drawing's hidden group `joints`: id
`joint-<name>`, centre in pixels, `data-visible` 0 where the drawing hides the joint. So the SVG is the only source.

    python examples/draw_figures.py [OUT]

writes to OUT, by default back into `figures/`, and adds skeletons.png, which shows mask and joints over the drawings.
"""

from __future__ import annotations

import io
import json
import shutil
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import resvg_py
from PIL import Image, ImageDraw, ImageOps
from scipy import ndimage

FIGURES = Path(__file__).resolve().parent / "figures"

# fmt: off
BONES: tuple[tuple[str, str], ...] = (
    ("eyes", "head"), ("head", "neck"), ("neck", "thorax"), ("thorax", "pelvis"),
    *((f"{side}_{first}", f"{side}_{second}") for side in "lr" for first, second in (
        ("shoulder", "elbow"), ("elbow", "wrist"), ("wrist", "hand"),
        ("hip", "knee"), ("knee", "ankle"), ("ankle", "foot"),
    )),
    *((trunk, f"{side}_{limb}") for side in "lr" for trunk, limb in (("thorax", "shoulder"), ("pelvis", "hip"))),
)
# fmt: on
JOINTS = frozenset(joint for bone in BONES for joint in bone)
COLOURS = {"l": (20, 60, 230), "r": (220, 20, 20), "": (180, 0, 180)}
GROUND = (232, 236, 226)


def figure_names() -> list[str]:
    """The folders that hold a drawing."""
    return sorted(path.parent.name for path in FIGURES.glob("*/figure.svg"))


def render(svg: Path) -> Image.Image:
    """The drawing as an RGBA picture, one pixel to the SVG unit; fully transparent pixels are black."""
    png = resvg_py.svg_to_bytes(svg_string=svg.read_text(encoding="utf-8"), skip_system_fonts=True)
    rgba = np.array(Image.open(io.BytesIO(bytes(png))).convert("RGBA"))
    rgba[rgba[..., 3] == 0] = 0
    return Image.fromarray(rgba)


def read_keypoints(svg: Path) -> dict[str, Any]:
    """Size and joints of the drawing."""
    root = ET.parse(svg).getroot()
    keypoints = {
        circle.attrib["id"].removeprefix("joint-"): [
            float(circle.attrib["cx"]),
            float(circle.attrib["cy"]),
            int(circle.attrib["data-visible"]),
        ]
        for circle in root.iterfind(".//*[@id='joints']/{http://www.w3.org/2000/svg}circle")
    }
    if set(keypoints) != JOINTS:
        raise ValueError(f"{svg}: joints missing or unknown: {sorted(set(keypoints) ^ JOINTS)}")
    return {"width": int(root.attrib["width"]), "height": int(root.attrib["height"]), "keypoints": keypoints}


def mask_of(image: Image.Image) -> Image.Image:
    """255 where alpha is at least one half; the figure must be one piece."""
    mask = np.asarray(image)[..., 3] >= 128
    pieces = ndimage.label(mask)[1]
    if pieces != 1:
        raise ValueError(f"the figure falls into {pieces} pieces, expected one")
    return Image.fromarray(np.where(mask, 255, 0).astype(np.uint8))


def keypoints_text(keypoints: dict[str, Any]) -> str:
    """JSON with one joint a line."""
    joints = ",\n".join(f"    {json.dumps(name)}: {json.dumps(at)}" for name, at in keypoints["keypoints"].items())
    size = f'  "width": {keypoints["width"]},\n  "height": {keypoints["height"]}'
    return f'{{\n{size},\n  "keypoints": {{\n{joints}\n  }}\n}}\n'


def skeleton(image: Image.Image, mask: Image.Image, keypoints: dict[str, Any]) -> Image.Image:
    """The drawing with the border of its mask and its joints; hollow dots are hidden joints."""
    picture = Image.new("RGBA", image.size, (*GROUND, 255))
    picture.alpha_composite(image)
    inside = np.asarray(mask) > 0
    border = ndimage.binary_dilation(inside, iterations=2) & ~inside
    pixels = np.array(picture.convert("RGB"))
    pixels[border] = (0, 150, 60)
    picture = Image.fromarray(pixels)
    draw = ImageDraw.Draw(picture)
    at = keypoints["keypoints"]
    for first, second in BONES:
        colour = COLOURS[second[0] if second[1] == "_" else ""]
        ends = [tuple(at[first][:2]), tuple(at[second][:2])]
        draw.line(ends, fill=(255, 255, 255), width=7)
        draw.line(ends, fill=colour, width=3)
    for name, (x, y, visible) in at.items():
        colour = COLOURS[name[0] if name[1] == "_" else ""]
        draw.ellipse((x - 6, y - 6, x + 6, y + 6), fill=colour if visible else (255, 255, 255), outline=colour, width=2)
    return picture


def run(out_dir: str | Path = FIGURES) -> list[Path]:
    """Write image, mask and keypoints of every figure into `out_dir`/<name>/, and one overview of the skeletons.

    Returns the figures' folders.
    """
    out_dir = Path(out_dir)
    folders, overlays = [], []
    for name in figure_names():
        source, folder = FIGURES / name, out_dir / name
        folder.mkdir(parents=True, exist_ok=True)
        image, keypoints = render(source / "figure.svg"), read_keypoints(source / "figure.svg")
        if image.size != (keypoints["width"], keypoints["height"]):
            raise ValueError(f"{name}: rendered at {image.size}, expected the size that the SVG states")
        mask = mask_of(image)
        image.save(folder / "image.png", optimize=True)
        mask.save(folder / "mask.png", optimize=True)
        (folder / "keypoints.json").write_text(keypoints_text(keypoints), encoding="utf-8")
        for extra in ("figure.svg", "source.json"):
            if folder.resolve() != source.resolve():
                shutil.copyfile(source / extra, folder / extra)
        folders.append(folder)
        overlays.append(skeleton(image, mask, keypoints))
    height = max(overlay.height for overlay in overlays)
    padded = [ImageOps.pad(overlay, (overlay.width, height), color=GROUND, centering=(0.5, 1)) for overlay in overlays]
    sheet = Image.new("RGB", (sum(overlay.width for overlay in padded), height), GROUND)
    left = 0
    for overlay in padded:
        sheet.paste(overlay, (left, 0))
        left += overlay.width
    sheet = ImageOps.scale(sheet, 0.6).quantize(160, dither=Image.Dither.NONE)
    sheet.save(out_dir / "skeletons.png", optimize=True)
    return folders


if __name__ == "__main__":
    for written in run(*sys.argv[1:2]):
        print(written)
