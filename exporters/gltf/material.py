"""Material of a figure in glTF, and its texture in the formats that clients read.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_materials_unlit
https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_texture_webp
https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_texture_basisu
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import Texture, TexturedMesh
from exporters.colour import linear_from_srgb
from exporters.gltf.document import Document
from exporters.profiles import Profile

LINEAR, LINEAR_MIPMAP_LINEAR, CLAMP_TO_EDGE = 9729, 9987, 33071

TEXTURE_EXTENSIONS = {"webp": "EXT_texture_webp", "ktx2": "KHR_texture_basisu"}


def material(document: Document, mesh: TexturedMesh, lit: bool, profile: Profile) -> int:
    """Add the material and, of a textured mesh, `images[0]` without data; returns the material's index."""
    surface: dict[str, Any] = {"metallicFactor": 0.0, "roughnessFactor": 0.9}
    if mesh.texture is not None:
        wrap = {"wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE}
        document.json["samplers"] = [{"magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR, **wrap}]
        document.json["images"] = [{"name": "texture"}]  # its data is stored differently in .glb and .gltf
        texture: dict[str, Any] = {"sampler": 0}
        extension = TEXTURE_EXTENSIONS.get(profile.texture)
        if extension is None:
            texture["source"] = 0
        else:
            document.require(extension)
            texture["extensions"] = {extension: {"source": 0}}
        document.json["textures"] = [texture]
        surface["baseColorTexture"] = {"index": 0}
    elif mesh.colors is not None and not profile.vertex_colors:
        mean = linear_from_srgb(mesh.colors / 255.0).mean(axis=0)
        surface["baseColorFactor"] = [*np.round(mean, 4).tolist(), 1.0]
    item: dict[str, Any] = {"name": "drawing", "pbrMetallicRoughness": surface}
    if not lit and profile.extensions:
        # Shading is part of the drawing. Viewers without unlit use the other fields.
        document.used.add("KHR_materials_unlit")
        item["extensions"] = {"KHR_materials_unlit": {}}
    return document.add("materials", item)


def texture_file(texture: Texture, profile: Profile) -> tuple[bytes, str]:
    """Encode a texture in the profile's format; returns the bytes of the file and its MIME type.

    Raises ExportError where the encoder is not installed.
    """
    if profile.texture == "png":
        return texture.png, "image/png"
    if profile.texture == "ktx2":
        from exporters.gltf.ktx2 import encode

        return encode(texture), "image/ktx2"
    from PIL import Image

    pixels = texture.pixels[:, :, 0] if texture.pixels.shape[2] == 1 else texture.pixels
    stream = io.BytesIO()
    # Lossless: the same pixels as the PNG. Exact: keeps colours under full transparency.
    image = Image.fromarray(pixels)
    (image.convert("RGB") if image.mode == "L" else image).save(stream, "WEBP", lossless=True, exact=True, quality=50)
    return stream.getvalue(), "image/webp"


def linear_rgba(colors: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Convert sRGB bytes (V, 3) to COLOR_0: linear light, 16 bits, opaque."""
    # COLOR_0 is linear, and 8 bits of linear light cause banding in dark colours. Alpha aligns the rows to 4 bytes.
    rgba = np.full((len(colors), 4), 65535, dtype=np.uint16)
    rgba[:, :3] = np.rint(linear_from_srgb(colors / 255.0) * 65535)
    return rgba
