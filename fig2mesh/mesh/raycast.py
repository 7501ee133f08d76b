"""Ray casting against a finished mesh and its outline, with interpolated vertex attributes and texture at the hits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from exporters.asset import OutlineMesh, Texture, TexturedMesh
from exporters.sampling import sample
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.records import Mesh

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MeshHits:
    """Hits of N rays on a mesh, at M points.

    depth : (N,) along the rays; infinite where nothing is hit
    corners, weights : (M, 3) vertices of the triangles hit and barycentric coordinates; the vertices of the outline
        are counted after those of the mesh
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

    mesh : ASSET; its outline is hit as well, and only from the front where it is an inverted hull. Secondary rays
        (`blocked`) pass through it.
    """

    mesh: TexturedMesh

    @cached_property
    def box(self) -> Floats:
        """(2, 3) lowest and highest corner, ASSET, the outline's included."""
        vertices = shown_vertices(self.mesh).astype(np.float64)
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
        return self._scene_of(self.mesh.vertices, self.mesh.faces)

    @cached_property
    def _outline_scene(self) -> Any:
        outline = self.mesh.outline
        return None if outline is None else self._scene_of(outline.vertices, outline.faces)

    def _scene_of(self, vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> Any:
        return scene_of((vertices - self.centre) / self.unit, faces)

    def cast(self, origins: NDArray[Any], directions: NDArray[Any]) -> MeshHits:
        """First intersection of each of N rays, (N, 3) both, with the mesh or its outline."""
        rays, faces = _packed(origins, directions), self.mesh.faces
        first = _nearest_hits(self._scene, rays)
        outline = self.mesh.outline
        if outline is not None:
            scene = self._outline_scene
            ink = _front_hits(scene, rays, directions, outline) if outline.culled else _nearest_hits(scene, rays)
            first = _nearer(first, ink._replace(face=ink.face + len(faces)))
            faces = np.concatenate([faces, outline.faces + len(self.mesh.vertices)])
        hit = np.isfinite(first.depth)
        second, third = first.uv[hit].T
        weights = np.stack([1 - second - third, second, third], axis=1)
        return MeshHits(first.depth, faces[first.face[hit]], weights)

    def blocked(self, origins: NDArray[Any], directions: NDArray[Any], reach: float = np.inf) -> NDArray[np.bool_]:
        """(N,) bool, True where rays hit the mesh within `reach`."""
        answer = self._scene.test_occlusions(_packed(origins, directions), tnear=0.0, tfar=float(reach))
        return np.asarray(answer.numpy())

    def normals(self, hits: MeshHits) -> Floats:
        """(M, 3) unit normals at the hits, interpolated between those of the vertices."""
        normals = interpolated(self._vertex_normals, hits).astype(np.float64)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return normals

    @cached_property
    def _vertex_normals(self) -> NDArray[np.float32]:
        own, outline = self.mesh.shading_normals, self.mesh.outline
        return own if outline is None else np.concatenate([own, vertex_normals(Mesh(outline.vertices, outline.faces))])

    def labels(self, hits: MeshHits) -> NDArray[np.uint8]:
        """(M,) part label of the nearest vertex; 0 on the outline and where the mesh has none."""
        nearest = hits.corners[np.arange(len(hits.corners)), hits.weights.argmax(axis=1)]
        result = np.zeros(len(nearest), np.uint8)
        if self.mesh.parts is not None:
            solid = ~self._inked(hits)
            result[solid] = self.mesh.parts[nearest[solid]]
        return result

    def colours(self, hits: MeshHits) -> NDArray[np.floating] | None:
        """(M, 3) sRGB 0-255 of the texture, else of the vertices, and of the outline; None for a mesh without any."""
        outline, inked = self.mesh.outline, self._inked(hits)[:, None]
        if outline is None:
            return self._solid_colours(hits)
        own = self._solid_colours(replace(hits, corners=np.where(inked, 0, hits.corners)))
        if own is None:
            return None
        on_outline = replace(hits, corners=np.where(inked, hits.corners - len(self.mesh.vertices), 0))
        if outline.uv is not None and self.mesh.texture is not None:
            ink = _texture_colours(self.mesh.texture, interpolated(outline.uv, on_outline))
        else:
            ink = interpolated(outline.colors, on_outline)
        return np.where(inked, ink, own)

    def _inked(self, hits: MeshHits) -> NDArray[np.bool_]:
        """(M,) bool: hits on the outline."""
        return np.asarray(hits.corners[:, 0] >= len(self.mesh.vertices))

    def _solid_colours(self, hits: MeshHits) -> NDArray[np.floating] | None:
        mesh = self.mesh
        if mesh.texture is not None and mesh.uv is not None:
            return _texture_colours(mesh.texture, interpolated(mesh.uv, hits))
        return None if mesh.colors is None else interpolated(mesh.colors, hits)


def _texture_colours(texture: Texture, uv: NDArray[Any]) -> NDArray[np.floating]:
    """(M, 3) sRGB 0-255 of a texture of one, three or four channels at (M, 2) texture coordinates."""
    texels = sample(texture, uv)
    return np.repeat(texels, 3, axis=1).astype(np.float32) if texels.shape[1] == 1 else texels[:, :3] * 1.0


def scene_of(vertices: NDArray[Any], faces: NDArray[Any]) -> Any:
    """Open3D scene of triangles, for ray casting; vertices : (V, 3); faces : (F, 3)."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    corners = o3d.core.Tensor.from_numpy(np.array(vertices, np.float32, order="C"))
    scene.add_triangles(corners, o3d.core.Tensor.from_numpy(faces.astype(np.uint32)))
    return scene


def shown_vertices(mesh: TexturedMesh) -> NDArray[np.float32]:
    """(N, 3) vertices of the mesh and of its outline, ASSET."""
    return mesh.vertices if mesh.outline is None else np.concatenate([mesh.vertices, mesh.outline.vertices])


def interpolated(values: NDArray[Any], hits: MeshHits) -> NDArray[Any]:
    """(M, K) barycentric interpolation of vertex attributes (V, K) at the hits."""
    # Corner by corner: a single gather of all three would need three times the memory.
    return np.asarray(sum(hits.weights[:, k, None] * values[hits.corners[:, k]] for k in range(3)))


def _packed(origins: NDArray[Any], directions: NDArray[Any]) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.concatenate([origins, directions], axis=1).astype(np.float32, copy=False))


class _RayHits(NamedTuple):
    """depth : (N,) infinite where nothing is hit; face : (N,) triangle; uv : (N, 2) weights of its last two corners."""

    depth: NDArray[np.float32]
    face: NDArray[np.int64]
    uv: NDArray[np.float32]


def _nearest_hits(scene: Any, rays: Any) -> _RayHits:
    answer = scene.cast_rays(rays)
    return _RayHits(
        answer["t_hit"].numpy(), answer["primitive_ids"].numpy().astype(np.int64), answer["primitive_uvs"].numpy()
    )


def _front_hits(scene: Any, rays: Any, directions: NDArray[Any], outline: OutlineMesh) -> _RayHits:
    """Nearest hits on triangles whose front side faces the ray."""
    answer = scene.list_intersections(rays)
    ray, face = answer["ray_ids"].numpy().astype(np.int64), answer["primitive_ids"].numpy().astype(np.int64)
    depth, uv = answer["t_hit"].numpy(), answer["primitive_uvs"].numpy()
    a, b, c = (outline.vertices[outline.faces[:, k]].astype(np.float64) for k in range(3))
    front = np.flatnonzero(np.einsum("nd,nd->n", np.cross(b - a, c - a)[face], directions[ray]) < 0)
    front = front[np.lexsort((face[front], depth[front], ray[front]))]
    hit, first = np.unique(ray[front], return_index=True)
    rows = front[first]
    result = _RayHits(
        np.full(len(directions), np.inf, np.float32),
        np.zeros(len(directions), np.int64),
        np.zeros((len(directions), 2), np.float32),
    )
    result.depth[hit], result.face[hit], result.uv[hit] = depth[rows], face[rows], uv[rows]
    return result


def _nearer(first: _RayHits, second: _RayHits) -> _RayHits:
    """The nearer hit of each ray; the first where they are equal."""
    nearer = second.depth < first.depth
    return _RayHits(
        np.where(nearer, second.depth, first.depth),
        np.where(nearer, second.face, first.face),
        np.where(nearer[:, None], second.uv, first.uv),
    )
