"""Measures of a finished model as a solid: thin walls, slivers, nested shells, self-intersections.

Measures take closed surfaces in ASSET, metres, of a figure 1.79 m high. For defects visible from the front see
`fig2mesh.measure.front`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from exporters.solid import solid_of
from fig2mesh.measure.front import Surface
from fig2mesh.mesh.raycast import scene_of
from fig2mesh.mesh.simplify import spread
from fig2mesh.mesh.slivers import triangle_quality
from fig2mesh.mesh.topology import check_solid, component_volumes, face_components, select_faces
from fig2mesh.records import Mesh

SLIVER = 0.05
"""Quality threshold of slivers: the height of a cap is below 2, of a needle below 3 % of its length."""
START = 1e-5
"""Metres below the surface at which a ray across the wall starts, so that it does not hit its own triangle."""


@dataclass(frozen=True)
class Wall:
    """Thickness of a solid across its walls, mm.

    min_mm : of all samples; quantile_mm : 0.1 % of the samples are thinner
    """

    min_mm: float
    quantile_mm: float


@dataclass(frozen=True)
class TriangleQuality:
    """Quality of triangles: minimum, 1 % quantile, and share of slivers, below 0.05."""

    minimum: float
    quantile: float
    slivers: float


@dataclass(frozen=True)
class Laws:
    """Validity and topology of a solid.

    closed : every edge has a triangle on both sides; manifold : no edge has a third one, every vertex a single fan,
        and neighbours agree on the outside
    components : pieces connected over edges; genus : handles of all of them together,
        meaningful where closed and manifold
    inner_shells : components with negative volume, or with most vertices inside another one. They are cavities or
        bodies within bodies: no view shows them, but they affect slicers and volumes.
    crossing : triangles that pass through another one; a printed or cut model has no inside there
    turned : share of vertices whose shading normal opposes that of one of its triangles, visible as dark spots
    """

    closed: bool
    manifold: bool
    components: int
    genus: int
    inner_shells: int
    crossing: int
    turned: float


def solid_mesh(mesh: TexturedMesh) -> Mesh:
    """The unsplit surface of a model, ASSET instead of FIGURE."""
    solid = solid_of(mesh)
    return Mesh(mesh.vertices[solid.first], solid.faces)


def thinnest_wall(mesh: Surface) -> Wall:
    """Thickness across the walls, by rays along the inward normal from 60,000 points spread evenly over the surface.

    This is the shape diameter of Shapira et al. (2008) with one ray instead of a cone: a cone averages away the very
    places that break. The minimum thickness decides whether a solid can be printed, but a single acute rim
    reduces it to zero; the 0.1 % quantile shows whether that is one rim or many. Rays that hit a front face have left
    the solid through itself and are not counted.
    """
    import open3d as o3d

    body = Mesh(mesh.vertices, mesh.faces)
    points, faces = spread(body)
    corners = body.vertices.astype(np.float64)[body.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    inward = -normals[faces]
    rays = np.concatenate([points + START * inward, inward], axis=1).astype(np.float32)
    answer = scene_of(body.vertices, body.faces).cast_rays(o3d.core.Tensor.from_numpy(rays))
    met, across = answer["primitive_ids"].numpy(), answer["t_hit"].numpy().astype(np.float64)
    hit = np.isfinite(across)
    hit[hit] = np.einsum("nd,nd->n", normals[met[hit]], inward[hit]) > 0
    if not hit.any():
        return Wall(0.0, 0.0)
    thickness = 1000 * (across[hit] + START)
    return Wall(float(thickness.min()), float(np.quantile(thickness, 0.001)))


def quality(mesh: Surface) -> TriangleQuality:
    """Quality of the triangles: q = 4 sqrt(3) area / (sum of squared edges), 1 for equilateral ones.

    Of the usual measures this one is smooth, bounded and zero for both kinds of sliver, needles and caps. Slivers have
    no reliable normal, break ray casting and physics engines, and vanish in coordinates of few bits.
    """
    values = triangle_quality(mesh.vertices, mesh.faces)
    return TriangleQuality(float(values.min()), float(np.quantile(values, 0.01)), float((values < SLIVER).mean()))


def laws(mesh: TexturedMesh) -> Laws:
    """Check a model as a solid."""
    body = solid_mesh(mesh)
    found = check_solid(body)
    return Laws(
        closed=found.triangles > 0 and not found.boundary_edges,
        manifold=found.manifold and found.oriented,
        components=found.components,
        genus=found.components - found.euler // 2,
        inner_shells=inner_shells(body),
        crossing=crossing_triangles(body),
        turned=turned_normals(mesh),
    )


def inner_shells(mesh: Mesh) -> int:
    """Number of components that are turned inside out or lie inside another one; see `Laws`."""
    import open3d as o3d

    labels = face_components(mesh.faces)
    volumes = component_volumes(mesh, labels)
    pieces = [select_faces(mesh, labels == number) for number in range(len(volumes))]
    count = 0
    for number, piece in enumerate(pieces):
        points = o3d.core.Tensor.from_numpy(np.array(piece.vertices))
        count += bool(volumes[number] < 0) or any(
            float(scene_of(other.vertices, other.faces).compute_occupancy(points).numpy().mean()) > 0.5
            for place, other in enumerate(pieces)
            if place != number and volumes[place] > abs(volumes[number])
        )
    return count


def crossing_triangles(mesh: Mesh) -> int:
    """Number of triangles that intersect another one with which they share no vertex."""
    import open3d as o3d

    body = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(mesh.vertices.astype(np.float64)), o3d.utility.Vector3iVector(np.array(mesh.faces))
    )
    return len(np.unique(np.asarray(body.get_self_intersecting_triangles())))


def turned_normals(mesh: TexturedMesh) -> float:
    """Share of vertices whose shading normal has a negative product with the normal of a triangle they belong to."""
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    against = np.einsum("fd,fkd->fk", flat, mesh.shading_normals[mesh.faces].astype(np.float64)) < 0
    used: NDArray[Any] = np.unique(mesh.faces)
    return len(np.unique(mesh.faces[against])) / max(len(used), 1)
