"""Bounds and counts as a glTF file states them, without reading or decompressing its buffers."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.gltf.reader import Gltf
from georef.untrusted.damage import DamagedFile

INTEGER_SCALES = {5120: 127.0, 5121: 255.0, 5122: 32767.0, 5123: 65535.0}

CORNER_ENDS = np.array(list(itertools.product((0, 1), repeat=3)))
"""(8, 3): for each corner of a box, which of its two ends along each axis."""


def stated_corners(gltf: Gltf) -> NDArray[np.float64]:
    """(N, 3) corners, in the frame of the scene, of the boxes of all its meshes, outlines included.

    From the accessors' min and max, which glTF requires. Raises DamagedFile where there are none.
    """
    corners = []
    for mesh, matrix in gltf.instances():
        for primitive in gltf.primitives(mesh):
            if "POSITION" not in primitive["attributes"]:
                raise DamagedFile(f"meshes/{mesh} has no positions")
            accessor = gltf.item("accessors", primitive["attributes"]["POSITION"])
            if len(accessor.get("min", ())) != 3 or len(accessor.get("max", ())) != 3:
                raise DamagedFile(f"the positions of meshes/{mesh} have no min and max")
            ends = np.array([accessor["min"], accessor["max"]], dtype=np.float64)
            if accessor.get("normalized"):
                if accessor["componentType"] not in INTEGER_SCALES:
                    raise DamagedFile(f"normalised positions of componentType {accessor['componentType']}")
                ends = np.maximum(ends / INTEGER_SCALES[accessor["componentType"]], -1.0)
            corners.append(ends[CORNER_ENDS, [0, 1, 2]] @ matrix[:3, :3].T + matrix[:3, 3])
    if not corners:
        raise DamagedFile("no mesh in the scene")
    points = np.concatenate(corners)
    if not np.isfinite(points).all():
        raise DamagedFile("vertices are not finite")
    return points


def stated_counts(gltf: Gltf) -> dict[str, Any]:
    """Number of vertices and triangles of the meshes that are no outlines."""
    outlines = gltf.outlines
    meshes = [mesh for mesh in range(len(gltf.items("meshes"))) if mesh not in outlines]
    items = [primitive for mesh in meshes for primitive in gltf.primitives(mesh)]
    positions = [each["attributes"]["POSITION"] for each in items if "POSITION" in each["attributes"]]
    indices = [each["indices"] for each in items if "indices" in each]
    return {
        "vertices": sum(gltf.item("accessors", each)["count"] for each in positions),
        "triangles": sum(gltf.item("accessors", each)["count"] for each in indices) // 3,
    }
