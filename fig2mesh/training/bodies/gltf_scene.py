"""Rigs and clips in glTF files: the tree of nodes by name, and animations sampled at one time.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#animations ; morph targets are not read.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.gltf.reader import Gltf, local_matrix, read_gltf

_REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


@dataclass(frozen=True)
class GltfScene:
    """A glTF file whose nodes move."""

    gltf: Gltf

    @property
    def document(self) -> dict[str, Any]:
        """The JSON document."""
        return self.gltf.document

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
        """Animation of each name, without the armature before a "|"."""
        return {a.get("name", "").split("|")[-1]: a for a in self.document.get("animations", [])}

    def accessor(self, index: int) -> NDArray[np.float64]:
        """(count, width) values of an accessor; normalised integers become -1 to 1."""
        values = self.gltf.numbers(index).astype(np.float64)
        return values.reshape(len(values), -1)

    def duration_s(self, clip: str) -> float:
        """Time of the last key of a clip."""
        return max(float(times[-1]) for _, _, times, _ in self._tracks(clip))

    def global_matrices(self, clip: str | None = None, fraction: float = 0.0) -> NDArray[np.float64]:
        """(N, 4, 4) node matrices in the scene's frame, at rest or at a fraction (0 to 1) of a clip."""
        nodes = self.document["nodes"]
        local = [{path: np.asarray(node.get(path, rest), float) for path, rest in _REST.items()} for node in nodes]
        if clip is not None:
            now = fraction * self.duration_s(clip)
            for node, path, times, values in self._tracks(clip):
                local[node][path] = _sample(path, times, values, now)
        result = np.empty((len(nodes), 4, 4))
        for index in self.order:
            turned = local[index] | {"rotation": _unit(local[index]["rotation"])}
            matrix = local_matrix(nodes[index] if "matrix" in nodes[index] else turned)
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
                if (
                    sampler.get("interpolation") == "CUBICSPLINE"
                ):  # values between tangents; linear interpolation is near enough
                    values = values.reshape(len(times), 3, -1)[:, 1]
                tracks.append((target["node"], target["path"], times, values))
            self._read_tracks[clip] = tracks
        return self._read_tracks[clip]


def read_scene(path: Path) -> GltfScene:
    """Read one glTF file; raises ExportError for any other file."""
    return GltfScene(read_gltf(path))


def _unit(quaternion: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.asarray(quaternion, np.float64) / np.linalg.norm(quaternion)


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
