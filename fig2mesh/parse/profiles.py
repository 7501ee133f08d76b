"""Colours of picture files to sRGB, once, by the ICC profile or the chunks that say what their numbers mean.

As browsers do: cICP, then iCCP, sRGB, gAMA with cHRM in a PNG; the profile in all others; without any of them grey and
RGB are taken for sRGB, and CMYK is mixed without a profile. lcms converts, inside libvips, as it takes 16 bits.
"""

from __future__ import annotations

import io
import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import ByteArray
from fig2mesh.system.libvips import libvips
from georef.untrusted.picture_header import PictureHeader
from georef.untrusted.png_chunks import PngFacts

Kind = Literal["grey", "rgb", "cmyk", "lab"]

BANDS: Final[dict[Kind, int]] = {"grey": 1, "rgb": 3, "cmyk": 4, "lab": 3}
SPACES: Final = {"GRAY": "grey", "RGB": "rgb", "CMYK": "cmyk"}
MODES: Final = {"grey": "L", "rgb": "RGB", "cmyk": "CMYK"}

MAX_SRGB_ERROR: Final = 2
"""Tolerance, of 255, below which a profile is sRGB: files hold a dozen variants of it, and rounding moves them by 1."""

SRGB_GAMMA: Final = 1 / 2.2
GAMMA_TOLERANCE: Final = 0.01
"""Programs write 1/2.2 into gAMA when they mean sRGB."""

SRGB_PRIMARIES: Final = (0.3127, 0.329, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06)
"""White, red, green, blue, x and y each."""

PRIMARIES_TOLERANCE: Final = 0.002
CICP_PRIMARIES: Final = {
    1: SRGB_PRIMARIES,
    9: (0.3127, 0.329, 0.708, 0.292, 0.17, 0.797, 0.131, 0.046),
    12: (0.3127, 0.329, 0.68, 0.32, 0.265, 0.69, 0.15, 0.06),
}
"""Of sRGB, Rec. 2020 and Display P3, by code point."""

CICP_GAMMAS: Final = {1: None, 4: 2.2, 5: 2.8, 6: None, 8: 1.0, 13: None, 14: None, 15: None}
"""Exponents by code point of the transfer function; None: the curve of sRGB, or one close to it."""

D50: Final = (0.9642, 1.0, 0.8249)
BRADFORD: Final = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


@dataclass(frozen=True)
class SourceColours:
    """Meaning of the numbers of a picture.

    kind : of its samples; profile : ICC profile to convert from, None where they are sRGB, or CMYK or Lab without one
    notes : remarks, one line each
    """

    kind: Kind
    profile: bytes | None = None
    notes: tuple[str, ...] = ()


def source_colours(header: PictureHeader, kind: Kind) -> SourceColours:
    """Meaning of the samples of a picture, of a kind that its decoder gives."""
    if kind == "lab":
        return SourceColours(kind)
    profile, note = _stated(header)
    if profile is None:
        ink = "CMYK without a colour profile: its colours are approximate" if kind == "cmyk" else None
        return SourceColours(kind, None, tuple(each for each in (note, ink) if each))
    space = _space(profile)
    if space is None:
        return SourceColours(kind, None, ("its colour profile is damaged; its colours are taken for sRGB",))
    # Programs keep the RGB profile when they save a picture without colours as grey.
    if space != kind and not (space == "rgb" and kind == "grey"):
        named = {"grey": "grey", "rgb": "RGB", "cmyk": "CMYK"}
        finding = f"its colour profile is of {named.get(space, space)}, the picture of {named[kind]}"
        return SourceColours(kind, None, (f"{finding}; the profile is ignored",))
    if space != "cmyk" and _is_srgb(profile, space):
        return SourceColours(kind)
    return SourceColours("rgb" if space == "rgb" else kind, profile)


