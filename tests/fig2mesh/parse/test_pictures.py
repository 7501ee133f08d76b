"""One scene in many files reads the same: whole, in windows, as large pictures, whatever the file."""

from __future__ import annotations

import io
import logging
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from fig2mesh.errors import FigureError
from fig2mesh.parse import window
from fig2mesh.parse.picture import read_labels, read_mask, read_rgba, read_view
from fig2mesh.parse.profiles import matrix_profile
from fig2mesh.parse.window import is_large, read_window, size_of
from georef.untrusted.picture_header import read_header
from tests.fig2mesh.parse import scenes
from tests.fig2mesh.parse.scenes import GREY_WAYS, ORIENTED, WAYS, chunk, exif, itxt, png, scene, turned, write, xmp

BOX = (5, 3, 41, 30)

LOSSY = {"jpeg": 6, "avif": 6, "mpo": 6, "tiff JPEG": 6, "tiff YCbCr": 3, "tiff Lab": 4, "tiff half": 1}
ROUNDED = 3
"""Tolerance of 8 bits in another space."""


def tolerance(name: str) -> int:
    lossy = max((value for start, value in LOSSY.items() if name.startswith(start)), default=0)
    spaces = ("profile", "Adobe", "ProPhoto", "P3", "gAMA", "gamma", "linear", "cHRM", "bit", "Lab")
    return lossy + (ROUNDED if any(space in name for space in spaces) else 0) + (3 if "ProPhoto" in name else 0)


def apart(one: np.ndarray, other: np.ndarray) -> int:
    assert one.shape == other.shape
    return int(np.abs(one.astype(int) - other.astype(int)).max())


