"""One picture of all test figures: drawing, textured views and clay views of each model.

    python docs/make_contact_sheet.py FIGURES_DIR OUT.jpg [--glb-dir DIR] [--columns 2]

Each folder in FIGURES_DIR with an image.png and a keypoints.json (and a mask.png where the picture is not cut out) is
one figure. Models are taken from DIR/<name>.glb; those that are missing are made with the command line, and without
--glb-dir all of them are, in a temporary folder.
"""

from __future__ import annotations

import argparse
import io
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from fig2mesh.measure.model import load_textured
from fig2mesh.mesh.preview import LIGHT, views_sheet

LONLAT = ("8.5417", "47.3769")
YAWS, CLAY_YAWS = (0, 35, 90, 145, 180, 270), (35, 90)
ROW_HEIGHT, LABEL_HEIGHT, GAP = 380, 26, 18
MAX_BLOCK_WIDTH = 1240
"""Wider rows (arms and legs spread) are drawn smaller, so that two still fit on a screen."""
MAX_BYTES = 1_500_000
INK = (40, 40, 44)


def make_model(folder: Path, target: Path) -> None:
    """Run the command line on a figure's folder; raises RuntimeError with what it said if it fails."""
    command = [sys.executable, "-m", "fig2mesh", str(folder / "image.png"), "--lonlat", *LONLAT, "-q"]
    command += ["--keypoints", str(folder / "keypoints.json"), "-o", str(target), "--overwrite"]
    if (folder / "mask.png").exists():
        command += ["--mask", str(folder / "mask.png")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip() or f"exit code {done.returncode}")


def figure_block(folder: Path, glb: Path) -> Image.Image:
    """The labelled row of one figure."""
    with Image.open(folder / "image.png") as image:
        drawing = np.asarray(image.convert("RGBA"))
    mask: NDArray[np.bool_] | None = None
    if (folder / "mask.png").exists():
        with Image.open(folder / "mask.png") as image:
            mask = np.asarray(image.convert("L")) >= 128
    mesh = load_textured(glb)
    height = ROW_HEIGHT
    while True:
        views = views_sheet(mesh, drawing, mask=mask, yaws=YAWS, clay_yaws=CLAY_YAWS, height=height)
        if views.shape[1] <= MAX_BLOCK_WIDTH or height <= 40:
            break
        height = min(height - 1, int(height * MAX_BLOCK_WIDTH / views.shape[1]))
    return labelled(folder.name, Image.fromarray(views))


def labelled(name: str, views: Image.Image | None, note: str = "") -> Image.Image:
    """A row with the figure's name above its views, or with a note where there are none."""
    width = max(views.width if views else 0, 420)
    block = Image.new("RGB", (width, LABEL_HEIGHT + ROW_HEIGHT), LIGHT)
    if views:
        block.paste(views, (0, LABEL_HEIGHT + ROW_HEIGHT - views.height))
    pen = ImageDraw.Draw(block)
    pen.text((GAP // 2, 4), name, fill=INK, font=ImageFont.load_default(17))
    if note:
        lines = [note[start : start + 60] for start in range(0, min(len(note), 600), 60)]
        pen.text((GAP // 2, 40), "\n".join(lines), fill=(170, 30, 30), font=ImageFont.load_default(13))
    return block


def arrange(blocks: list[Image.Image], columns: int) -> Image.Image:
    """Blocks in reading order; a column is as wide as its widest block."""
    columns = max(1, min(columns, len(blocks)))
    widths = [max(block.width for block in blocks[column::columns]) for column in range(columns)]
    rows = -(-len(blocks) // columns)
    height = blocks[0].height
    size = (sum(widths) + GAP * (columns + 1), rows * (height + GAP) + GAP)
    sheet = Image.new("RGB", size, (214, 214, 210))
    for index, block in enumerate(blocks):
        row, column = divmod(index, columns)
        left, top = GAP + sum(widths[:column]) + GAP * column, GAP + row * (height + GAP)
        sheet.paste(LIGHT, (left, top, left + widths[column], top + height))
        sheet.paste(block, (left, top))
    return sheet


def write_jpeg(sheet: Image.Image, path: Path, most: int = MAX_BYTES) -> int:
    """Write with the best quality, at last the best size, that stays below `most` bytes; returns the bytes written."""
    quality = 90
    while True:
        stream = io.BytesIO()
        sheet.save(stream, "JPEG", quality=quality, optimize=True, progressive=True)
        if stream.tell() <= most or sheet.width < 64:
            path.write_bytes(stream.getvalue())
            return stream.tell()
        if quality > 72:
            quality -= 6
        else:
            sheet = sheet.resize((sheet.width * 9 // 10, sheet.height * 9 // 10), Image.Resampling.LANCZOS)


def main() -> int:
    parser = argparse.ArgumentParser(description="One picture of all figures and their models.")
    parser.add_argument("figures", type=Path, help="folder of figure folders")
    parser.add_argument("out", type=Path, help="JPEG to write")
    parser.add_argument("--glb-dir", type=Path, help="folder of models <name>.glb; missing ones are made there")
    parser.add_argument("--columns", type=int, default=2, help="figures side by side (default 2)")
    options = parser.parse_args()
    folders = sorted(path.parent for path in options.figures.glob("*/image.png"))
    folders = [folder for folder in folders if (folder / "keypoints.json").exists()]
    if not folders:
        print(f"{options.figures}: no folder with image.png and keypoints.json", file=sys.stderr)
        return 2
    failures = 0
    blocks = []
    with tempfile.TemporaryDirectory() as temporary:
        models = options.glb_dir or Path(temporary)
        models.mkdir(parents=True, exist_ok=True)
        for folder in folders:
            start = time.perf_counter()
            glb = models / f"{folder.name}.glb"
            try:
                if not glb.exists():
                    make_model(folder, glb)
                blocks.append(figure_block(folder, glb))
            except (RuntimeError, ValueError) as error:
                # A sheet with a gap says more than no sheet.
                failures += 1
                blocks.append(labelled(folder.name, None, " ".join(str(error).split())))
                print(f"{folder.name}: {error}", file=sys.stderr)
            print(f"{folder.name}: {time.perf_counter() - start:.1f} s", file=sys.stderr)
    sheet = arrange(blocks, options.columns)
    size = write_jpeg(sheet, options.out)
    print(
        f"{options.out}: {len(blocks)} figures, {sheet.width} × {sheet.height} px, {size / 1e6:.2f} MB", file=sys.stderr
    )
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
