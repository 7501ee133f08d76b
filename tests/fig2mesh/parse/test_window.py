"""Windows of pictures against the same windows cut from whole ones."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.errors import FigureError
from fig2mesh.parse import window
from fig2mesh.parse.read import read_figure
from fig2mesh.parse.window import is_large, read_window
from tests.drawn import DrawnFiles, write_figure

BOX = (13, 40, 170, 211)


def some(mode: str) -> Image.Image:
    random = np.random.default_rng(3)
    bands = {"L": 1, "LA": 2, "RGB": 3, "RGBA": 4, "P": 3, "I;16": 1, "1": 1}[mode]
    pixels = random.integers(0, 256, (240, 200, bands), dtype=np.uint8).squeeze()
    if mode == "I;16":
        return Image.fromarray(pixels.astype(np.uint16) * 257)
    image = Image.fromarray(pixels)
    return image.quantize(64) if mode == "P" else image.convert("1") if mode == "1" else image


@pytest.mark.parametrize("mode", ["L", "LA", "RGB", "RGBA", "P", "I;16", "1"])
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_windows_are_what_pillow_cuts_out(tmp_path: Path, mode: str, suffix: str) -> None:
    path = tmp_path / f"sheet{suffix}"
    image = some(mode)
    image.save(path)
    pixels, size = read_window(path, BOX)
    assert size == (200, 240)
    whole = some("L").convert("RGBA") if mode == "I;16" else image.convert("RGBA")
    assert np.array_equal(pixels, np.asarray(whole.crop(BOX)))


def test_tiles_and_jpeg(tmp_path: Path) -> None:
    import pyvips

    some("RGB").save(tmp_path / "sheet.png")
    pyvips.Image.new_from_file(str(tmp_path / "sheet.png")).tiffsave(
        str(tmp_path / "tiled.tif"), tile=True, tile_width=64, tile_height=64, compression="deflate"
    )
    expected = np.asarray(some("RGB").convert("RGBA").crop(BOX))
    assert np.array_equal(read_window(tmp_path / "tiled.tif", BOX)[0], expected)
    smooth = some("RGB").resize((20, 24)).resize((200, 240))
    smooth.save(tmp_path / "sheet.jpg", quality=95)
    with Image.open(tmp_path / "sheet.jpg") as image:
        decoded = np.asarray(image.convert("RGBA").crop(BOX)).astype(int)
    # Two decoders may round apart.
    assert np.abs(read_window(tmp_path / "sheet.jpg", BOX)[0] - decoded).max() <= 3


@pytest.mark.parametrize("box", [(0, 0, 201, 10), (-1, 0, 10, 10), (10, 10, 10, 20), (0, 230, 10, 241)])
def test_windows_that_are_not_inside_are_refused(tmp_path: Path, box: tuple[int, int, int, int]) -> None:
    some("RGB").save(tmp_path / "sheet.png")
    with pytest.raises(FigureError, match="is not inside 200×240 px"):
        read_window(tmp_path / "sheet.png", box)


@pytest.mark.parametrize("share", [0.02, 0.5])
def test_damaged_files_are_one_line(tmp_path: Path, share: float) -> None:
    path = tmp_path / "sheet.png"
    some("RGB").save(path)
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(FigureError, match="cannot be read") as caught:
        read_window(path, (0, 230, 10, 240))
    assert "\n" not in str(caught.value)


def test_a_figure_of_a_window_is_the_figure_cut_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files: DrawnFiles = write_figure(tmp_path)
    box = (10, 6, 396, 590)
    whole = read_figure(files.image, mask=files.mask, keypoints=files.keypoints, bbox=box)
    monkeypatch.setattr(window, "LARGE_PX", 1000)
    assert is_large(files.image)
    part = read_figure(files.image, mask=files.mask, keypoints=files.keypoints, bbox=box)
    for name in ("rgba", "mask", "joints_px", "visible", "part_labels"):
        assert np.array_equal(getattr(part, name), getattr(whole, name))
    cut = tmp_path / "cut.png"
    with Image.open(files.mask) as mask:
        mask.crop(box).save(cut)
    # A mask may be of the window alone, as nobody paints one of a whole sheet.
    assert np.array_equal(read_figure(files.image, mask=cut, keypoints=files.keypoints, bbox=box).mask, whole.mask)


@pytest.mark.slow
def test_memory_is_that_of_the_window(tmp_path: Path) -> None:
    path = tmp_path / "sheet.png"
    import pyvips

    pyvips.Image.black(20_000, 12_000, bands=3).pngsave(str(path), compression=1)
    code = (
        "import sys; from pathlib import Path; from fig2mesh.parse.window import read_window\n"
        "pixels, size = read_window(Path(sys.argv[1]), (100, 11000, 700, 12000))\n"
        "assert pixels.shape == (1000, 600, 4) and size == (20000, 12000)\n"
        "print([line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')][0])"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    # The whole picture would take 720 MB decoded.
    assert int(done.stdout) < 400_000
