"""What `fig2mesh parse` does: read, infer, write. All its side effects are here."""

from __future__ import annotations

import io
import json
import logging
import os
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from fig2mesh.errors import OutputError
from fig2mesh.job import configure_logging
from fig2mesh.parse.read import Reading, read_parsed
from fig2mesh.records import JOINT_NAMES, PART_NAMES, ByteArray

log = logging.getLogger("fig2mesh")

NAMES = ("keypoints.json", "mask.png", "part_labels.png")


def run(
    *,
    figure: Path,
    output: Path,
    mask: Path | None,
    keypoints: Path | None,
    part_labels: Path | None,
    bbox: tuple[int, int, int, int] | None,
    overwrite: bool,
    quiet: bool,
    verbose: int,
) -> None:
    """What `fig2mesh parse IMAGE -o DIR …` does; the parameters are the options of the command line."""
    configure_logging(quiet, verbose)
    if output.exists() and not output.is_dir():
        raise OutputError(output, "is no folder", "give -o a folder")
    there = [name for name in NAMES if (output / name).exists()]
    if there and not overwrite:
        raise OutputError(output / there[0], "exists", "pass --overwrite or another folder")
    found = read_parsed(figure, mask=mask, keypoints=keypoints, part_labels=part_labels, bbox=bbox, labels=True)
    write_parsed(found, output)
    for name in NAMES:
        log.info("%s", output / name)


def write_parsed(found: Reading, folder: Path) -> None:
    """keypoints.json, mask.png and part_labels.png for the whole picture that a figure was read from."""
    labels = np.where(found.figure.mask, found.part_labels, 0).astype(np.uint8)
    contents = {
        "keypoints.json": (json.dumps(as_keypoints(found), indent=1) + "\n").encode(),
        "mask.png": _png(Image.fromarray(_whole(found, found.figure.mask.astype(np.uint8) * 255), "L")),
        "part_labels.png": _labels_png(_whole(found, labels)),
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
        partial = {name: folder / f".{name}.partial" for name in contents}
        for name, content in contents.items():
            partial[name].write_bytes(content)
        for name, path in partial.items():
            os.replace(path, folder / name)
    except OSError as error:
        raise OutputError(folder, error.strerror or "cannot be written", "choose another folder") from None


def as_keypoints(found: Reading) -> dict[str, Any]:
    """What keypoints.json holds (`read_keypoints` reads it), with the confidences of what was inferred beside."""
    width, height = found.size
    joints = found.figure.joints_px + np.array(found.origin, np.float32)
    content: dict[str, Any] = {
        "width": width,
        "height": height,
        "keypoints": {
            name: [round(float(x), 1), round(float(y), 1), int(seen)]
            for name, (x, y), seen in zip(JOINT_NAMES, joints, found.figure.visible, strict=True)
        },
    }
    if found.confidence is not None:
        content["confidence"] = {
            name: round(float(value), 3) for name, value in zip(JOINT_NAMES, found.confidence, strict=True)
        }
    return content


def _whole(found: Reading, values: ByteArray) -> ByteArray:
    """The values of the figure's window in the whole picture, 0 elsewhere."""
    width, height = found.size
    x, y = found.origin
    out = np.zeros((height, width), np.uint8)
    out[y : y + values.shape[0], x : x + values.shape[1]] = values
    return out


def _labels_png(labels: ByteArray) -> bytes:
    """A palette picture whose colours tell parts apart; the text chunk "legend" names the labels."""
    colours = np.zeros((256, 3), np.uint8)
    colours[1 : len(PART_NAMES)] = PALETTE
    image = Image.fromarray(labels, "L")
    image.putpalette(colours.tobytes())
    return _png(image, "; ".join(f"{label} {name}" for label, name in enumerate(PART_NAMES)))


def _png(image: Image.Image, legend: str | None = None) -> bytes:
    stream = io.BytesIO()
    info = PngInfo()
    if legend is not None:
        info.add_text("legend", legend)
    image.save(stream, "PNG", pnginfo=info)
    return stream.getvalue()


PALETTE = (
    (120, 170, 110), (232, 190, 90),
    (70, 120, 214), (222, 96, 70), (120, 160, 228), (232, 148, 130), (172, 198, 240), (244, 200, 190),
    (40, 150, 170), (176, 60, 130), (98, 180, 194), (198, 114, 164), (158, 212, 220), (222, 170, 200),
    (100, 70, 50), (170, 150, 200), (120, 120, 120),
)  # fmt: skip
"""Colours of the labels 1 to 17: left parts cool, right parts warm."""
