"""Compression of geometry: quantised numbers, reordered for the codec of meshoptimizer.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Vendor/EXT_meshopt_compression
https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_mesh_quantization
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from exporters.asset import FloatArray, IntArray, TexturedMesh
from exporters.errors import ExportError
from georef.untrusted.damage import decoding

FULL = 65535
"""Quantisation steps of positions along the longest side of the mesh, and of texture coordinates."""


def codec() -> Any:
    """Import the optional package meshopt. Raises ExportError where it is not installed."""
    try:
        import meshopt
    except ImportError as error:
        remedy = 'pip install "fig2mesh[compression]"'
        raise ExportError("--profile", "compression needs the package meshopt", remedy) from error
    return meshopt


def encode(rows: NDArray[Any], mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]) -> bytes:
    """Compress rows (N, W) to the bytes of a bufferView; indices are (N, 1) unsigned integers."""
    packed: bytes = codec().encode_gltf_buffer(rows if mode == "ATTRIBUTES" else rows.reshape(-1), mode)
    return packed


def decode(data: bytes, extension: dict[str, Any]) -> bytes:
    """Decompress a bufferView; extension : its EXT_meshopt_compression.

    Raises ExportError without the codec, DamagedFile for invalid data.
    """
    size = int(extension["byteStride"])
    meshopt, count = codec(), int(extension["count"])
    with decoding("invalid meshopt data", Exception):  # the wrapper uses assertions for some checks
        found = meshopt.decode_gltf_buffer(data, count, size, extension["mode"], extension.get("filter"))
    return bytes(np.ascontiguousarray(found).tobytes())


def reordered(mesh: TexturedMesh) -> TexturedMesh:
    """Reorder triangles and vertices for the best compression.

    Corners may be rotated within their triangles, as the codec does; unused vertices are removed.
    """
    order, faces = reordered_faces(mesh.faces)

    def picked(array: Any) -> Any:
        return None if array is None else array[order]

    return replace(
        mesh,
        vertices=mesh.vertices[order],
        faces=faces,
        normals=picked(mesh.normals),
        solid_index=mesh.solid_index[order],
        uv=picked(mesh.uv),
        colors=picked(mesh.colors),
        parts=picked(mesh.parts),
    )


def reordered_faces(faces: IntArray) -> tuple[NDArray[np.int64], IntArray]:
    """Reorder triangles (F, 3) as `reordered` does; returns the (V,) old vertex of each new one, and the new faces."""
    meshopt = codec()
    corners, place, count = meshopt.reorder_mesh(faces.reshape(-1).astype(np.uint32), True, True)
    # As a reader will decode them, so that references to corners remain valid.
    corners = meshopt.decode_index_buffer(meshopt.encode_index_buffer(corners), len(corners), 4)
    return np.argsort(place)[:count], corners.reshape(-1, 3).astype(np.int32)


@dataclass(frozen=True)
class Quantised:
    """Positions as normalised integers.

    steps : (V, 3) uint16; position = origin + scale * steps / 65535
    origin : (3,), scale : the longest side, metres, ASSET. The error is at most scale / 131070 along each axis
    """

    steps: NDArray[np.uint16]
    origin: tuple[float, ...]
    scale: float


def quantised(vertices: FloatArray) -> Quantised:
    """Quantise vertices (V, 3) to 65535 steps of the longest side, uniformly so that normals remain valid.

    Several meshes under one transform are quantised together.
    """
    wide = vertices.astype(np.float64)
    low = wide.min(axis=0)
    scale = float((wide.max(axis=0) - low).max()) or 1.0
    return Quantised(np.rint((wide - low) / scale * FULL).astype(np.uint16), tuple(low.tolist()), scale)


def quantised_uv(uv: FloatArray) -> NDArray[np.uint16]:
    """Quantise texture coordinates (V, 2) in [0, 1] to 65535 steps."""
    return np.rint(uv.astype(np.float64) * FULL).astype(np.uint16)


NORMAL_BITS = 10
"""Bits of each of the two components of an encoded normal: 0.1 degrees, and a length of 1 to 1e-4 when decoded."""


def octahedral(normals: FloatArray) -> NDArray[np.uint8]:
    """Encode unit vectors (V, 3) as rows (V, 8) of the filter OCTAHEDRAL."""
    rows = np.zeros((len(normals), 4), np.float32)
    rows[:, :3] = normals
    return np.asarray(codec().encode_filter_oct(rows, 8, NORMAL_BITS), dtype=np.uint8)
