"""Ray casting against a finished mesh, with interpolated vertex attributes and texture at the hits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from exporters.sampling import sample

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MeshHits:
    """Hits of N rays on a mesh, at M points.

    depth : (N,) along the rays; infinite where nothing is hit
    corners, weights : (M, 3) vertices of the triangles hit and barycentric coordinates
    """

    depth: NDArray[np.float32]
    corners: NDArray[np.int32]
    weights: NDArray[np.float32]

    @cached_property
    def hit(self) -> NDArray[np.bool_]:
        """(N,) bool, True where the mesh is hit."""
        return np.isfinite(self.depth)


@dataclass(frozen=True)
class MeshCaster:
    """Ray caster of a mesh, normalised to a box of unit size about the origin: rays are cast in single precision, which
    then serves figures of a millimetre and of a kilometre alike.

    mesh : ASSET
    """

    mesh: TexturedMesh

    @cached_property
    def box(self) -> Floats:
        """(2, 3) lowest and highest corner, ASSET."""
        vertices = self.mesh.vertices.astype(np.float64)
        return np.stack([vertices.min(axis=0), vertices.max(axis=0)])

    @property
    def centre(self) -> Floats:
        """(3,) ASSET, origin of the rays' coordinates."""
        return np.asarray(self.box.sum(axis=0) / 2)

    @cached_property
    def unit(self) -> float:
        """Length of a unit of rays' coordinates, metres."""
        return max(float((self.box[1] - self.box[0]).max()), 1e-30)

    @cached_property
    def _scene(self) -> Any:
        import open3d as o3d

        scene = o3d.t.geometry.RaycastingScene()
        corners = np.ascontiguousarray((self.mesh.vertices - self.centre) / self.unit, np.float32)
        faces = o3d.core.Tensor.from_numpy(self.mesh.faces.astype(np.uint32))
        scene.add_triangles(o3d.core.Tensor.from_numpy(corners), faces)
        return scene

    def cast(self, origins: NDArray[Any], directions: NDArray[Any]) -> MeshHits:
        """First intersection of each of N rays, (N, 3) both, with the mesh."""
        answer = self._scene.cast_rays(_packed(origins, directions))
        depth = answer["t_hit"].numpy()
        hit = np.isfinite(depth)
        second, third = answer["primitive_uvs"].numpy()[hit].T
        weights = np.stack([1 - second - third, second, third], axis=1)
        return MeshHits(depth, self.mesh.faces[answer["primitive_ids"].numpy()[hit]], weights)

    def blocked(self, origins: NDArray[Any], directions: NDArray[Any], reach: float = np.inf) -> NDArray[np.bool_]:
        """(N,) bool, True where rays hit the mesh within `reach`."""
        answer = self._scene.test_occlusions(_packed(origins, directions), tnear=0.0, tfar=float(reach))
        return np.asarray(answer.numpy())

    def normals(self, hits: MeshHits) -> Floats:
        """(M, 3) unit normals at the hits, interpolated between those of the vertices."""
        normals = interpolated(self.mesh.shading_normals, hits).astype(np.float64)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return normals

    def colours(self, hits: MeshHits) -> NDArray[np.floating] | None:
        """(M, 3) sRGB 0-255 of the texture, else of the vertices; None where the mesh has neither."""
        mesh = self.mesh
        if mesh.texture is not None and mesh.uv is not None:
            texels = sample(mesh.texture, interpolated(mesh.uv, hits))
            return np.repeat(texels, 3, axis=1).astype(np.float32) if texels.shape[1] == 1 else texels[:, :3] * 1.0
        return None if mesh.colors is None else interpolated(mesh.colors, hits)


def interpolated(values: NDArray[Any], hits: MeshHits) -> NDArray[Any]:
    """(M, K) barycentric interpolation of vertex attributes (V, K) at the hits."""
    # Corner by corner: a single gather of all three would need three times the memory.
    return np.asarray(sum(hits.weights[:, k, None] * values[hits.corners[:, k]] for k in range(3)))


def _packed(origins: NDArray[Any], directions: NDArray[Any]) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.concatenate([origins, directions], axis=1).astype(np.float32, copy=False))
