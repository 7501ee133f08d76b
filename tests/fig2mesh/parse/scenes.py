"""One scene, written as a picture in many ways that all mean the same."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvips
import tifffile
from numpy.typing import NDArray
from PIL import Image, ImageCms

from fig2mesh.parse.profiles import matrix_profile

Array = NDArray[np.uint8]

ADOBE = matrix_profile((0.3127, 0.329, 0.64, 0.33, 0.21, 0.71, 0.15, 0.06), 2.19921875)
PROPHOTO = matrix_profile((0.3457, 0.3585, 0.7347, 0.2653, 0.1596, 0.8404, 0.0366, 0.0001), 1.8)
LINEAR = matrix_profile((0.3127, 0.329, 0.64, 0.33, 0.3, 0.6, 0.15, 0.06), 1.0)
P3 = bytes(pyvips.Image.profile_load("p3"))
CMYK = bytes(pyvips.Image.profile_load("cmyk"))
SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()

XMP = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
    '<rdf:Description xmlns:tiff="http://ns.adobe.com/tiff/1.0/" {0}>{1}</rdf:Description></rdf:RDF></x:xmpmeta>'
)

INVERSE = {1: 1, 2: 2, 3: 3, 4: 4, 5: 5, 6: 8, 7: 7, 8: 6}
"""Orientation that undoes each."""


def scene(width: int = 48, height: int = 36) -> Array:
    """(H, W, 3) soft colours, another one in each corner, so that every turn of it is another picture."""
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    rgb = np.stack([70 + 120 * x, 60 + 110 * y, 190 - 80 * x * y], axis=2)
    rgb[: height // 3, : width // 4] = (190, 80, 70)
    return rgb.round().astype(np.uint8)


def grey_scene(width: int = 48, height: int = 36) -> Array:
    """(H, W) the same in greys."""
    return np.asarray(Image.fromarray(scene(width, height)).convert("L"))


def turned(pixels: Array, orientation: int) -> Array:
    """Pixels as stored in a file of an orientation, by Pillow."""
    names = {
        2: Image.Transpose.FLIP_LEFT_RIGHT, 3: Image.Transpose.ROTATE_180, 4: Image.Transpose.FLIP_TOP_BOTTOM,
        5: Image.Transpose.TRANSPOSE, 6: Image.Transpose.ROTATE_90, 7: Image.Transpose.TRANSVERSE,
        8: Image.Transpose.ROTATE_270,
    }  # fmt: skip
    image = Image.fromarray(pixels)
    return np.asarray(image if orientation == 1 else image.transpose(names[orientation]))


def chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def png(pixels: Array, *, before: bytes = b"", after: bytes = b"", **options: object) -> bytes:
    """PNG with chunks before and after its pixels."""
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", **options)
    data = stream.getvalue()
    first, last = data.index(b"IDAT") - 4, data.index(b"IEND") - 4
    return data[:first] + before + data[first:last] + after + data[last:]


def exif(orientation: int) -> bytes:
    made = Image.Exif()
    made[274] = orientation
    return made.tobytes()


def xmp(orientation: int, element: bool = False) -> bytes:
    inner = ("", f"<tiff:Orientation>{orientation}</tiff:Orientation>")
    return XMP.format(*(inner if element else (f'tiff:Orientation="{orientation}"', ""))).encode()


def itxt(packet: bytes, packed: bool = False) -> bytes:
    head = b"XML:com.adobe.xmp\0" + (b"\1\0" if packed else b"\0\0") + b"\0\0"
    return chunk(b"iTXt", head + (zlib.compress(packet) if packed else packet))


def raw_profile(kind: str, content: bytes, name: bytes = b"tEXt") -> bytes:
    """Text chunk as ImageMagick writes profiles."""
    lines = "\n".join(content.hex()[start : start + 72] for start in range(0, 2 * len(content), 72))
    text = f"\n{kind}\n{len(content):8d}\n{lines}\n".encode()
    keyword = f"Raw profile type {kind}\0".encode()
    return chunk(name, keyword + (b"\0" + zlib.compress(text) if name == b"zTXt" else text))


def jpeg(pixels: Array, **options: object) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "JPEG", quality=98, subsampling=0, **options)
    return stream.getvalue()


def pillow_file(pixels: Array, kind: str, **options: object) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind, **options)
    return stream.getvalue()


def jpeg_xmp(pixels: Array, packet: bytes) -> bytes:
    data = jpeg(pixels)
    body = b"http://ns.adobe.com/xap/1.0/\0" + packet
    return data[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:]


ORIENTED: dict[str, Callable[[Array, int], bytes]] = {
    "png eXIf": lambda p, o: png(p, before=chunk(b"eXIf", exif(o)[6:])),
    "png eXIf behind the pixels": lambda p, o: png(p, after=chunk(b"eXIf", exif(o)[6:])),
    "png XMP attribute": lambda p, o: png(p, before=itxt(xmp(o))),
    "png XMP element": lambda p, o: png(p, before=itxt(xmp(o, element=True))),
    "png XMP packed": lambda p, o: png(p, after=itxt(xmp(o), packed=True)),
    "png XMP of another prefix": lambda p, o: png(
        p, before=itxt(xmp(o).replace(b"tiff:", b"t:").replace(b":tiff", b":t"))
    ),
    "png XMP in single quotes": lambda p, o: png(p, before=itxt(xmp(o).replace(b'"', b"'"))),
    "png XMP in UTF-16": lambda p, o: png(
        p, before=itxt("\ufeff".encode("utf-16-le") + xmp(o).decode().encode("utf-16-le"))
    ),
    "png raw exif": lambda p, o: png(p, before=raw_profile("exif", exif(o))),
    "png raw exif packed": lambda p, o: png(p, after=raw_profile("exif", exif(o), b"zTXt")),
    "png raw APP1": lambda p, o: png(p, before=raw_profile("APP1", exif(o))),
    "png raw APP1 of XMP": lambda p, o: png(p, before=raw_profile("APP1", b"http://ns.adobe.com/xap/1.0/\0" + xmp(o))),
    "png raw xmp": lambda p, o: png(p, before=raw_profile("xmp", xmp(o))),
    "jpeg EXIF": lambda p, o: jpeg(p, exif=exif(o)),
    "jpeg XMP": lambda p, o: jpeg_xmp(p, xmp(o)),
    "jpeg XMP element": lambda p, o: jpeg_xmp(p, xmp(o, element=True)),
    "tiff tag": lambda p, o: tiff(p, extratags=[(274, "H", 1, o, True)]),
    "tiff XMP": lambda p, o: tiff(p, extratags=[(700, "B", len(xmp(o)), xmp(o), True)]),
    "webp EXIF": lambda p, o: pillow_file(p, "WEBP", lossless=True, exif=exif(o)),
    "webp XMP": lambda p, o: pillow_file(p, "WEBP", lossless=True, xmp=xmp(o)),
    "avif": lambda p, o: pillow_file(p, "AVIF", quality=100, subsampling="4:4:4", exif=exif(o)),
}
"""Places where a file states its orientation: writer of pixels as stored, and of the orientation."""


def tiff(pixels: NDArray[np.generic], **options: object) -> bytes:
    stream = io.BytesIO()
    options.setdefault("photometric", "rgb" if pixels.ndim == 3 else "minisblack")
    tifffile.imwrite(stream, pixels, metadata=None, **options)
    return stream.getvalue()


def pages(*each: tuple[Array, dict[str, object]]) -> bytes:
    stream = io.BytesIO()
    with tifffile.TiffWriter(stream) as writer:
        for pixels, options in each:
            writer.write(pixels, photometric="rgb" if pixels.ndim == 3 else "mask", metadata=None, **options)
    return stream.getvalue()


def pages_of_labels(labels: Array) -> bytes:
    """TIFF of part labels behind a thumbnail."""
    stream = io.BytesIO()
    with tifffile.TiffWriter(stream) as writer:
        for pixels, kind in ((labels[::4, ::4].copy(), 1), (labels, 0)):
            writer.write(pixels, photometric="minisblack", metadata=None, subfiletype=kind)
    return stream.getvalue()


def with_alpha(pixels: Array, value: int = 255) -> Array:
    return np.concatenate([pixels, np.full((*pixels.shape[:2], 1), value, pixels.dtype)], axis=2)


def in_profile(pixels: Array, profile: bytes) -> Array:
    """Pixels of sRGB in another space, by Pillow."""
    source, target = (ImageCms.ImageCmsProfile(io.BytesIO(each)) for each in (SRGB, profile))
    mode = {"GRAY": "L", "RGB ": "RGB", "CMYK": "CMYK"}[target.profile.xcolor_space]
    return np.asarray(ImageCms.profileToProfile(Image.fromarray(pixels), source, target, outputMode=mode))


def deep(pixels: Array) -> NDArray[np.uint16]:
    return pixels.astype(np.uint16) * 257


def deep_in(pixels: Array, gamma: float) -> NDArray[np.uint16]:
    """16 bits of sRGB pixels under a gamma."""
    v = pixels / 255
    linear = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    return np.rint(linear ** (1 / gamma) * 65535).astype(np.uint16)


def vips_file(pixels: NDArray[np.generic], suffix: str, profile: bytes | None = None, **options: object) -> bytes:
    name = {1: "b-w", 3: "srgb", 4: "srgb"} if pixels.dtype == np.uint8 else {1: "grey16", 3: "rgb16", 4: "rgb16"}
    bands = pixels.shape[2] if pixels.ndim == 3 else 1
    image = pyvips.Image.new_from_array(pixels, interpretation=name[bands])
    if profile is not None:
        image.set_type(pyvips.GValue.blob_type, "icc-profile-data", profile)
    # Not the orientation that libvips writes of its own accord.
    return bytes(image.write_to_buffer(suffix, keep="icc", **options))


WAYS: dict[str, Callable[[Array], bytes]] = {
    "png": png,
    "png interlaced": lambda p: vips_file(p, ".png", interlace=True),
    "png 16 bit": lambda p: vips_file(deep(p), ".png"),
    "png 16 bit alpha": lambda p: vips_file(deep(with_alpha(p)), ".png"),
    "png opaque alpha": lambda p: png(with_alpha(p)),
    "png sRGB profile": lambda p: png(p, icc_profile=SRGB),
    "png sRGB chunk": lambda p: png(p, before=chunk(b"sRGB", b"\0") + chunk(b"gAMA", struct.pack(">I", 100000))),
    "png gAMA of sRGB": lambda p: png(p, before=chunk(b"gAMA", struct.pack(">I", 45455))),
    "png gAMA linear": lambda p: insert(vips_file(deep_in(p, 1.0), ".png"), chunk(b"gAMA", struct.pack(">I", 100000))),
    "png gAMA 1/1.8": lambda p: insert(vips_file(deep_in(p, 1.8), ".png"), chunk(b"gAMA", struct.pack(">I", 55556))),
    "png cICP sRGB": lambda p: png(p, before=chunk(b"cICP", bytes([1, 13, 0, 1]))),
    "png cICP Display P3": lambda p: png(in_profile(p, P3), before=chunk(b"cICP", bytes([12, 13, 0, 1]))),
    "png cHRM of Adobe RGB": lambda p: png(
        in_profile(p, ADOBE),
        before=chunk(b"gAMA", struct.pack(">I", 45471))
        + chunk(b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 21000, 71000, 15000, 6000)),
    ),
    "png Adobe RGB": lambda p: png(in_profile(p, ADOBE), icc_profile=ADOBE),
    "png ProPhoto": lambda p: png(in_profile(p, PROPHOTO), icc_profile=PROPHOTO),
    "png Display P3": lambda p: png(in_profile(p, P3), icc_profile=P3),
    "png 16 bit linear profile": lambda p: vips_file(deep_in(p, 1.0), ".png", LINEAR),
    "jpeg": jpeg,
    "jpeg progressive": lambda p: jpeg(p, progressive=True),
    "jpeg Adobe RGB": lambda p: jpeg(in_profile(p, ADOBE), icc_profile=ADOBE),
    "webp": lambda p: pillow_file(p, "WEBP", lossless=True),
    "webp Display P3": lambda p: pillow_file(in_profile(p, P3), "WEBP", lossless=True, icc_profile=P3),
    "webp animated": lambda p: pillow_file(
        p, "WEBP", lossless=True, save_all=True, append_images=[Image.new("RGB", p.shape[1::-1])]
    ),
    "apng": lambda p: png(p, save_all=True, append_images=[Image.new("RGB", p.shape[1::-1])]),
    "mpo": lambda p: pillow_file(
        p, "MPO", quality=98, subsampling=0, save_all=True, append_images=[Image.new("RGB", (24, 18))]
    ),
    "bmp": lambda p: pillow_file(p, "BMP"),
    "ppm": lambda p: pillow_file(p, "PPM"),
    "jp2": lambda p: pillow_file(p, "JPEG2000", irreversible=False),
    "avif": lambda p: pillow_file(p, "AVIF", quality=100, subsampling="4:4:4"),
    "tiff": tiff,
    "tiff big endian": lambda p: tiff(p, byteorder=">"),
    "tiff BigTIFF": lambda p: tiff(p, bigtiff=True),
    "tiff tiles": lambda p: tiff(p, tile=(16, 16)),
    "tiff strips": lambda p: tiff(p, rowsperstrip=5),
    "tiff planes": lambda p: tiff(np.moveaxis(p, 2, 0).copy(), planarconfig="separate"),
    "tiff deflate predictor": lambda p: tiff(p, compression="zlib", predictor=True),
    "tiff LZW": lambda p: pillow_file(p, "TIFF", compression="tiff_lzw"),
    "tiff zstd": lambda p: pillow_file(p, "TIFF", compression="zstd"),
    "tiff JPEG": lambda p: vips_file(p, ".tif", compression="jpeg", Q=98),
    "tiff YCbCr": lambda p: ycbcr(p),
    "tiff 16 bit": lambda p: tiff(deep(p)),
    "tiff 16 bit planes big endian": lambda p: tiff(
        np.moveaxis(deep(p), 2, 0).copy(), planarconfig="separate", byteorder=">"
    ),
    "tiff 12 of 16 bit": lambda p: tiff(np.rint(p / 255 * 4095).astype(np.uint16)),
    "tiff 14 of 16 bit, stated": lambda p: tiff(
        np.rint(p / 255 * 16383).astype(np.uint16), extratags=[(281, "H", 3, (16383,) * 3, True)]
    ),
    "tiff signed 16 bit": lambda p: tiff(np.rint(p / 255 * 32767).astype(np.int16)),
    "tiff float 0 to 1": lambda p: tiff((p / 255).astype(np.float32)),
    "tiff float 0 to 255": lambda p: tiff(p.astype(np.float32)),
    "tiff half": lambda p: tiff((p / 255).astype(np.float16)),
    "tiff unassociated alpha": lambda p: tiff(with_alpha(p), extrasamples=["unassalpha"]),
    "tiff band beyond colours": lambda p: tiff(with_alpha(p, 90), extrasamples=["unspecified"]),
    "tiff near infrared and alpha": lambda p: tiff(
        with_alpha(with_alpha(p, 90)), extrasamples=["unspecified", "unassalpha"]
    ),
    "tiff Adobe RGB": lambda p: tiff(in_profile(p, ADOBE), iccprofile=ADOBE),
    "tiff 16 bit linear": lambda p: tiff(deep_in(p, 1.0), iccprofile=LINEAR),
    "tiff Lab": lambda p: pillow_lab(p),
    "tiff Lab 16 bit": lambda p: lab16(p),
    "tiff thumbnail first": lambda p: pages((p[::4, ::4].copy(), {"subfiletype": 1}), (p, {"subfiletype": 0})),
    "tiff picture below its thumbnail": lambda p: pages(
        (p[::4, ::4].copy(), {"subfiletype": 1, "subifds": 1}), (p, {})
    ),
    "tiff overviews behind": lambda p: pages((p, {"tile": (16, 16)}), (p[::2, ::2].copy(), {"subfiletype": 1})),
    "tiff mask first": lambda p: pages((p[..., 0] > 100, {"subfiletype": 4}), (p, {})),
    "tiff overviews below": lambda p: pages((p, {"subifds": 1}), (p[::2, ::2].copy(), {"subfiletype": 1})),
    "tiff two pages": lambda p: pages((p, {}), (255 - p, {})),
}
"""Writers of the scene in colours."""

GREY_WAYS: dict[str, Callable[[Array], bytes]] = {
    "png": png,
    "png 16 bit": lambda g: vips_file(deep(g), ".png"),
    "png with an RGB profile": lambda g: png(g, icc_profile=SRGB),
    "png gamma 1": lambda g: vips_file(deep_in(g, 1.0), ".png", grey_profile(1.0)),
    "png gamma 2.2": lambda g: vips_file(deep_in(g, 2.2), ".png", grey_profile(2.2)),
    "png gAMA 1": lambda g: insert(vips_file(deep_in(g, 1.0), ".png"), chunk(b"gAMA", struct.pack(">I", 100000))),
    "png palette": lambda g: pillow_palette(g),
    "gif": lambda g: pillow_file(g, "GIF"),
    "jpeg": jpeg,
    "jpeg gamma 2.2": lambda g: jpeg(np.rint(deep_in(g, 2.2) / 257).astype(np.uint8), icc_profile=grey_profile(2.2)),
    "tiff": tiff,
    "tiff MinIsWhite": lambda g: tiff(255 - g, photometric="miniswhite"),
    "tiff MinIsWhite 16 bit": lambda g: tiff(65535 - deep(g), photometric="miniswhite"),
    "tiff 16 bit gamma 1": lambda g: tiff(deep_in(g, 1.0), iccprofile=grey_profile(1.0)),
    "tiff float with NaN": lambda g: tiff(np.where(g == g.min(), np.nan, g / 255).astype(np.float32)),
    "tiff grey alpha": lambda g: tiff(
        with_alpha(g[..., None]), photometric="minisblack", planarconfig="contig", extrasamples=["unassalpha"]
    ),
    "pgm 16 bit": lambda g: pillow_file(deep(g), "PPM"),
}
"""Writers of the scene in greys."""


def insert(data: bytes, chunks: bytes) -> bytes:
    first = data.index(b"IDAT") - 4
    return data[:first] + chunks + data[first:]


def ycbcr(pixels: Array) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).convert("YCbCr").save(stream, "TIFF")
    return stream.getvalue()


def pillow_palette(grey: Array) -> bytes:
    image = Image.fromarray(grey)
    stream = io.BytesIO()
    image.convert("P").save(stream, "PNG")
    return stream.getvalue()


def lab_of(pixels: Array) -> NDArray[np.float32]:
    image = pyvips.Image.new_from_array(pixels)
    return np.asarray(image.icc_import(input_profile="srgb", pcs="lab", intent="relative").numpy())


def pillow_lab(pixels: Array) -> bytes:
    lab = lab_of(pixels)
    stored = np.concatenate(
        [np.rint(lab[..., :1] * 2.55).astype(np.uint8), np.rint(lab[..., 1:]).astype(np.int8).view(np.uint8)], 2
    )
    return tiff(stored, photometric="cielab")


def lab16(pixels: Array) -> bytes:
    lab = lab_of(pixels)
    stored = np.concatenate(
        [
            np.rint(lab[..., :1] * 655.35).astype(np.uint16),
            np.rint(lab[..., 1:] * 256).astype(np.int16).view(np.uint16),
        ],
        2,
    )
    return tiff(stored, photometric="cielab")


def grey_profile(gamma: float) -> bytes:
    """ICC profile of grey: that of RGB with the tag of its curve alone, under the signature of grey."""
    from fig2mesh.parse import profiles

    tags = {b"wtpt": profiles._xyz(profiles.D50), b"kTRC": profiles._curve(gamma)}
    return profiles._profile(b"GRAY", tags)


def write(folder: Path, name: str, data: bytes) -> Path:
    """Write a picture under a name with the suffix of its way."""
    path = folder / f"scene.{name.split(' ', maxsplit=1)[0].replace('tiff', 'tif')}"
    path.write_bytes(data)
    return path
