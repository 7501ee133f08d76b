"""Writers of pictures: a still, an animation, a video, or a folder of numbered stills; whole or not at all."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from exporters.atomic_file import write_whole
from exporters.write import check_file
from fig2mesh.errors import OutputError
from fig2mesh.records import ByteArray

FOLDER = ""
"""Kind of an output without suffix."""

NUMBERED = re.compile(r"\d{4,}\.png")


@dataclass(frozen=True)
class Kind:
    """A kind of output.

    title : for people; moving : shows a turntable; transparent : preserves transparency
    """

    title: str
    moving: bool
    transparent: bool


KINDS: dict[str, Kind] = {
    ".png": Kind("PNG", False, True),
    ".webp": Kind("animated WebP", True, True),
    ".gif": Kind("animated GIF", True, False),
    ".mp4": Kind("MP4", True, False),
    FOLDER: Kind("numbered PNGs", True, True),
}


def kind_of(path: str) -> str:
    """Suffix of a path, one of `KINDS`; "" for a folder. Raises OutputError for unknown suffixes."""
    if path.endswith(("/", os.sep)) or Path(path).is_dir():
        return FOLDER
    suffix = Path(path).suffix.lower()
    if suffix not in KINDS:
        known = ", ".join(suffix for suffix in KINDS if suffix)
        raise OutputError(path, f"unknown suffix {suffix}", f"use {known}, or a folder for numbered PNGs")
    return suffix


def check_pictures(path: str, overwrite: bool, size: tuple[int, int], transparent: bool) -> None:
    """Check that pictures can be written, before the work begins. Raises OutputError, ExportError.

    size : (width, height); transparent : whether their background is transparent
    """
    kind = kind_of(path)
    if kind == FOLDER:
        folder = Path(path)
        if folder.is_dir() and any(folder.iterdir()) and not overwrite:
            raise OutputError(path, "already exists and is not empty", "use --overwrite or choose another folder")
        check_file(path, folder / "0000.png", overwrite)
        return
    check_file(path, Path(path), overwrite)
    if kind == ".mp4":
        if shutil.which("ffmpeg") is None:
            raise OutputError(path, "MP4 requires ffmpeg, which is not on the PATH", "install it, or use .webp")
        if transparent:
            raise OutputError(path, "MP4 does not support transparency", "give --background a colour, or use .webp")
        if size[0] % 2 or size[1] % 2:
            raise OutputError(path, f"{size[0]}×{size[1]} px, but MP4 requires even numbers", "change --size")


def write_pictures(path: str, pictures: Iterable[ByteArray], fps: float, overwrite: bool) -> tuple[Path, ...]:
    """Write (H, W, 4) uint8 sRGB pictures with straight alpha, in the format given by the path.

    pictures : consumed one by one while they are written; a .png has just one
    fps : pictures per second; GIF stores only hundredths of a second per picture
    returns : the files written
    """
    kind = kind_of(path)
    if kind == FOLDER:
        folder = Path(path)
        # A shorter turntable must not end with pictures of an earlier, longer one.
        old = [file for file in folder.iterdir() if NUMBERED.fullmatch(file.name)] if folder.is_dir() else []

        def number(stage: Path) -> None:
            for index, picture in enumerate(pictures):
                Image.fromarray(picture).save(stage / f"{index:04d}.png")

        written = write_whole(path, folder / "0000.png", number, overwrite)
        for file in set(old) - set(written):
            file.unlink()
        return written
    writers: dict[str, Callable[[Path], None]] = {
        ".png": lambda file: Image.fromarray(next(iter(pictures))).save(file),
        ".webp": lambda file: _webp(file, pictures, fps),
        ".gif": lambda file: _gif(file, pictures, fps),
        ".mp4": lambda file: _mp4(file, pictures, fps, path),
    }
    target = Path(path)
    return write_whole(path, target, lambda stage: writers[kind](stage / target.name), overwrite)


def _webp(file: Path, pictures: Iterable[ByteArray], fps: float) -> None:
    """Write a lossless WebP: lossy compression would damage flat colours and lines."""
    first, *others = (Image.fromarray(picture) for picture in pictures)
    more = {"save_all": True, "append_images": others, "duration": round(1000 / fps), "loop": 0} if others else {}
    first.save(file, "WEBP", lossless=True, quality=60, method=4, exact=True, **more)


def _gif(file: Path, pictures: Iterable[ByteArray], fps: float) -> None:
    """Write a GIF with 256 colours per picture, one of them transparent if any pixel is mostly transparent."""
    first, *others = (_indexed(picture) for picture in pictures)
    # Each picture replaces the one before, also where it is transparent.
    first.save(
        file,
        "GIF",
        save_all=True,
        append_images=others,
        duration=round(100 / fps) * 10,
        loop=0,
        disposal=2,
        optimize=False,
    )


def _indexed(picture: ByteArray) -> Image.Image:
    clear = picture[..., 3] < 128
    colours = Image.fromarray(np.ascontiguousarray(picture[..., :3]))
    indexed = colours.quantize(255, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    if not clear.any():
        return indexed
    pixels = np.where(clear, np.uint8(255), np.asarray(indexed))
    palette = (indexed.getpalette() or []) + [0] * 768
    result = Image.fromarray(pixels, "P")
    result.putpalette(palette[:768])
    result.info["transparency"] = 255
    return result


def _mp4(file: Path, pictures: Iterable[ByteArray], fps: float, path: str) -> None:
    """Write H.264 through ffmpeg, in the pixel format that every player supports."""
    program: subprocess.Popen[bytes] | None = None
    for picture in pictures:
        if program is None:
            height, width = picture.shape[:2]
            command = ["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
            command += ["-r", f"{fps:g}", "-i", "-", "-an", "-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p"]
            command += ["-threads", "1", "-fflags", "+bitexact", "-movflags", "+faststart", str(file)]
            program = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        assert program.stdin is not None
        try:
            program.stdin.write(np.ascontiguousarray(picture[..., :3]).tobytes())
        except BrokenPipeError:
            break  # the error is reported below
    assert program is not None
    _, errors = program.communicate()
    if program.returncode or not file.is_file():
        reason = " ".join(errors.decode(errors="replace").split())[:200] or f"exit code {program.returncode}"
        raise OutputError(path, f"ffmpeg failed ({reason})", "install one with libx264, or use .webp")
