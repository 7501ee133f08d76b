"""Triangles of one part: nothing else about the mesh changes."""

from __future__ import annotations

import numpy as np

from exporters.gltf.part_borders import split_at_parts
from exporters.sampling import face_parts
from exporters.solid import measure_topology, solid_of
from tests.exporters.analytic import capsule


def test_triangles_carry_one_label_and_stay_where_they_are() -> None:
    mesh = capsule()
    split = split_at_parts(mesh)
    corners = split.parts[split.faces]
    np.testing.assert_array_equal(corners, np.repeat(face_parts(mesh)[:, None], 3, axis=1))
    for name in ("vertices", "normals", "uv", "solid_index"):
        before, after = getattr(mesh, name), getattr(split, name)
        np.testing.assert_array_equal(after[split.faces], before[mesh.faces], err_msg=name)
    # Two borders of 32 columns, each vertex of them once more; one column is doubled at the seam.
    assert len(split.vertices) <= len(mesh.vertices) + 4 * 33
    assert len(split.vertices) > len(mesh.vertices)


def test_the_solid_is_the_same_one() -> None:
    mesh, split = capsule(), split_at_parts(capsule())
    np.testing.assert_array_equal(split.solid_faces, mesh.solid_faces)
    solid = solid_of(split)
    assert measure_topology(split.vertices[solid.first], solid.faces).solid


def test_meshes_without_borders_are_left_alone() -> None:
    for mesh in (capsule(parts=None), capsule(parts=np.full(len(capsule().vertices), 3))):
        assert split_at_parts(mesh) is mesh
    split = split_at_parts(capsule())
    assert split_at_parts(split) is split
