"""Close holes by PyMeshLab, the one place that uses it. PyMeshLab is GPL-3; `fill.py` does the same without it."""

from __future__ import annotations

import numpy as np

from fig2mesh.errors import SYSTEM_LIBRARIES, InputError
from fig2mesh.mesh.topology import as_mesh
from fig2mesh.records import Mesh

MAX_HOLE_EDGES = 2000
"""Edges of the largest hole that is closed."""


REMEDY = f"run `{SYSTEM_LIBRARIES}` (Debian), or use --closing fill"


def close_pymeshlab(mesh: Mesh) -> Mesh:
    """Close the holes of a manifold mesh.

    Holes come closed, but new faces may disagree with old ones on the outside or meet them in an edge with a third
    face: the caller checks. PyMeshLab's own test against self-intersection is off, as it leaves one hole in three open.
    """
    try:
        import pymeshlab
    except ImportError as error:
        if "failed to map segment" in str(error):
            raise MemoryError(str(error)) from error  # the libraries are there
        raise InputError("--closing pymeshlab", f"cannot be imported ({error})", REMEDY) from error
    scene = pymeshlab.MeshSet(verbose=False)
    # Without libopengl0 the import passes, the plugins are not loaded, and filters are missing without an error.
    if not hasattr(scene, "meshing_close_holes"):
        raise InputError("--closing pymeshlab", "its plugins could not be loaded", REMEDY)
    scene.add_mesh(pymeshlab.Mesh(mesh.vertices.astype(np.float64), mesh.faces))
    scene.meshing_close_holes(maxholesize=MAX_HOLE_EDGES, newfaceselected=False, selfintersection=False)
    closed = scene.current_mesh()
    return as_mesh(closed.vertex_matrix(), closed.face_matrix())
