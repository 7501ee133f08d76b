"""Points to triangles by ball pivoting (paper §4.5; Bernardini et al. 1999), still with holes.

A ball rolls over the cloud and every three points that stop it become a triangle; `close` does the rest. Three radii
are enough: small balls keep fingers apart, large ones bridge the widest gaps that Poisson-disk thinning leaves. Where
limbs are thin and `scan` put the points closer the same balls serve; smaller ones before them left twice the holes.
"""

from __future__ import annotations

import numpy as np

from fig2mesh.mesh.topology import as_mesh
from fig2mesh.records import Mesh, PointCloud

RADII = (1.2, 2.0, 4.0)
"""Radii of the balls, in units of the cloud's spacing."""


def ball_pivot(cloud: PointCloud, spacing: float) -> Mesh:
    """Open mesh through the points, FIGURE.

    spacing : least distance between the points, as given to `scan`
    """
    if len(cloud.points) < 3:
        return as_mesh(cloud.points, np.zeros((0, 3)))
    import open3d

    points = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(cloud.points.astype(np.float64)))
    points.normals = open3d.utility.Vector3dVector(cloud.normals.astype(np.float64))
    radii = open3d.utility.DoubleVector([factor * spacing for factor in RADII])
    mesh = open3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(points, radii)
    return as_mesh(np.asarray(mesh.vertices), np.asarray(mesh.triangles))
