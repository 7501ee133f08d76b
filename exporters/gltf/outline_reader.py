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

    Of one that shows the texture of the figure, the first of the file, the pen's colours are sampled from that.

    surface : (S, 3) vertices of the solid in the file: what they were before they were inset is not recorded

    Raises DamagedFile for invalid data.
    """
    found = gltf.scene_outlines()
    if not found or not len(found[0][2]):
        return None
    form, vertices, faces = found[0]
    index = next(index for index, each in gltf.outlines.items() if each == form)
    primitive = gltf.primitives(index)[0]
    uv = gltf.vectors(primitive["attributes"]["TEXCOORD_0"], 2) if _shows_figure_texture(gltf, primitive) else None
    if uv is not None and (len(uv) != len(vertices) or not np.isfinite(uv).all()):
        raise DamagedFile("texture coordinates of an outline that are not those of its vertices")
    colors = _colors(gltf, primitive, len(vertices))
    width = gltf.item("meshes", index)["extras"][OUTLINE].get("width_m")
    if not isinstance(width, float | int) or not 0 <= width < np.inf or not np.isfinite(vertices).all():
        raise DamagedFile("an outline without a width, or with vertices that are not finite")
    return OutlineMesh(vertices, faces.astype(np.int32), colors, form == HULL, surface, float(width), uv)


def _colors(gltf: Gltf, primitive: dict[str, Any], count: int) -> ByteArray:
    """(N, 3) sRGB colours of the vertices of an outline: of its texture, its vertices or its material."""
    attributes = primitive["attributes"]
    surface = _surface(gltf, primitive)
    if "COLOR_0" in attributes:
        colors = _bytes(np.atleast_2d(gltf.numbers(attributes["COLOR_0"]))[:, :3])
    elif isinstance(surface.get("baseColorTexture"), dict) and "TEXCOORD_0" in attributes:
        colors = sample(_texture(gltf, surface["baseColorTexture"]), gltf.vectors(attributes["TEXCOORD_0"], 2))
    else:
        colors = np.tile(_bytes(np.array(surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))[:3])), (count, 1))
    if colors.shape != (count, 3):
        raise DamagedFile("colours of an outline that are not those of its vertices")
    return colors


def _shows_figure_texture(gltf: Gltf, primitive: dict[str, Any]) -> bool:
    reference = _surface(gltf, primitive).get("baseColorTexture")
    first = isinstance(reference, dict) and reference.get("index") == 0 and "TEXCOORD_0" in primitive["attributes"]
    return first and gltf.item("textures", 0).get("name") != OUTLINE  # else the colours of the pens


def _surface(gltf: Gltf, primitive: dict[str, Any]) -> dict[str, Any]:
    material = gltf.item("materials", primitive["material"]) if "material" in primitive else {}
    surface: dict[str, Any] = material.get("pbrMetallicRoughness", {})
    return surface


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
