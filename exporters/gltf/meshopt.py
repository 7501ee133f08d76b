"""Geometry in few bytes: quantised numbers, in an order that the codec of meshoptimizer packs well.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_meshopt_compression
https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_mesh_quantization
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from exporters.asset import FloatArray, TexturedMesh
from exporters.errors import ExportError
from georef.untrusted.damage import decoding

FULL = 65535
"""Steps of a position along the longest side of the mesh, and of a texture coordinate."""


def codec() -> Any:
    """The optional package meshopt. Raises ExportError where it is not installed."""
    try:
        import meshopt
    except ImportError as error:
        remedy = 'pip install "fig2mesh[compression]"'
        raise ExportError("--profile", "compression needs the package meshopt", remedy) from error
    return meshopt


def encode(rows: NDArray[Any], mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]) -> bytes:
    """Rows (N, W) as the bytes of a compressed bufferView; indices are (N, 1) unsigned integers."""
    packed: bytes = codec().encode_gltf_buffer(rows if mode == "ATTRIBUTES" else rows.reshape(-1), mode)
    return packed


def decode(data: bytes, extension: dict[str, Any]) -> bytes:
    """The bytes of a compressed bufferView; extension : its EXT_meshopt_compression.

    Raises ExportError without the codec, DamagedFile for data that is none of its.
    """
    size = int(extension["byteStride"])
    meshopt, count = codec(), int(extension["count"])
    with decoding("no data of meshopt", Exception):  # its wrapper checks some of it by assertions
        found = meshopt.decode_gltf_buffer(data, count, size, extension["mode"], extension.get("filter"))
    return bytes(np.ascontiguousarray(found).tobytes())


def reordered(mesh: TexturedMesh) -> TexturedMesh:
    """The same triangles of the same vertices in the order in which they pack best.

    Corners may have moved on within their triangles, as the codec of triangles moves them; vertices that no triangle
    uses are gone.
    """
    meshopt = codec()
    corners, place, count = meshopt.reorder_mesh(mesh.faces.reshape(-1).astype(np.uint32), True, True)
    order = np.argsort(place)[:count]
    # What a reader will get, so that whatever names a corner names the right one.
    corners = meshopt.decode_index_buffer(meshopt.encode_index_buffer(corners), len(corners), 4)

    def picked(array: Any) -> Any:
        return None if array is None else array[order]

    return replace(
        mesh,
        vertices=mesh.vertices[order],
        faces=corners.reshape(-1, 3).astype(np.int32),
        normals=picked(mesh.normals),
        solid_index=mesh.solid_index[order],
        uv=picked(mesh.uv),
        colors=picked(mesh.colors),
        parts=picked(mesh.parts),
    )


@dataclass(frozen=True)
class Quantised:
    """Positions as normalised integers.

    steps : (V, 3) uint16; position = origin + scale * steps / 65535
    origin : (3,), scale : the longest side, metres, ASSET. Off by at most scale / 131070 along each axis
    """

    steps: NDArray[np.uint16]
    origin: tuple[float, ...]
    scale: float


def quantised(vertices: FloatArray) -> Quantised:
    """Vertices (V, 3) in 65535 steps of the longest side, the same along all axes so that normals stay normals."""
    wide = vertices.astype(np.float64)
    low = wide.min(axis=0)
    scale = float((wide.max(axis=0) - low).max()) or 1.0
    return Quantised(np.rint((wide - low) / scale * FULL).astype(np.uint16), tuple(low.tolist()), scale)


def quantised_uv(uv: FloatArray) -> NDArray[np.uint16]:
    """Texture coordinates (V, 2) in [0, 1] in 65535 steps."""
    return np.rint(uv.astype(np.float64) * FULL).astype(np.uint16)


NORMAL_BITS = 10
"""Of each of the two numbers that a normal is stored as: 0.1 degrees, and of length 1 to 1e-4 when decoded."""


def octahedral(normals: FloatArray) -> NDArray[np.uint8]:
    """Unit vectors (V, 3) as rows (V, 8) of the filter OCTAHEDRAL."""
    rows = np.zeros((len(normals), 4), np.float32)
    rows[:, :3] = normals
    return np.asarray(codec().encode_filter_oct(rows, 8, NORMAL_BITS), dtype=np.uint8)
