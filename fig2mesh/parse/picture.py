"""Pictures of figures: decoded, cut to their window, with the masks and part labels that belong to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from fig2mesh.errors import FigureError
from fig2mesh.parse.window import FORMATS, MAX_PIXELS, is_large, read_window, size_of
from fig2mesh.records import BoolArray, ByteArray
from fig2mesh.skeleton import PART_NAMES
from georef.untrusted.damage import DamagedFile
from georef.untrusted.image_file import NotAPicture, TooLarge, check_scans, open_header, pillow

OPAQUE = np.array([0, 0, 0, 255], np.uint8)

BAND_PX = 512
"""Rows converted to RGBA at a time."""


@dataclass(frozen=True)
class PictureView:
    """Part of a picture that holds the figure.

    rgba : (H, W, 4) uint8; corner : (x, y) of its corner in the picture; size : (width, height) of the whole picture
    """

    rgba: ByteArray
    corner: tuple[int, int]
    size: tuple[int, int]

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns in the whole picture."""
        (x, y), (height, width) = self.corner, self.rgba.shape[:2]
        return slice(y, y + height), slice(x, x + width)


def read_view(path: Path, bbox: tuple[int, int, int, int] | None) -> PictureView:
    """Read a picture, or the part of it inside `bbox`; of large pictures only that part is kept in memory.

    Raises FigureError as `read_figure` does.
    """
    if bbox is None:
        rgba = read_rgba(path)
        return PictureView(rgba, (0, 0), (rgba.shape[1], rgba.shape[0]))
    if is_large(path):
        pixels, size = read_window(path, bbox)
        return PictureView(pixels, bbox[:2], size)
    rgba = read_rgba(path)
    height, width = rgba.shape[:2]
    x0, y0, x1, y1 = bbox
    if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise FigureError("--bbox", f"{x0} {y0} {x1} {y1} is not inside {width}×{height} px", "give X0 Y0 X1 Y1")
    return PictureView(rgba[y0:y1, x0:x1], (x0, y0), (width, height))


def _open(path: Path, what: str) -> Image.Image:
    """Open and decode a picture. Raises FigureError with the reason in one line."""
    intact = f"give an intact picture as {what}"
    try:
        if path.exists() and not path.is_file():  # reading a pipe would block, and a device never ends
            raise FigureError(path, "cannot be read (not a regular file)", f"give a PNG, JPEG, TIFF or WebP as {what}")
        image = open_header(path, FORMATS)
        if image.width * image.height > MAX_PIXELS:
            raise TooLarge(f"{image.width}×{image.height} px is more than {MAX_PIXELS / 1e6:.0f} Mpx")
        check_scans(image, path.read_bytes() if "progressive" in image.info else b"")
        with pillow():
            image.load()
            ImageOps.exif_transpose(image, in_place=True)
        return image
    except TooLarge as error:
        raise FigureError(path, str(error), "pass --bbox X0 Y0 X1 Y1 round the figure") from None
    except NotAPicture:
        raise FigureError(path, "not a picture that can be read", f"give a PNG, JPEG, TIFF or WebP as {what}") from None
    except DamagedFile as error:
        raise FigureError(path, f"cannot be read ({error})", intact) from None
    except FileNotFoundError:
        raise FigureError(path, "no such file", f"check the path of the {what}") from None
    except OSError as error:
        raise FigureError(path, f"cannot be read ({error.strerror})", intact) from None


def read_rgba(path: Path) -> ByteArray:
    """(H, W, 4) uint8 of a picture of any mode, upright. Raises FigureError."""
    image = _open(path, "figure")
    try:
        return _rgba(image)
    except DamagedFile as error:  # a pixel that names no colour of its palette
        raise FigureError(path, f"cannot be read ({error})", "give an intact picture as figure") from None


