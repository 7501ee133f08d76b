"""Marching cubes of the body's field (paper §4.5): the alternative mesher, and the reference for ball pivoting.

Lewiner's cases with a table of ambiguities give a closed manifold on nearly every grid. Where they do not, the same
grid is cut by tetrahedra, whose cases have no ambiguity at all (`tetrahedra.py`).

Vertices are not always projected: on a field with creases, full Newton steps pulled neighbouring vertices across each
other and folded 0.1 % of the triangles; a vertex therefore moves at most a third of a cell and only where no
triangle turns over.
"""

from __future__ import annotations

import numpy as np

from fig2mesh.mesh.band import misses_limbs
from fig2mesh.mesh.grid import Grid, sample_grid
from fig2mesh.mesh.newton import newton
from fig2mesh.mesh.protocol import Field
from fig2mesh.mesh.tetrahedra import tetrahedra
from fig2mesh.mesh.topology import as_mesh, check_solid, face_vectors
from fig2mesh.records import FloatArray, Mesh

HALVINGS = 2

MAX_FINE_NODES = 60_000_000
"""Nodes of the largest grid in the search for thin limbs: 0.5 GB."""


def isosurface(field: Field, *, spacing: float, project: bool = True) -> Mesh:
    """Closed, oriented, manifold mesh of the outer surface of `field`, FIGURE; cavities inside are filled.

    Parameters
    ----------
    spacing : of the grid, FIGURE units; halved once or twice where a limb would pass between the nodes
    project : move vertices from the grid's interpolant onto the field itself
    """
    grid = sample_grid(field, spacing)
    for _ in range(HALVINGS):
        if grid.values.size * 8 > MAX_FINE_NODES or not misses_limbs(field, grid):
            break
        spacing /= 2
        grid = sample_grid(field, spacing)
    mesh = extract(grid)
    if not project or len(mesh.faces) == 0:
        return mesh
    moved, _ = newton(field, mesh.vertices, tolerance=1e-3 * spacing, reach=spacing / 3)
    return move_vertices(mesh, moved)


def extract(grid: Grid) -> Mesh:
    """Zero level set of a grid, without cavities, as a closed, oriented manifold."""
    values = np.where((grid.values > 0) & ~grid.outside, -np.float32(grid.spacing), grid.values)
    if not (values < 0).any():
        return as_mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    from skimage.measure import marching_cubes

    inside = np.argwhere(values < 0)
    low = inside.min(axis=0) - 1
    high = inside.max(axis=0) + 2
    window = np.ascontiguousarray(values[tuple(slice(a, b) for a, b in zip(low, high, strict=True))])
    vertices, faces, _, _ = marching_cubes(window, 0.0)
    mesh = as_mesh((vertices + low) * grid.spacing + grid.origin, faces)
    if check_solid(mesh).solid:
        return mesh
    vertices, faces = tetrahedra(window)
    return as_mesh((vertices + low) * grid.spacing + grid.origin, faces)


def move_vertices(mesh: Mesh, target: FloatArray) -> Mesh:
    """Move the vertices of a mesh to `target` (V, 3), except where that would turn a triangle over."""
    before = face_vectors(mesh)
    vertices = np.array(target, np.float32)
    for _ in range(8):
        moved = Mesh(vertices, mesh.faces)
        after = face_vectors(moved)
        # Turned over, or shrunk along its old normal to less than a tenth of its area.
        turned = np.einsum("fd,fd->f", before, after) <= 0.1 * np.einsum("fd,fd->f", before, before)
        if not turned.any():
            return moved
        back = np.unique(mesh.faces[turned])
        vertices = vertices.copy()
        vertices[back] = mesh.vertices[back]
    return mesh
