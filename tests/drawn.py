"""A small drawn figure made of thick lines and discs, for tests that need a picture but no artist."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

JOINTS = {
    "head": (100, 40), "eyes": (100, 36), "neck": (100, 68), "thorax": (100, 90), "pelvis": (100, 160),
    "l_shoulder": (122, 82), "r_shoulder": (78, 82), "l_elbow": (150, 112), "r_elbow": (50, 112),
    "l_wrist": (172, 142), "r_wrist": (28, 142), "l_hand": (178, 150), "r_hand": (22, 150),
    "l_hip": (113, 165), "r_hip": (87, 165), "l_knee": (122, 220), "r_knee": (78, 220),
    "l_ankle": (126, 272), "r_ankle": (74, 272), "l_foot": (134, 282), "r_foot": (66, 282),
}  # fmt: skip
"""IMAGE pixels on a picture of 200 x 300; a figure seen from the front, arms and legs apart."""

SIZE = (200, 300)


@dataclass(frozen=True)
class DrawnFiles:
    """Paths of one drawn figure."""

    image: Path
    mask: Path
    keypoints: Path


def draw_figure(scale: int = 2) -> Image.Image:
    """An RGBA picture of the figure: red shirt, blue trousers, black shoes, a green glove on the left hand."""
    image = Image.new("RGBA", (SIZE[0] * scale, SIZE[1] * scale), (0, 0, 0, 0))
    pen = ImageDraw.Draw(image)

    def line(names: tuple[str, ...], width: float, colour: tuple[int, int, int]) -> None:
        points = [tuple(scale * c for c in JOINTS[name]) for name in names]
        pen.line(points, fill=colour, width=int(width * scale))
        for x, y in points:
            r = width * scale / 2
            pen.ellipse((x - r, y - r, x + r, y + r), fill=colour)

    skin, shirt, trousers, shoes = (230, 180, 150), (200, 40, 40), (40, 60, 170), (30, 30, 30)
    glove = {"l": (40, 160, 60), "r": skin}
    for side in "lr":
        line((f"{side}_hip", f"{side}_knee", f"{side}_ankle"), 22, trousers)
        line((f"{side}_ankle", f"{side}_foot"), 16, shoes)
        line((f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"), 18, shirt)
        line((f"{side}_wrist", f"{side}_hand"), 17, glove[side])
    outline = [JOINTS[name] for name in ("l_shoulder", "r_shoulder", "r_hip", "l_hip")]
    pen.polygon([(scale * x, scale * y) for x, y in outline], fill=shirt)
    line(("neck", "thorax", "pelvis"), 44, shirt)
    line(("neck", "head"), 18, skin)
    x, y = (scale * c for c in JOINTS["head"])
    r = 26 * scale
    pen.ellipse((x - r, y - r, x + r, y + r), fill=skin)
    return image


def keypoints(scale: int = 2) -> dict[str, object]:
    """The joints in the format of `--keypoints`."""
    joints = {name: [scale * x, scale * y, 1] for name, (x, y) in JOINTS.items()}
    return {"width": SIZE[0] * scale, "height": SIZE[1] * scale, "keypoints": joints}


def write_figure(folder: Path, scale: int = 2, name: str = "drawn") -> DrawnFiles:
    """Write image, mask and joints into `folder`."""
    image = draw_figure(scale)
    files = DrawnFiles(folder / f"{name}.png", folder / f"{name}_mask.png", folder / f"{name}.json")
    image.save(files.image)
    Image.fromarray(np.where(np.asarray(image)[..., 3] >= 128, np.uint8(255), np.uint8(0))).save(files.mask)
    files.keypoints.write_text(json.dumps(keypoints(scale)))
    return files
