"""Pictures of 16 pixels and of 16,000, and of extreme shapes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.drawn import JOINTS, SIZE, draw_figure
from tests.hard_cases.case import Worst, hard_case
from tests.hard_cases.figures import FAST, SMALL, Job, refused


@pytest.mark.parametrize(("width", "height"), [(11, 16), (16, 16), (5, 8)])
@hard_case(
    "the drawn figure on 11 × 16, 16 × 16 and 5 × 8 pixels",
    "one closed solid with the drawn pixels' outline",
    "the outline runs through coverage of pixels: rounding loses up to a fifth of a corner pixel, and of so few pixels "
    "most are corners",
    0.3,
    "(1 − IoU)",
)
def test_pictures_of_sixteen_pixels(job: Job, worst: Worst, width: int, height: int) -> None:
    made = job(np.asarray(draw_figure(2).resize((width, height), Image.Resampling.BOX)))
    assert made.code == 0, made.error
    assert made.measures["watertight"]
    assert made.measures["components"] == made.measures["pieces_drawn"]
    worst(1 - made.measures["silhouette_iou"])


@hard_case(
    "a picture of one opaque pixel, without --mask",
    "one line, exit code 2, nothing written",
    "there is nothing to be seen on it",
)
def test_a_picture_of_one_pixel(job: Job) -> None:
    refused(job(np.full((1, 1, 4), 255, np.uint8)), "no figure found")


BARS = [(4000, 20), (20, 4000), (3000, 2)]


@pytest.mark.slow
@pytest.mark.parametrize(("width", "height"), BARS)
@hard_case(
    "bars of " + ", ".join(f"{w} × {h}" for w, h in BARS) + " pixels, the whole picture being the figure",
    "one closed solid; or, where less than a pixel of the canvas is left of it, one line and exit code 2",
    "topology is counted, not measured",
)
def test_extreme_aspect_ratios(job: Job, width: int, height: int) -> None:
    made = job(np.full((height, width, 3), 200, np.uint8), None, mask=np.ones((height, width), bool))
    if made.code != 0:
        refused(made, "too thin")
        return
    assert made.measures["watertight"]
    assert made.measures["components"] == 1


def large(folder: Path, width: int, height: int, mode: str) -> tuple[Path, Path]:
    """The drawn figure enlarged onto a picture of few bytes; and its joints."""
    picture, keypoints = folder / "large.png", folder / "large.json"
    small = draw_figure(2)
    if mode == "P":
        flat = np.where(np.asarray(small)[..., 3] > 127, np.uint8(1), np.uint8(0))
        image = Image.fromarray(flat).resize((width, height), Image.Resampling.NEAREST)
        image.putpalette([255, 255, 255, 200, 40, 40])
        image.save(picture, transparency=0, compress_level=1)
    else:
        small.resize((width, height), Image.Resampling.NEAREST).save(picture, compress_level=1)
    joints = {name: [x / SIZE[0] * width, y / SIZE[1] * height, 1] for name, (x, y) in JOINTS.items()}
    keypoints.write_text(json.dumps({"width": width, "height": height, "keypoints": joints}))
    return picture, keypoints


def peak_mb(arguments: list[str]) -> float:
    """Largest resident size of the main job in a process of its own, MiB.

    Not what `getrusage` says: that starts at what the parent had when it forked, and a test run has grown by then.
    """
    program = (
        "import re, sys\nfrom pathlib import Path\nfrom fig2mesh.commands.main import main\ncode = main(sys.argv[1:])\n"
        "status = Path('/proc/self/status').read_text()\n"
        "print(code, int(re.search(r'VmHWM:\\s*(\\d+)', status)[1]) / 1024)"
    )
    done = subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=True)
    code, peak = done.stdout.split()
    assert code == "0", done.stderr
    return float(peak)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["P", "RGBA"])
@hard_case(
    "the drawn figure 16,000 pixels high, 171 million of them, as a palette and as an RGBA picture",
    "peak memory of the whole job",
    "the decoded RGBA picture alone is 651 MiB; the goal for any figure is 2,500 MB, of which the libraries and the "
    "rest of the job take 850",
    2500,
    "MiB",
)
def test_a_picture_of_sixteen_thousand_pixels(tmp_path: Path, worst: Worst, mode: str) -> None:
    picture, keypoints = large(tmp_path, 10_667, 16_000, mode)
    output = tmp_path / "made.glb"
    worst(peak_mb([str(picture), "--keypoints", str(keypoints), "-o", str(output), *FAST, *SMALL]))
    assert output.exists()


@hard_case(
    "16,000 × 16,000 pixels, 256 million",
    "one line, exit code 2, nothing written; refused before it is decoded",
    "more than 179 million pixels are refused, whatever is in them: the decoded picture would need a gigabyte",
)
def test_more_pixels_than_memory_is_for(job: Job) -> None:
    picture = job.folder / "huge.png"
    Image.new("1", (16_000, 16_000)).save(picture, compress_level=1)
    keypoints = job.folder / "joints.json"
    keypoints.write_text(json.dumps({"keypoints": {name: [10, 10, 1] for name in JOINTS}}))
    refused(job.run(picture, keypoints), "Mpx", "pass --bbox")
