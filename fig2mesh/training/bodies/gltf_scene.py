"""Just enough of glTF 2.0 binary to read rigs and clips: node tree, accessors, sampled animations.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html ; morph targets, sparse accessors and external buffers are
not read.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.errors import FigureError

_COMPONENT = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


@dataclass(frozen=True)
class GltfScene:
    """One GLB file.

    document : the parsed JSON chunk
    binary : the binary chunk
    """

    document: dict[str, Any]
    binary: bytes

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Name of each node; "" for one without."""
        return tuple(node.get("name", "") for node in self.document["nodes"])

    @cached_property
    def parents(self) -> tuple[int, ...]:
        """Parent of each node, -1 for a root."""
        result = [-1] * len(self.document["nodes"])
        for index, node in enumerate(self.document["nodes"]):
            for child in node.get("children", []):
                result[child] = index
        return tuple(result)

    @cached_property
    def order(self) -> tuple[int, ...]:
        """All nodes, parents before their children."""
        children: dict[int, list[int]] = {}
        for index, parent in enumerate(self.parents):
            children.setdefault(parent, []).append(index)
        result = list(children.get(-1, []))
        for index in result:  # grows while it is walked
            result.extend(children.get(index, []))
        return tuple(result)

    @cached_property
    def clips(self) -> dict[str, dict[str, Any]]:
        """Animation of each name, what stands before a "|" (the armature) left out."""
        return {a.get("name", "").split("|")[-1]: a for a in self.document.get("animations", [])}

    def accessor(self, index: int) -> NDArray[np.float64]:
        """(count, width) values of an accessor; normalised integers become -1 to 1."""
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        width, dtype = _WIDTH[accessor["type"]], np.dtype(_COMPONENT[accessor["componentType"]]).newbyteorder("<")
        step = view.get("byteStride") or width * dtype.itemsize
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        shape, strides = (accessor["count"], width), (step, dtype.itemsize)
        values = np.ndarray(shape, dtype, self.binary, start, strides).astype(np.float64)
        if accessor.get("normalized"):
            values = np.maximum(values / (2 ** (8 * dtype.itemsize - (dtype.kind == "i")) - 1), -1)
        return values

    def duration_s(self, clip: str) -> float:
        """Time of the last key of a clip."""
        return max(float(times[-1]) for _, _, times, _ in self._tracks(clip))

    def global_matrices(self, clip: str | None = None, fraction: float = 0.0) -> NDArray[np.float64]:
        """(N, 4, 4) node matrices in the scene's frame, at rest or at a fraction (0 to 1) of a clip."""
        nodes = self.document["nodes"]
        local = [{path: np.asarray(node.get(path, rest), float) for path, rest in _REST.items()} for node in nodes]
        fixed = {index: node["matrix"] for index, node in enumerate(nodes) if "matrix" in node}
        if clip is not None:
            now = fraction * self.duration_s(clip)
            for node, path, times, values in self._tracks(clip):
                local[node][path] = _sample(path, times, values, now)
        result = np.empty((len(nodes), 4, 4))
        for index in self.order:
            if index in fixed:
                matrix = np.asarray(fixed[index], float).reshape(4, 4).T
            else:
                matrix = np.eye(4)
                matrix[:3, :3] = quaternion_matrix(local[index]["rotation"]) * local[index]["scale"]
                matrix[:3, 3] = local[index]["translation"]
            parent = self.parents[index]
            result[index] = matrix if parent < 0 else result[parent] @ matrix
        return result

    @cached_property
    def _read_tracks(self) -> dict[str, list[tuple[int, str, NDArray[np.float64], NDArray[np.float64]]]]:
        return {}

    def _tracks(self, clip: str) -> list[tuple[int, str, NDArray[np.float64], NDArray[np.float64]]]:
        """Node, path, (K,) times and (K, width) values of each animated property of a clip."""
        if clip not in self._read_tracks:
            tracks = []
            for channel in self.clips[clip]["channels"]:
                target, sampler = channel["target"], self.clips[clip]["samplers"][channel["sampler"]]
                if "node" not in target or target["path"] not in _REST:
                    continue
                times, values = self.accessor(sampler["input"])[:, 0], self.accessor(sampler["output"])
                if sampler.get("interpolation") == "CUBICSPLINE":  # between tangents; linear steps are near enough
                    values = values.reshape(len(times), 3, -1)[:, 1]
                tracks.append((target["node"], target["path"], times, values))
            self._read_tracks[clip] = tracks
        return self._read_tracks[clip]


def read_gltf(path: Path) -> GltfScene:
    """Read one GLB file; raises `FigureError` where it is not one."""
    data = path.read_bytes()
    if len(data) < 20 or data[:4] != b"glTF" or data[16:20] != b"JSON":
        raise FigureError(path.name, "it is no glTF 2.0 binary file", "export the scene as .glb")
    length = struct.unpack("<I", data[12:16])[0]
    return GltfScene(json.loads(data[20 : 20 + length]), data[28 + length :])


def quaternion_matrix(quaternion: NDArray[np.floating]) -> NDArray[np.float64]:
    """(3, 3) rotation of a quaternion x, y, z, w of any length but zero."""
    x, y, z, w = np.asarray(quaternion, np.float64) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _sample(path: str, times: NDArray[np.float64], values: NDArray[np.float64], now: float) -> NDArray[np.float64]:
    """(width,) value at the time `now`, linear between keys."""
    after = int(np.clip(np.searchsorted(times, now), 0, len(times) - 1))
    before = max(after - 1, 0)
    span = times[after] - times[before]
    weight = float(np.clip((now - times[before]) / span, 0, 1)) if span > 0 else 1.0
    first, second = values[before], values[after]
    if path == "rotation" and first @ second < 0:  # q and -q are the same turn: take the short way
        first = -first
    return np.asarray(first + weight * (second - first))