def check_alike(path: Path, name: str, expected: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = read_rgba(path)
    assert apart(whole[..., :3], expected) <= tolerance(name)
    assert (whole[..., 3] == 255).all()
    assert size_of(path) == (48, 36)
    x0, y0, x1, y1 = BOX
    part = read_view(path, BOX)
    assert np.array_equal(part.rgba, whole[y0:y1, x0:x1])
    monkeypatch.setattr(window, "LARGE_PX", 100)
    large = read_view(path, BOX)
    assert large.size == (48, 36)
    # Two decoders of lossy formats may round apart.
    assert apart(large.rgba, part.rgba) <= (3 if tolerance(name) >= 6 else 0)


@pytest.mark.parametrize("name", WAYS)
def test_one_scene_in_many_ways(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    check_alike(write(tmp_path, name, WAYS[name](scene())), name, scene(), monkeypatch)


@pytest.mark.parametrize("name", GREY_WAYS)
def test_one_grey_scene_in_many_ways(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    grey = scenes.grey_scene()
    expected = np.repeat(grey[..., None], 3, axis=2)
    if "NaN" in name:
        expected = np.where(expected == grey.min(), 0, expected)
    check_alike(write(tmp_path, name, GREY_WAYS[name](grey)), name, expected, monkeypatch)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("name", ORIENTED)
def test_orientation_wherever_it_stands(
    tmp_path: Path, name: str, orientation: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path, name, ORIENTED[name](turned(scene(), orientation), orientation))
    assert read_header(path).orientation == orientation
    assert size_of(path) == (48, 36)
    assert apart(read_rgba(path)[..., :3], scene()) <= tolerance(name)
    monkeypatch.setattr(window, "LARGE_PX", 100)
    assert is_large(path) == (orientation == 1)
    x0, y0, x1, y1 = BOX
    assert apart(read_view(path, BOX).rgba[..., :3], scene()[y0:y1, x0:x1]) <= tolerance(name) + 3
    # Masks follow the same rule.
    mask = turned((scene()[..., 0] > 150).astype(np.uint8) * 255, orientation)
    found = read_mask(write(tmp_path, name, ORIENTED[name](mask, orientation)), read_view(path, None))
    assert found is not None
    assert (found == (scene()[..., 0] > 150)).mean() > 0.98


def test_sources_that_contradict_each_other(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(png(turned(scene(), 6), before=itxt(xmp(3)) + chunk(b"eXIf", exif(6)[6:])))
    assert apart(read_view(path, None).rgba[..., :3], scene()) == 0, "EXIF comes before XMP"
    assert "its orientation is 6 by EXIF, but XMP 3; EXIF counts" in caplog.text
    path.write_bytes(png(scene(), before=itxt(xmp(6)) + chunk(b"eXIf", exif(1)[6:])))
    assert apart(read_rgba(path)[..., :3], scene()) == 0, "also where it says upright"
    path.write_bytes(png(turned(scene(), 3), before=itxt(xmp(3)) + chunk(b"eXIf", exif(99)[6:])))
    assert apart(read_rgba(path)[..., :3], scene()) == 0, "99 is no orientation"
    path.write_bytes(png(scene(), before=itxt(b"<x tiff:Orientation='6'>") + chunk(b"eXIf", b"nonsense")))
    assert apart(read_rgba(path)[..., :3], scene()) == 0


@pytest.mark.parametrize("suffix", ["tif", "jpg"])
def test_cmyk_with_a_profile(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    inks = Image.fromarray(scenes.in_profile(scene(), scenes.CMYK), "CMYK")
    path = tmp_path / f"a.{suffix}"
    inks.save(path, icc_profile=scenes.CMYK, **({"quality": 98, "subsampling": 0} if suffix == "jpg" else {}))
    spaces = [ImageCms.ImageCmsProfile(io.BytesIO(each)) for each in (scenes.CMYK, scenes.SRGB)]
    expected = np.asarray(ImageCms.profileToProfile(inks, *spaces, outputMode="RGB"))
    assert apart(read_rgba(path)[..., :3], expected) <= (2 if suffix == "tif" else 8)
    assert np.abs(expected.astype(int) - np.asarray(inks.convert("RGB"))).mean() > 10, "else the test shows nothing"
    monkeypatch.setattr(window, "LARGE_PX", 100)
    x0, y0, x1, y1 = BOX
    assert apart(read_view(path, BOX).rgba, read_rgba(path)[y0:y1, x0:x1]) <= 3


@pytest.mark.parametrize("suffix", ["tif", "jpg"])
def test_cmyk_without_a_profile_is_mixed_as_browsers_do(
    tmp_path: Path, suffix: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    inks = Image.fromarray(scenes.in_profile(scene(), scenes.CMYK), "CMYK")
    path = tmp_path / f"a.{suffix}"
    inks.save(path, **({"quality": 98, "subsampling": 0} if suffix == "jpg" else {}))
    whole = read_view(path, None).rgba
    assert apart(whole[..., :3], np.asarray(inks.convert("RGB"))) <= (0 if suffix == "tif" else 6)
    assert "CMYK without a colour profile: its colours are approximate" in caplog.text
    monkeypatch.setattr(window, "LARGE_PX", 100)
    assert apart(read_view(path, BOX).rgba, whole[BOX[1] : BOX[3], BOX[0] : BOX[2]]) <= 3


FAULTY = {
    "cut off": (scenes.ADOBE[:200], "its colour profile is damaged"),
    "no profile": (b"profile" * 40, "its colour profile is damaged"),
    "of CMYK": (scenes.CMYK, "its colour profile is of CMYK, the picture of RGB; the profile is ignored"),
    "of grey": (scenes.grey_profile(1.0), "its colour profile is of grey, the picture of RGB"),
}


@pytest.mark.parametrize("kind", ["png", "jpeg", "tiff"])
@pytest.mark.parametrize("name", FAULTY)
def test_profiles_that_do_not_fit_are_reported(
    tmp_path: Path, name: str, kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    profile, finding = FAULTY[name]
    data = (
        scenes.tiff(scene(), iccprofile=profile)
        if kind == "tiff"
        else (png if kind == "png" else scenes.jpeg)(scene(), icc_profile=profile)
    )
    view = read_view(write(tmp_path, kind, data), None)
    assert apart(view.rgba[..., :3], scene()) <= tolerance(kind)
    assert finding in caplog.text


TOLD = {
    "png iCCP damaged": (
        lambda: png(scene(), before=chunk(b"iCCP", b"x\0\0nonsense")),
        "its colour profile is damaged",
    ),
    "png cHRM alone": (
        lambda: png(
            scene(), before=chunk(b"cHRM", struct.pack(">8I", *[31270, 32900, 64000, 33000, 21000, 71000, 15000, 6000]))
        ),
        "primaries (cHRM) without gamma are ignored",
    ),
    "png cHRM damaged": (
        lambda: png(scene(), before=chunk(b"gAMA", struct.pack(">I", 45455)) + chunk(b"cHRM", bytes(32))),
        "its primaries (cHRM) are damaged",
    ),
    "png cICP of PQ": (lambda: png(scene(), before=chunk(b"cICP", bytes([9, 16, 0, 1]))), "which is not converted"),
    "tiff two pages": (lambda: WAYS["tiff two pages"](scene()), "it holds 2 pictures; the first is read"),
    "webp animated": (lambda: WAYS["webp animated"](scene()), "it holds 2 frames; the first is read"),
    "tiff 12 of 16 bit": (lambda: WAYS["tiff 12 of 16 bit"](scene()), "4095 is taken for white"),
    "tiff negative": (lambda: scenes.tiff((scene()[..., 0].astype(np.int16) - 90) * 120), "negative ones are black"),
    "tiff bright floats": (lambda: scenes.tiff(scene().astype(np.float32) * 200), "65535 is taken for white"),
}


@pytest.mark.parametrize("name", TOLD)
def test_what_a_picture_holds_besides_is_logged(tmp_path: Path, name: str, caplog: pytest.LogCaptureFixture) -> None:
    make, finding = TOLD[name]
    read_view(write(tmp_path, name, make()), None)
    assert finding in caplog.text


QUIET = (
    "png",
    "png sRGB profile",
    "png gAMA of sRGB",
    "jpeg",
    "mpo",
    "tiff",
    "tiff thumbnail first",
    "tiff overviews behind",
)


@pytest.mark.parametrize("name", QUIET)
def test_ordinary_pictures_are_read_without_a_word(tmp_path: Path, name: str, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        read_view(write(tmp_path, name, WAYS[name](scene())), None)
    assert caplog.text == ""


def test_alpha_is_straight_whatever_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rgb = scene()
    half = np.full(rgb.shape[:2], 128, np.uint8)
    half[:, :20] = 255
    half[:5] = 0
    straight = np.dstack([rgb, half])
    deep = scenes.deep(straight)
    product = np.dstack([np.rint(deep[..., :3] * (deep[..., 3:] / 65535)).astype(np.uint16), deep[..., 3]])
    files = {
        "png": png(straight),
        "webp": scenes.pillow_file(straight, "WEBP", lossless=True, exact=True),
        "png 16 bit": scenes.vips_file(deep, ".png"),
        "tiff": scenes.tiff(straight, extrasamples=["unassalpha"]),
        "tiff 16": scenes.tiff(deep, extrasamples=["unassalpha"]),
        "tiff associated": scenes.tiff((product // 257).astype(np.uint8), extrasamples=["assocalpha"]),
        "tiff associated 16": scenes.tiff(product, extrasamples=["assocalpha"]),
    }
    seen = half > 0
    for name, data in files.items():
        path = write(tmp_path, name, data)
        monkeypatch.setattr(window, "LARGE_PX", 16_000_000)
        whole = read_rgba(path)
        assert np.array_equal(whole[..., 3], half), name
        assert apart(whole[seen], straight[seen]) <= (3 if "associated" in name else 0), name
        monkeypatch.setattr(window, "LARGE_PX", 100)
        assert np.array_equal(read_view(path, BOX).rgba, whole[BOX[1] : BOX[3], BOX[0] : BOX[2]]), name


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_transparent_colours(tmp_path: Path, mode: str, bits: int) -> None:
    """tRNS of PNGs without an alpha channel, of 8 and of 16 bits."""
    pixels = scene() if mode == "RGB" else scenes.grey_scene()
    key = pixels[0, 0]
    plain = png(pixels) if bits == 8 else scenes.vips_file(scenes.deep(pixels), ".png")
    factor = 257 if bits == 16 else 1
    values = [int(v) * factor for v in np.atleast_1d(key)]
    path = tmp_path / "a.png"
    path.write_bytes(scenes.insert(plain, chunk(b"tRNS", struct.pack(f">{len(values)}H", *values))))
    expected = np.where((pixels == key).all(axis=2) if mode == "RGB" else pixels == key, 0, 255)
    assert np.array_equal(read_rgba(path)[..., 3], expected)
    assert np.array_equal(read_window(path, (0, 0, 48, 36))[0][..., 3], expected)


def test_masks_are_numbers_and_no_colours(tmp_path: Path) -> None:
    """A mask keeps its threshold under a profile that would move it."""
    grey = np.full((36, 48), 100, np.uint8)
    grey[10:20] = 140
    view = read_view(write(tmp_path, "png", png(scene())), None)
    path = tmp_path / "mask.png"
    path.write_bytes(png(grey, icc_profile=scenes.grey_profile(1.0)))
    assert np.array_equal(read_mask(path, view), grey >= 128)
    for name, data in {
        "0/1": scenes.tiff((grey > 120).astype(np.uint16)),
        "16 bit": scenes.tiff(scenes.deep(grey)),
    }.items():
        assert np.array_equal(read_mask(write(tmp_path, "tiff", data), view), grey >= 128), name


def test_profiles_of_our_own_are_those_of_others() -> None:
    """Display P3 of its primaries against the profile that libvips brings, both read by lcms."""
    made = matrix_profile((0.3127, 0.329, 0.68, 0.32, 0.265, 0.69, 0.15, 0.06), None)
    assert apart(scenes.in_profile(scene(), made), scenes.in_profile(scene(), scenes.P3)) <= 1


def test_inks_without_the_marker_of_adobe(tmp_path: Path) -> None:
    """Pillow and libvips take every JPEG of CMYK for inverted, with the marker and without."""
    stream = io.BytesIO()
    inks = Image.fromarray(scenes.in_profile(scene(), scenes.CMYK), "CMYK")
    inks.save(stream, "JPEG", quality=98, subsampling=0)
    data = stream.getvalue()
    start = data.index(b"\xff\xee")
    (length,) = struct.unpack(">H", data[start + 2 : start + 4])
    path = write(tmp_path, "jpeg", data[:start] + data[start + 2 + length :])
    assert apart(read_rgba(path)[..., :3], np.asarray(inks.convert("RGB"))) <= 6
    assert apart(read_window(path, (0, 0, 48, 36))[0], read_rgba(path)) <= 3


@pytest.mark.parametrize("orientation", [1, 2, 3, 6, 7])
@pytest.mark.parametrize("way", ["png XMP packed", "png raw exif", "tiff tag", "tiff XMP"])
def test_part_labels_follow_the_same_rule(tmp_path: Path, way: str, orientation: int) -> None:
    labels = np.zeros((36, 48), np.uint8)
    labels[:5], labels[20:, 40:] = 3, 7
    view = read_view(write(tmp_path, "png", png(scene())), None)
    path = write(tmp_path, way, ORIENTED[way](turned(labels, orientation), orientation))
    assert np.array_equal(read_labels(path, view), labels)
    thumbnail_first = scenes.pages_of_labels(labels)
    assert np.array_equal(read_labels(write(tmp_path, "tiff", thumbnail_first), view), labels)


def test_twelve_bits_packed(tmp_path: Path) -> None:
    grey = scenes.grey_scene()
    bits = np.unpackbits((grey.astype(np.uint16) * 16).astype(">u2").view(np.uint8).reshape(36, 48, 2), axis=2)
    data = np.packbits(bits[:, :, 4:].reshape(36, -1), axis=1).tobytes()
    tags = {256: 48, 257: 36, 258: 12, 259: 1, 262: 1, 273: 8, 277: 1, 278: 36, 279: len(data)}
    table = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags.items())
    head = struct.pack("<2sHI", b"II", 42, 8 + len(data)) + data
    path = write(tmp_path, "tiff", head + struct.pack("<H", len(tags)) + table + bytes(4))
    assert apart(read_rgba(path)[..., 0], grey) <= 1
    assert apart(read_view(path, BOX).rgba[..., 0], grey[BOX[1] : BOX[3], BOX[0] : BOX[2]]) <= 1


def test_what_cannot_be_decoded_is_no_black_picture(tmp_path: Path) -> None:
    path = write(tmp_path, "tiff zstd", WAYS["tiff zstd"](scene()))
    with pytest.raises(FigureError, match="cannot be read"):
        read_window(path, BOX)
    path = write(tmp_path, "tiff double", scenes.tiff(scene() / 255))
    with pytest.raises(FigureError, match="give a PNG, JPEG, TIFF or WebP"):
        read_view(path, None)
