"""Scenes against rays that are cast one by one."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field.body import Body
from fig2mesh.field.trace import trace
from fig2mesh.parts.smooth_union import smooth_union
from fig2mesh.render.needs import Needs
from fig2mesh.render.picture import PictureRequest, view_of
from fig2mesh.render.scene import FieldScene
from tests.drawn import Sketch, assemble

EVERYTHING = Needs(normals=True, labels=True, shadow=True)
SIZE = (240, 320)


@pytest.fixture(scope="module", params=["hard", "smooth"])
def scene(request: pytest.FixtureRequest) -> FieldScene:
    joints = {"r_elbow": (95.0, 130.0), "r_wrist": (125.0, 140.0), "r_hand": (133.0, 141.0)}
    drawn = assemble(Sketch(**joints).legs().arms(width=26).trunk().head().figure())
    return FieldScene(drawn.body if request.param == "hard" else smooth_union(drawn.body, drawn.outline.canvas))


@pytest.mark.parametrize("nearby", [False, True])
@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (50.0, 25.0), (180.0, -10.0)])
def test_fields_are_met_where_single_rays_meet_them(scene: FieldScene, nearby: bool, yaw: float, pitch: float) -> None:
    """Rays of frames are reckoned in double precision, those of `trace` are single: they differ by a millionth of the
    distance, and hits by the march's tolerance. A ray that grazes the rim may meet the figure or not."""
    effects = frozenset(["perspective"]) if nearby else frozenset()
    camera = view_of(scene, PictureRequest("depth", effects, SIZE, yaw, pitch)).camera
    rows = (60, 300)
    surface, counts = scene.meet(camera, rows, EVERYTHING)
    hits = trace(scene.body, camera.rays(rows))
    hit = np.isfinite(surface.depth)
    assert hit.sum() > 5000
    assert counts.camera_rays == len(hits.depth)
    assert counts.normals == hit.sum()
    assert (hit != hits.hit).mean() < 2e-4
    both = hit & hits.hit
    met = both[hit]
    off = np.abs(surface.depth[both] - hits.depth[both])
    assert (off < 3e-4).mean() > 0.999
    assert np.median(off) < 1e-6
    # Places lie where the depth is, and nearby depths have nearby normals.
    assert np.linalg.norm(surface.points[met] - hits.points[both], axis=1)[off < 3e-4].max() < 4e-4
    assert ((surface.normals[met] * hits.normals[both]).sum(axis=1) > 0.999).mean() > 0.995
    # Labels differ nowhere but where two parts share the surface, so that the march's tolerance decides between them.
    labels = scene.body.labels[hits.part_index[both]]
    wrong = np.flatnonzero(surface.labels[met] != labels)
    assert len(wrong) < 0.012 * len(labels)
    for found in (surface.labels[met], labels):
        for label in np.unique(found[wrong]):
            own = Body(tuple(part for part in scene.body.parts if part.part == label))
            shared = hits.points[both][wrong[found[wrong] == label]]
            assert np.abs(own.distance(shared)).max() < 3e-4
