"""Pictures of figures: decoded, cut to their window, with the masks and part labels that belong to them."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from fig2mesh.errors import FigureError
from fig2mesh.parse.samples import of_pillow, of_vips, pillow_only
from fig2mesh.parse.window import MAX_PIXELS, is_large, read_window_of, rgba_of, size_of
from fig2mesh.records import BoolArray, ByteArray
from fig2mesh.skeleton import PART_NAMES
from fig2mesh.system.libvips import libvips
from georef.untrusted.damage import DamagedFile
from georef.untrusted.image_file import NotAPicture, TooLarge, check_scans, open_header, pillow
from georef.untrusted.picture_header import PictureHeader, read_header

log = logging.getLogger("fig2mesh")

TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}
"""Pillow's name of the turn that makes a picture of each orientation upright."""


@dataclass(frozen=True)
class PictureView:
    """Part of a picture that holds the figure.

    rgba : (H, W, 4) uint8; corner : (x, y) of its corner in the picture; size : (width, height) of the whole picture
    notes : what the picture contradicts itself in, or holds besides, one line each
    """

    rgba: ByteArray
    corner: tuple[int, int]
    size: tuple[int, int]
    notes: tuple[str, ...] = ()

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns in the whole picture."""
        (x, y), (height, width) = self.corner, self.rgba.shape[:2]
        return slice(y, y + height), slice(x, x + width)


def read_view(path: Path, bbox: tuple[int, int, int, int] | None) -> PictureView:
    """Read a picture, or the part of it inside `bbox`; of large pictures only that part is kept in memory.

    Logs its notes as warnings. Raises FigureError as `read_figure` does.
    """
    if bbox is not None and is_large(path) and (part := _window(path, bbox, colours=True)) is not None:
        pixels, notes, size = part
        _log(path, notes)
        return PictureView(pixels, bbox[:2], size, notes)
    rgba, notes = _read(path, "figure", colours=True)
    _log(path, notes)
    height, width = rgba.shape[:2]
    x0, y0, x1, y1 = bbox or (0, 0, width, height)
    if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise FigureError("--bbox", f"{x0} {y0} {x1} {y1} is not inside {width}×{height} px", "give X0 Y0 X1 Y1")
    return PictureView(rgba[y0:y1, x0:x1], (x0, y0), (width, height), notes)


def _window(
    path: Path, bbox: tuple[int, int, int, int], colours: bool
) -> tuple[ByteArray, tuple[str, ...], tuple[int, int]] | None:
    """Pixels of a window, remarks, and the size of the whole; None where it has to be read whole."""
    header = read_header(path)
    width, height = header.size
    try:
        return *read_window_of(path, header, bbox, colours), header.size
    except FigureError as error:
        # Pillow decodes some compressions of TIFF that libvips does not.
        if header.tiff is None or error.source != str(path) or width * height > MAX_PIXELS:
            raise
    return None


def _log(path: Path, notes: tuple[str, ...]) -> None:
    for note in notes:
        log.warning("%s: %s", path, note)


@contextmanager
def _reading(path: Path, what: str) -> Iterator[None]:
    """Convert the errors of reading a picture to FigureError, with the reason in one line."""
    intact = f"give an intact picture as {what}"
    try:
        yield
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


def _checked_header(path: Path, what: str) -> PictureHeader:
    """Header of a picture small enough to be decoded whole."""
    if path.is_dir():
        raise FigureError(path, "is a folder", f"give the picture in it as {what}")
    if path.exists() and not path.is_file():  # reading a pipe would block, and a device never ends
        raise FigureError(path, "cannot be read (not a regular file)", f"give a PNG, JPEG, TIFF or WebP as {what}")
    header = read_header(path)
    width, height = header.size
    if width * height > MAX_PIXELS:
        raise TooLarge(f"{width}×{height} px is more than {MAX_PIXELS / 1e6:.0f} Mpx")
    return header


def _open(path: Path, header: PictureHeader) -> Image.Image:
    """Decode a picture with Pillow, upright. Raises DamagedFile."""
    # Not a TIFF's path, which Pillow would map into memory: it then scrambles the rows of those that are to be turned.
    source = path if header.tiff is None else path.read_bytes()
    image = open_header(source, (header.format,) if header.format != "MPO" else ("JPEG", "MPO"))
    check_scans(image, path.read_bytes() if "progressive" in image.info else b"")
    with pillow():
        if header.tiff is not None:
            if header.tiff.subifd is not None:
                raise DamagedFile("its picture is below its thumbnail")
            image.seek(header.tiff.index)
        image.load()
        # Pillow turns a TIFF itself when it decodes it.
        turn = None if header.tiff is not None else TURNS.get(header.orientation)
        return image if turn is None else image.transpose(turn)


def read_rgba(path: Path, colours: bool = True) -> ByteArray:
    """(H, W, 4) uint8 of a picture of any mode, upright.

    colours : convert them to sRGB by the picture's profile; not for masks, whose numbers are no colours
    Raises FigureError.
    """
    return _read(path, "figure", colours)[0]


def _read(path: Path, what: str, colours: bool) -> tuple[ByteArray, tuple[str, ...]]:
    """(H, W, 4) uint8 of a picture, and remarks about it. Raises FigureError."""
    with _reading(path, what):
        header = _checked_header(path, what)
        return _rgba(path, header, colours)


def _rgba(path: Path, header: PictureHeader, colours: bool) -> tuple[ByteArray, tuple[str, ...]]:
    # libvips reads more kinds of TIFF than Pillow, and 16 bits of colours.
    deep = header.png is not None and header.png.bits == 16
    if deep or (header.tiff is not None and not pillow_only(header)):
        error = libvips().Error
        try:
            rgba, notes = rgba_of(of_vips(path, header), header, colours)
            return upright(rgba, header.orientation), notes
        except error as problem:
            if deep:
                raise DamagedFile(str(problem).strip().split("\n")[0][:100]) from None
    return rgba_of(of_pillow(_open(path, header)), header, colours)


def upright(pixels: ByteArray, orientation: int) -> ByteArray:
    """(H, W, …) picture turned and mirrored as its orientation asks for."""
    if orientation >= 5:
        pixels = pixels.swapaxes(0, 1)
    rows = -1 if orientation in (3, 4, 7, 8) else 1
    columns = -1 if orientation in (2, 3, 6, 7) else 1
    return np.ascontiguousarray(pixels[::rows, ::columns])


def read_mask(path: Path | None, view: PictureView) -> BoolArray | None:
    """(H, W) bool silhouette from a file, else from the figure's alpha; None where there is neither.

    Raises FigureError.
    """
    if path is None:
        opaque = view.rgba[..., 3] >= 128
        return None if opaque.all() else np.asarray(opaque)
    values = _of_view(path, view)
    if values.shape != view.rgba.shape:
        width, height = view.size
        found = f"{values.shape[1]}×{values.shape[0]} px, but the figure has {width}×{height}"
        raise FigureError(path, found, "pass a mask of the figure's size")
    if (values[..., 3] < 255).any():
        return values[..., 3] >= 128
    grey = values[..., :3].max(axis=2)
    # Some masks are 0/1 pictures.
    return np.asarray(grey >= (128 if grey.max() > 1 else 1))


def _of_view(path: Path, view: PictureView) -> ByteArray:
    """(H, W, 4) uint8 part of a mask in the view's window; all of it where it differs in size from the figure's."""
    if is_large(path) and view.rgba.shape[:2] != view.size[::-1] and size_of(path) == view.size:
        (x, y), (height, width) = view.corner, view.rgba.shape[:2]
        if (part := _window(path, (x, y, x + width, y + height), colours=False)) is not None:
            return part[0]
    values, _ = _read(path, "mask", colours=False)
    return values[view.window] if values.shape[:2] == view.size[::-1] else values


def read_labels(path: Path, view: PictureView) -> ByteArray:
    """(H, W) uint8 part labels from a file. Raises FigureError."""
    with _reading(path, "part labels"):
        image = _open(path, _checked_header(path, "part labels"))
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
