"""Two hundred combinations of pictures and georeferences, each with its outcome: right, reported, refused, or silent.

"right": the same pixels within the tolerance of the format, or the same place within a metre, without a remark.
"reported": used, with a remark. "refused": an error of one line. "silent": wrong without a word; there must be none.
"""

from __future__ import annotations

import io
import json
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import tifffile
from numpy.typing import NDArray
from PIL import Image

from fig2mesh.errors import InputError
from fig2mesh.parse import window
from fig2mesh.parse.picture import read_view
from georef.mapsheet import read_sheet
from tests.fig2mesh.parse import scenes
from tests.georef.sheets import sheets
from tests.pairwise import pairwise

Choice = dict[str, Any]

PROFILES = {
    "none": None,
    "sRGB": scenes.SRGB,
    "Adobe RGB": scenes.ADOBE,
    "ProPhoto": scenes.PROPHOTO,
    "Display P3": scenes.P3,
    "damaged": b"no profile" * 20,
    "of CMYK": scenes.CMYK,
}
SIZES = {"small": (48, 36), "upright": (37, 53), "strip": (90, 16), "odd": (61, 61)}

PICTURES = {
    "format": (
        "png",
        "png 16 bit",
        "jpeg",
        "webp",
        "avif",
        "tiff",
        "tiff 16 bit",
        "tiff tiles",
        "tiff thumbnail first",
    ),
    "size": tuple(SIZES),
    "orientation": ("upright", "EXIF 3", "EXIF 6", "XMP 8", "XMP 5", "EXIF 6, XMP 3", "EXIF 1, XMP 6"),
    "profile": tuple(PROFILES),
    "window": ("whole", "window", "window of a large picture"),
}

KINDS = ("points", "points in degrees", "annotation", "annotation without size", "tiepoints", "world file", "GeoTIFF")
SHEETS = {"400×300": (400, 300), "300×420": (300, 420), "1200×900": (1200, 900)}
DAMAGES = (
    "none", "halved", "doubled", "quartered", "mirrored", "turned by 90°", "turned by its orientation", "axes swapped",
    "other reference system", "another aspect", "one point left", "source in degrees",
)  # fmt: skip
AFFINE = ("world file", "GeoTIFF")
OF_POINTS = ("one point left",)
UNKNOWN_OF_AFFINE = ("halved", "doubled", "quartered", "turned by 90°", "another aspect", "one point left")
"""Nothing in a picture or an affine map says that the other was changed; with control points, their places do."""


def picture_choices() -> list[Choice]:
    # XMP does not turn an AVIF, whose boxes do.
    return pairwise(PICTURES, lambda choice: choice["format"] != "avif" or not choice["orientation"].startswith("XMP"))


def sheet_choices() -> Iterator[Choice]:
    for kind in KINDS:
        for size in SHEETS:
            for damage in DAMAGES:
                unknown = kind in AFFINE and damage in UNKNOWN_OF_AFFINE
                degrees = damage == "source in degrees" and kind not in ("points", "points in degrees")
                # Longitude and latitude of the test sheet are not those of another reference system.
                elsewhere = damage == "other reference system" and kind in ("points in degrees", *KINDS[2:4])
                if not (unknown or degrees or elsewhere):
                    yield {"kind": kind, "size": size, "damage": damage}


def picture_outcome(folder: Path, choice: Choice) -> str:
    """Outcome of reading one combination of a picture."""
    width, height = SIZES[choice["size"]]
    scene = scenes.scene(width, height)
    path = folder / f"a.{choice['format'].split()[0].replace('tiff', 'tif')}"
    path.write_bytes(_picture(scene, choice))
    box = None if choice["window"] == "whole" else (3, 2, width - 5, height - 3)
    log, records = logging.getLogger("fig2mesh"), _Records()
    large, level = window.LARGE_PX, log.level
    log.addHandler(records)
    try:
        window.LARGE_PX = 50 if "large" in choice["window"] else large
        rgba = read_view(path, box).rgba
    except InputError:
        return "refused"
    finally:
        log.removeHandler(records)
        log.setLevel(level)
        window.LARGE_PX = large
    x0, y0, x1, y1 = box or (0, 0, width, height)
    expected = scene[y0:y1, x0:x1]
    lossy = 9 if choice["format"] in ("jpeg", "avif") else 0
    rounded = {"none": 0, "sRGB": 0, "damaged": 0, "of CMYK": 0, "ProPhoto": 6}.get(choice["profile"], 3)
    same = rgba.shape[:2] == expected.shape[:2]
    same = same and np.abs(rgba[..., :3].astype(int) - expected).max() <= lossy + rounded
    # A remark does not excuse other pixels.
    return _outcome(True, records.lines) if same else "wrong"