def _rgba(image: Image.Image) -> ByteArray:
    # In bands, as Pillow would keep two more copies of the whole picture meanwhile, and NumPy more of a deep grey one.
    width, height = image.size
    bands = [(top, min(top + BAND_PX, height)) for top in range(0, height, BAND_PX)]
    # 16-bit and float greys: Pillow's own conversion clips instead of scaling.
    deep = image.mode.startswith(("I", "F"))
    most = max((float(_grey(image, band).max()) for band in bands), default=0.0) if deep else 0.0
    factor = 255.0 / (65535.0 if most > 255 else 255.0)
    steps = np.clip(np.arange(65536) * factor, 0, 255).astype(np.uint8)
    rgba = np.empty((height, width, 4), np.uint8)
    for top, bottom in bands:
        if deep:
            values = _grey(image, (top, bottom))
            short = values.dtype.itemsize == 2
            grey = steps[values] if short else np.clip(values * factor, 0, 255).astype(np.uint8)
            rgba[top:bottom] = grey[..., None] | OPAQUE
        else:
            with pillow():
                band = image.crop((0, top, width, bottom)).convert("RGBA")
            rgba[top:bottom] = np.asarray(band)
    return rgba


def _grey(image: Image.Image, band: tuple[int, int]) -> NDArray[np.uint16 | np.float64]:
    """Rows of a picture of one deep channel; NaN becomes 0."""
    rows = np.asarray(image.crop((0, band[0], image.width, band[1])))
    if rows.dtype.itemsize == 2:
        return rows.astype(np.uint16)
    return np.nan_to_num(rows.astype(np.float64), nan=0.0)


def read_mask(path: Path | None, view: PictureView) -> BoolArray | None:
    """(H, W) bool silhouette from a file, else from the figure's alpha; None where there is neither.

    Raises FigureError.
    """
    if path is None:
        opaque = view.rgba[..., 3] >= 128
        return None if opaque.all() else np.asarray(opaque)
    values = _of_view(path, view)
    if values is None:
        values = read_rgba(path)
        if values.shape != view.rgba.shape:
            width, height = view.size
            found = f"{values.shape[1]}×{values.shape[0]} px, but the figure has {width}×{height}"
            raise FigureError(path, found, "pass a mask of the figure's size")
    if (values[..., 3] < 255).any():
        return values[..., 3] >= 128
    grey = values[..., :3].max(axis=2)
    # Some masks are 0/1 pictures.
    return np.asarray(grey >= (128 if grey.max() > 1 else 1))


def _of_view(path: Path, view: PictureView) -> ByteArray | None:
    """Part of another picture in the view's window; None where that picture differs in size from the figure's."""
    if is_large(path) and view.rgba.shape[:2] != view.size[::-1]:
        (x, y), (height, width) = view.corner, view.rgba.shape[:2]
        whole = size_of(path) == view.size
        return read_window(path, (x, y, x + width, y + height))[0] if whole else None
    values = read_rgba(path)
    return values[view.window] if values.shape[:2] == view.size[::-1] else None


def read_labels(path: Path, view: PictureView) -> ByteArray:
    """(H, W) uint8 part labels from a file. Raises FigureError."""
    image = _open(path, "part labels")
    if image.mode not in ("L", "P"):
        raise FigureError(path, f"mode {image.mode}", "give an 8-bit single-channel or palette picture of labels")
    labels = np.asarray(image, np.uint8)
    if labels.shape == view.size[::-1]:
        labels = labels[view.window]
    if labels.shape != view.rgba.shape[:2]:
        found = f"{labels.shape[1]}×{labels.shape[0]} px, but the figure has {view.size[0]}×{view.size[1]}"
        raise FigureError(path, found, "pass part labels of the figure's size")
    if labels.max() >= len(PART_NAMES):
        raise FigureError(path, f"label {labels.max()}", f"use 0 to {len(PART_NAMES) - 1}")
    return labels


def on_white(rgba: ByteArray) -> ByteArray:
    """(H, W, 3) composite the picture over white."""
    if (rgba[..., 3] == 255).all():
        return np.ascontiguousarray(rgba[..., :3])
    alpha = rgba[..., 3:].astype(np.float32) / 255
    return np.rint(rgba[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)