def to_srgb(samples: NDArray[Any], source: SourceColours) -> ByteArray:
    """(H, W, 3) uint8 sRGB of samples.

    samples : (H, W, N) uint8 or uint16 of `source.kind`, one channel also where that is RGB; float64 for Lab
    """
    if source.kind == "lab":
        return _lab_to_srgb(samples)
    if source.profile is not None:
        wide = np.repeat(samples, 3, axis=2) if samples.shape[2] == 1 and source.kind == "rgb" else samples
        return _converted(wide, source.profile, source.kind)
    if samples.dtype == np.uint16:
        samples = to_bytes(samples)
    if source.kind == "cmyk":
        light = 255 - samples.astype(np.uint32)
        product = light[..., :3] * light[..., 3:] + 128
        return np.asarray(((product >> 8) + product) >> 8, np.uint8)
    return samples if samples.shape[2] == 3 else np.repeat(samples, 3, axis=2)


def to_bytes(values: NDArray[np.uint16]) -> ByteArray:
    """Samples of 16 bits as 8 bits, rounded."""
    return ((values.astype(np.uint32) + 128) // 257).astype(np.uint8)


def _stated(header: PictureHeader) -> tuple[bytes | None, str | None]:
    """Profile that a file states, and a remark."""
    if header.png is None or (header.profile is not None and header.png.cicp is None):
        return header.profile, None
    png = header.png
    if png.cicp is not None:
        primaries, transfer, _, _ = png.cicp
        if primaries not in CICP_PRIMARIES or transfer not in CICP_GAMMAS:
            found = f"its colours are of cICP {primaries} {transfer}, which is not converted"
            return header.profile, f"{found}; they may be wrong"
        return _of_primaries(CICP_PRIMARIES[primaries], CICP_GAMMAS[transfer]), None
    if png.profile:
        return None, "its colour profile is damaged; its colours are taken for sRGB"
    return (None, None) if png.srgb else _of_gamma(png)


def _of_gamma(png: PngFacts) -> tuple[bytes | None, str | None]:
    stated = png.chromaticities
    other = stated is not None and max(np.abs(np.subtract(stated, SRGB_PRIMARIES))) > PRIMARIES_TOLERANCE
    if png.gamma is None:
        ignored = "its primaries (cHRM) without gamma are ignored; its colours are taken for sRGB"
        return None, ignored if other else None
    gamma = None if abs(png.gamma - SRGB_GAMMA) <= GAMMA_TOLERANCE else 1 / png.gamma
    if gamma is not None and not 0.1 <= gamma <= 10:
        return None, f"its gamma of {png.gamma:g} is ignored; its colours are taken for sRGB"
    try:
        return _of_primaries(stated if other and stated is not None else SRGB_PRIMARIES, gamma), None
    except np.linalg.LinAlgError:
        return None, "its primaries (cHRM) are damaged; its colours are taken for sRGB"


def _of_primaries(primaries: tuple[float, ...], gamma: float | None) -> bytes | None:
    """Profile of RGB with primaries and an exponent, None: the curve of sRGB; None where that is sRGB itself."""
    if gamma is None and primaries == SRGB_PRIMARIES:
        return None
    return matrix_profile(primaries, gamma)


def matrix_profile(primaries: tuple[float, ...], gamma: float | None) -> bytes:
    """ICC profile of RGB.

    primaries : x and y of white, red, green and blue; gamma : exponent of the curve, None: the curve of sRGB
    Raises LinAlgError for primaries that span no colours. https://www.color.org/specification/ICC.1-2022-05.pdf
    """
    xy = np.array(primaries, np.float64).reshape(4, 2)
    if (xy[:, 1] <= 0).any():
        raise np.linalg.LinAlgError
    xyz = np.stack([xy[:, 0] / xy[:, 1], np.ones(4), (1 - xy.sum(axis=1)) / xy[:, 1]], axis=1)
    colorants = xyz[1:].T * np.linalg.solve(xyz[1:].T, xyz[0])
    gains = (BRADFORD @ D50) / (BRADFORD @ xyz[0])
    colorants = np.linalg.solve(BRADFORD, gains[:, None] * (BRADFORD @ colorants))
    if not np.isfinite(colorants).all() or np.abs(colorants).max() > 100:
        raise np.linalg.LinAlgError
    tags = {name: _xyz(colorants[:, index]) for index, name in enumerate((b"rXYZ", b"gXYZ", b"bXYZ"))}
    curve = _curve(gamma)
    tags |= {b"wtpt": _xyz(D50), b"rTRC": curve, b"gTRC": curve, b"bTRC": curve}
    return _profile(b"RGB ", tags)


def _curve(gamma: float | None) -> bytes:
    if gamma is not None:
        return struct.pack(">4s4xH2xi", b"para", 0, round(gamma * 65536))
    numbers = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
    return struct.pack(">4s4xH2x5i", b"para", 3, *(round(number * 65536) for number in numbers))


def _xyz(values: Any) -> bytes:
    return struct.pack(">4s4x3i", b"XYZ ", *(round(float(value) * 65536) for value in values))


def _profile(space: bytes, tags: dict[bytes, bytes]) -> bytes:
    """Profile of a display, version 4, of tags whose lengths are multiples of four."""
    text = "colours".encode("utf-16-be")
    name = struct.pack(">4s4xII2s2sII", b"mluc", 1, 12, b"en", b"US", len(text), 28) + text
    tags = tags | {
        b"desc": name.ljust(-(-len(name) // 4) * 4, b"\0"),
        b"cprt": name.ljust(-(-len(name) // 4) * 4, b"\0"),
    }
    start = 128 + 4 + 12 * len(tags)
    table, body = struct.pack(">I", len(tags)), b""
    for tag, data in tags.items():
        table += struct.pack(">4sII", tag, start + len(body), len(data))
        body += data
    header = struct.pack(
        ">I4xI4s4s4s12s4s4x4x4x4x8xI3i", start + len(body), 0x04300000, b"mntr", space, b"XYZ ", bytes(12), b"acsp", 0,
        *(round(value * 65536) for value in D50),
    )  # fmt: skip
    return header.ljust(128, b"\0") + table + body


@lru_cache(maxsize=16)
def _space(profile: bytes) -> str | None:
    """Kind of samples that a profile is for, or its own name of another space; None for a damaged profile."""
    from PIL import ImageCms

    try:
        opened = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        name = opened.profile.xcolor_space.strip()
        if (space := SPACES.get(name)) is not None:
            ImageCms.buildTransform(opened, ImageCms.createProfile("sRGB"), MODES[space], "RGB")
    except (OSError, ImageCms.PyCMSError, ValueError, TypeError):
        return None
    return space or name or None


@lru_cache(maxsize=16)
def _is_srgb(profile: bytes, space: Kind) -> bool:
    axis = np.linspace(0, 255, 9).round().astype(np.uint8)
    cube = axis[:, None, None] if space == "grey" else np.stack(np.meshgrid(axis, axis, axis), -1).reshape(27, 27, 3)
    apart = _converted(cube, profile, space).astype(int) - cube.astype(int)
    return bool(np.abs(apart).max() <= MAX_SRGB_ERROR)


def _converted(samples: NDArray[Any], profile: bytes, kind: Kind) -> ByteArray:
    pyvips = libvips()
    deep = samples.dtype == np.uint16
    names = {"grey": ("b-w", "grey16"), "rgb": ("srgb", "rgb16"), "cmyk": ("cmyk", "cmyk"), "lab": ("lab", "lab")}
    image = _image(samples, names[kind][deep])
    image.set_type(pyvips.GValue.blob_type, "icc-profile-data", profile)
    done = image.icc_transform("srgb", embedded=True, intent="perceptual", depth=8)
    return np.asarray(done.numpy(), np.uint8)


def _lab_to_srgb(samples: NDArray[Any]) -> ByteArray:
    image = _image(samples.astype(np.float32), "lab")
    done = image.icc_export(output_profile="srgb", pcs="lab", intent="relative", depth=8)
    return np.asarray(done.numpy(), np.uint8)


def _image(samples: NDArray[Any], interpretation: str) -> Any:
    pyvips = libvips()
    height, width, bands = samples.shape
    data = np.ascontiguousarray(samples)
    formats = {"uint8": "uchar", "uint16": "ushort", "float32": "float"}
    image = pyvips.Image.new_from_memory(data.tobytes(), width, height, bands, formats[str(data.dtype)])
    return image.copy(interpretation=interpretation)