def _outcome(right: bool, remarks: list[str]) -> str:
    return "reported" if remarks else "right" if right else "silent"


class _Records(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


def _picture(scene: scenes.Array, choice: Choice) -> bytes:
    stated = dict(word.split() for word in choice["orientation"].split(", ") if word != "upright")
    exif, xmp = (int(stated[name]) if name in stated else None for name in ("EXIF", "XMP"))
    pixels = scenes.turned(scene, exif or xmp or 1)
    profile = PROFILES[choice["profile"]]
    if choice["profile"] in ("Adobe RGB", "ProPhoto", "Display P3") and profile is not None:
        pixels = scenes.in_profile(pixels, profile)
    kind = choice["format"]
    if kind.startswith("png"):
        chunks = b"" if exif is None else scenes.chunk(b"eXIf", scenes.exif(exif)[6:])
        chunks += b"" if xmp is None else scenes.itxt(scenes.xmp(xmp))
        if kind == "png":
            return scenes.png(pixels, before=chunks, **({} if profile is None else {"icc_profile": profile}))
        if choice["profile"] in ("damaged", "of CMYK"):  # which libvips does not write
            import zlib

            chunks = scenes.chunk(b"iCCP", b"x\0\0" + zlib.compress(profile or b"")) + chunks
            profile = None
        return scenes.insert(scenes.vips_file(scenes.deep(pixels), ".png", profile), chunks)
    if kind.startswith("tiff"):
        extra = [] if exif is None else [(274, "H", 1, exif, True)]
        extra += [] if xmp is None else [(700, "B", len(scenes.xmp(xmp)), scenes.xmp(xmp), True)]
        options: dict[str, Any] = {"extratags": extra} | ({} if profile is None else {"iccprofile": profile})
        if kind == "tiff thumbnail first":
            return scenes.pages((pixels[::4, ::4].copy(), {"subfiletype": 1}), (pixels, options))
        deep = scenes.deep(pixels) if "16" in kind else pixels
        return scenes.tiff(deep, **options, **({"tile": (16, 16)} if "tiles" in kind else {}))
    options = {} if profile is None else {"icc_profile": profile}
    options |= {} if exif is None else {"exif": scenes.exif(exif)}
    options |= {} if xmp is None else {"xmp": scenes.xmp(xmp)}
    lossless = {"jpeg": {"quality": 98, "subsampling": 0}, "webp": {"lossless": True}}
    return scenes.pillow_file(
        pixels, kind.upper(), **options, **lossless.get(kind, {"quality": 100, "subsampling": "4:4:4"})
    )


def sheet_outcome(folder: Path, choice: Choice) -> str:
    """Outcome of placing a pixel of one combination of a georeference."""
    size, damage = SHEETS[choice["size"]], choice["damage"]
    shares = np.array([[0.06, 0.08], [0.93, 0.1], [0.95, 0.92], [0.07, 0.9], [0.5, 0.45]])
    pixels = shares * size
    written, coordinates = pixels.copy(), sheets.swiss(pixels)
    scale, actual, orientation = 1.0, size, 1
    if damage in ("halved", "doubled", "quartered"):
        scale = {"halved": 0.5, "doubled": 2.0, "quartered": 0.25}[damage]
        actual = (round(size[0] * scale), round(size[1] * scale))
    elif damage == "mirrored":
        written = written * (-1, 1) + (size[0], 0)
    elif damage == "turned by 90°":
        actual = size[::-1]
    elif damage == "turned by its orientation":
        orientation = 6
    elif damage == "another aspect":
        actual = (round(size[0] * 0.7), size[1])
    elif damage == "one point left":
        written, coordinates = written[:1], coordinates[:1]
    probe = np.array([0.6, 0.55]) * size
    truth = sheets.lonlat(sheets.swiss(probe))[0]
    at = probe * scale
    if damage == "turned by 90°":
        at = np.array([size[1] - probe[1], probe[0]])
    try:
        sheet = read_sheet(_sheet(folder, choice, actual, orientation, written, coordinates))
        place = sheet.place(*at.tolist())
    except InputError:
        return "refused"
    distance = pyproj.Geod(ellps="WGS84").inv(place.lon_deg, place.lat_deg, *truth)[2]
    return _outcome(distance < 1, [*sheet.notes, *place.notes])


def _sheet(
    folder: Path,
    choice: Choice,
    size: tuple[int, int],
    orientation: int,
    pixels: NDArray[np.float64],
    coordinates: NDArray[np.float64],
) -> Path:
    """Write a picture and its georeference."""
    kind, damage = choice["kind"], choice["damage"]
    crs = sheets.SWISS
    if damage == "other reference system":
        coordinates = coordinates - (2_000_000, 1_000_000)  # the old Swiss grid under the name of the new one
    if kind == "points in degrees" or kind.startswith("annotation"):
        coordinates, crs = sheets.lonlat(coordinates), "EPSG:4326"
    if damage == "axes swapped":
        coordinates = coordinates[:, ::-1]
    if damage == "source in degrees":
        pixels = sheets.lonlat(sheets.swiss(pixels)) * (1, -1) + 0.001
    if kind in ("tiepoints", "GeoTIFF"):
        return _geotiff(folder / "map.tif", kind, size, orientation, pixels, coordinates)
    path = folder / "map.png"
    stream = io.BytesIO()
    Image.new("L", size).save(stream, "PNG")
    chunks = b"" if orientation == 1 else scenes.itxt(scenes.xmp(orientation))
    path.write_bytes(scenes.insert(stream.getvalue(), chunks))
    if kind == "world file":
        sheets.world_file(folder / "map.pgw", _affine(pixels, coordinates))
        (folder / "map.prj").write_text(crs)
    elif kind.startswith("annotation"):
        document = sheets.annotation(pixels, coordinates, SHEETS[choice["size"]])
        if "without" in kind:
            document["target"] = "https://example.org/picture.jpg"
        (folder / "map.json").write_text(json.dumps(document))
    else:
        rows = [
            f"{e!r},{n!r},{x!r},{-y!r},1" for (x, y), (e, n) in zip(pixels.tolist(), coordinates.tolist(), strict=True)
        ]
        (folder / "map.points").write_text("\n".join([f"#CRS: {crs}", "mapX,mapY,sourceX,sourceY,enable", *rows]))
    return path


def _affine(pixels: NDArray[np.float64], coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
    basis = np.concatenate([pixels, np.ones((len(pixels), 1))], axis=1)
    return np.asarray(np.linalg.lstsq(basis, coordinates, rcond=None)[0].T)


def _geotiff(
    path: Path,
    kind: str,
    size: tuple[int, int],
    orientation: int,
    pixels: NDArray[np.float64],
    coordinates: NDArray[np.float64],
) -> Path:
    keys = (1, 1, 0, 2, 1025, 0, 1, 1, 3072, 0, 1, 2056)
    tags: list[Any] = [(34735, "H", len(keys), keys, True), (274, "H", 1, orientation, True)]
    if kind == "GeoTIFF":
        (a, b, c), (d, e, f) = _affine(pixels, coordinates).tolist()
        tags.append((34264, "d", 16, (a, b, 0, c, d, e, 0, f, 0, 0, 0, 0, 0, 0, 0, 1), True))
    else:
        zero = np.zeros((len(pixels), 1))
        ties = np.concatenate([pixels, zero, coordinates, zero], axis=1).ravel().tolist()
        tags.append((33922, "d", len(ties), tuple(ties), True))
    tifffile.imwrite(path, np.zeros(size[::-1], np.uint8), metadata=None, extratags=tags)
    return path


def name_of(choice: Choice) -> str:
    return " · ".join(str(value) for value in choice.values())
