"""Reader of drawn contours from glTF files, as `exporters.gltf.outline` writes them."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import ByteArray, FloatArray, OutlineMesh, Texture
from exporters.colour import srgb_from_linear
from exporters.gltf.outline import HULL, OUTLINE
from exporters.gltf.reader import Gltf
from exporters.sampling import sample
from georef.untrusted.damage import DamagedFile, decoding
from georef.untrusted.image_file import check_header


def read_outline(gltf: Gltf, surface: NDArray[Any]) -> OutlineMesh | None:
    """Read the first outline of the default scene, ASSET; None in files without.

    surface : (S, 3) vertices of the solid in the file: what they were before they were inset is not recorded

    Raises DamagedFile for invalid data.
    """
    found = gltf.scene_outlines()
    if not found or not len(found[0][2]):
        return None
    form, vertices, faces = found[0]
    index = next(index for index, each in gltf.outlines.items() if each == form)
    colors = _colors(gltf, gltf.primitives(index)[0], len(vertices))
    width = gltf.item("meshes", index)["extras"][OUTLINE].get("width_m")
    if not isinstance(width, float | int) or not 0 <= width < np.inf or not np.isfinite(vertices).all():
        raise DamagedFile("an outline without a width, or with vertices that are not finite")
    return OutlineMesh(vertices, faces.astype(np.int32), colors, form == HULL, surface, float(width))


def _colors(gltf: Gltf, primitive: dict[str, Any], count: int) -> ByteArray:
    """(N, 3) sRGB colours of the vertices of an outline: of its texture, its vertices or its material."""
    attributes = primitive["attributes"]
    surface = gltf.item("materials", primitive["material"])["pbrMetallicRoughness"] if "material" in primitive else {}
    if "COLOR_0" in attributes:
        colors = _bytes(np.atleast_2d(gltf.numbers(attributes["COLOR_0"]))[:, :3])
    elif isinstance(surface.get("baseColorTexture"), dict) and "TEXCOORD_0" in attributes:
        colors = sample(_texture(gltf, surface["baseColorTexture"]), gltf.vectors(attributes["TEXCOORD_0"], 2))
    else:
        colors = np.tile(_bytes(np.array(surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))[:3])), (count, 1))
    if colors.shape != (count, 3):
        raise DamagedFile("colours of an outline that are not those of its vertices")
    return colors


def _texture(gltf: Gltf, reference: dict[str, Any]) -> Texture:
    from PIL import Image

    texture = reference.get("index")
    if not isinstance(texture, int) or texture < 0 or "source" not in gltf.item("textures", texture):
        raise DamagedFile("an outline without the texture of its colours")
    data = gltf.image(gltf.item("textures", texture)["source"])
    check_header(data)
    with decoding("invalid picture", OSError, ValueError, SyntaxError), Image.open(io.BytesIO(data)) as image:
        return Texture(np.asarray(image.convert("RGB")))


def _bytes(linear: NDArray[Any]) -> ByteArray:
    values: FloatArray = np.clip(np.nan_to_num(linear), 0.0, 1.0)
    return np.asarray(np.rint(255 * srgb_from_linear(values)), dtype=np.uint8)
