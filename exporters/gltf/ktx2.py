"""Textures as KTX 2 with Basis Universal, by the npm package ktx2-encoder.

https://registry.khronos.org/KTX/specs/2.0/ktxspec.v2.html
https://github.com/BinomialLLC/basis_universal
"""

from __future__ import annotations

import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np

from exporters.asset import Texture, TexturedMesh
from exporters.errors import ExportError
from exporters.node_packages import find_package
from georef.untrusted.damage import DamagedFile

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"

QUALITY = 255
"""Of 255: drawings are lines and plain areas, where lower qualities leave block artefacts near the lines."""

_SCRIPT = """
import { pathToFileURL } from 'node:url';
import fs from 'node:fs';
const [folder, width, height, quality] = process.argv.slice(1);
const { encodeToKTX2 } = await import(pathToFileURL(folder + '/dist/node/index.js').href);
console.log = () => {};  // the encoder reports there
const made = await encodeToKTX2(new Uint8Array(fs.readFileSync(0)), {
  isUASTC: false, qualityLevel: +quality, compressionLevel: 1, generateMipmap: true, isPerceptual: true,
  isSetKTX2SRGBTransferFunc: true, imageDecoder: async (data) => ({ data, width: +width, height: +height }),
});
fs.writeSync(1, made);
"""


def encoder() -> tuple[str, Path]:
    """Find Node.js and the folder of ktx2-encoder. Raises ExportError where either is missing."""
    tool = find_package("ktx2-encoder")
    if tool is None:
        finding = "KTX 2 needs Node.js and the npm package ktx2-encoder"
        raise ExportError("--profile", finding, "npm install ktx2-encoder, or use --profile cesiumjs")
    return tool


def encode(texture: Texture) -> bytes:
    """Encode a texture as a KTX 2 file: ETC1S, sRGB, with mipmaps.

    KHR_texture_basisu requires sides of multiples of four, see `padded`. Raises ExportError without Node.js or the
    package, or where the encoder fails.
    """
    tool = encoder()
    pixels = texture.pixels
    if pixels.shape[2] == 1:
        pixels = np.repeat(pixels, 3, axis=2)
    if pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, np.full((*pixels.shape[:2], 1), 255, np.uint8)], axis=2)
    height, width = pixels.shape[:2]
    command = [tool[0], "--input-type=module", "-e", _SCRIPT, str(tool[1]), str(width), str(height), str(QUALITY)]
    run = subprocess.run(command, input=pixels.tobytes(), capture_output=True, check=False)
    if run.returncode or not run.stdout.startswith(IDENTIFIER):
        reason = run.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["no output"]
        raise ExportError("--profile", f"ktx2-encoder failed ({reason[0][:120]})", "use --profile cesiumjs")
    return run.stdout


def padded(mesh: TexturedMesh) -> TexturedMesh:
    """Pad the texture to sides of multiples of four: its last row and column are repeated, coordinates are scaled."""
    if mesh.texture is None or mesh.uv is None:
        return mesh
    height, width = mesh.texture.pixels.shape[:2]
    wide, high = width + -width % 4, height + -height % 4
    if (wide, high) == (width, height):
        return mesh

    def grown(texture: Texture) -> Texture:
        return Texture(np.pad(texture.pixels, ((0, high - height), (0, wide - width), (0, 0)), mode="edge"))

    # A mask of another size could not be padded proportionally.
    same = mesh.observed is not None and mesh.observed.pixels.shape[:2] == (height, width)
    observed = grown(mesh.observed) if mesh.observed is not None and same else None
    shrink = (width / wide, height / high)
    outline = mesh.outline
    if outline is not None and outline.uv is not None:
        outline = replace(outline, uv=outline.uv * shrink)
    return replace(mesh, texture=grown(mesh.texture), observed=observed, uv=mesh.uv * shrink, outline=outline)


def size_of(data: bytes) -> tuple[int, int]:
    """Width and height of a KTX 2 file in pixels. Raises DamagedFile for other data."""
    if not data.startswith(IDENTIFIER) or len(data) < 48:
        raise DamagedFile("not a KTX 2 file")
    width, height = struct.unpack_from("<2I", data, 20)
    return int(width), int(height)
