"""Figures in the colours of a conversion and in the paper's, beside each other: docs/textures_paper.jpg.

python docs/make_paper_sheet.py OUT.jpg FIGURE...

FIGURE: folder with image.png, keypoints.json and, where needed, mask.png.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from exporters.asset import ByteArray
from fig2mesh.conversion.convert import run_stages
from fig2mesh.conversion.stores import MemoryStore
from fig2mesh.evaluate.figures import drawing_in
from fig2mesh.mesh.preview import LIGHT, views_sheet
from fig2mesh.parse.read import read_figure
from fig2mesh.settings import PRESETS
from fig2mesh.stages.model import model

YAWS = (45, 90, 180, 270)
HEIGHT, COLUMNS = 300, 2
MAX_BYTES = 400_000


def rows_of(folder: Path) -> ByteArray:
    """Two rows of views of one figure: as conversions colour it, and as the paper does."""
    figure, store = read_figure(**drawing_in(folder).arguments()), MemoryStore()
    views = []
    for settings in (PRESETS["standard"], replace(PRESETS["standard"], textures="paper")):
        done = run_stages(figure, settings, (model,), store=store)
        views.append(
            views_sheet(
                done.results[model][0], done.figure.rgba, mask=done.figure.mask, yaws=YAWS, height=HEIGHT, samples=3
            )
        )
    return _stacked(views)


def _stacked(pictures: list[ByteArray]) -> ByteArray:
    """Pictures below each other, aligned left."""
    widest = max(picture.shape[1] for picture in pictures)
    wide = []
    for picture in pictures:
        row = np.empty((picture.shape[0], widest, 3), np.uint8)
        row[:] = LIGHT
        row[:, : picture.shape[1]] = picture
        wide.append(row)
    return np.concatenate(wide)


def sheet(folders: list[Path]) -> Image.Image:
    """All figures in columns."""
    cells = [rows_of(folder) for folder in folders]
    each = -(-len(cells) // COLUMNS)
    columns = [_stacked(cells[first : first + each]) for first in range(0, len(cells), each)]
    # Side by side is below each other, turned.
    return Image.fromarray(_stacked([column.transpose(1, 0, 2) for column in columns]).transpose(1, 0, 2))


def save_small(picture: Image.Image, target: Path) -> None:
    """Save as JPEG of at most `MAX_BYTES`."""
    for quality in range(88, 40, -6):
        picture.save(target, quality=quality, optimize=True)
        if target.stat().st_size <= MAX_BYTES:
            return
    raise SystemExit(f"{target}: more than {MAX_BYTES} bytes at any quality; give fewer figures")


if __name__ == "__main__":
    out = Path(sys.argv[1])
    out.parent.mkdir(parents=True, exist_ok=True)
    save_small(sheet([Path(name) for name in sys.argv[2:]]), out)
    print(out)
