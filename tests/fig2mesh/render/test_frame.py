from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.field.camera import Camera, framing
from fig2mesh.field.compiled import THREADS_VARIABLE
from fig2mesh.field.reference import trace_reference
from fig2mesh.field.trace import trace
from fig2mesh.records import Hits
from fig2mesh.render.frame import RenderedFrame, render_frame
from tests.fig2mesh.field.fields import harsh, pair


def looking(body: Body, yaw: float, size: tuple[int, int] = (61, 83), **more: object) -> Camera:
    centre, height = framing(body.bounds(), size, yaw)
    return Camera(yaw, size=size, height=height, centre=centre, **more)  # type: ignore[arg-type]


CAMERAS = [
    {"yaw": 0.0},
    {"yaw": 37.0, "pitch_deg": 20.0},
    {"yaw": 90.0, "size": (8, 8)},
    {"yaw": 200.0, "perspective": True, "distance": 3.0},
    {"yaw": 310.0, "perspective": True, "distance": 1.2, "pitch_deg": -30.0},
]
BODIES = {"pair": pair(), "harsh": harsh(), "mannequin": Body(analytic.mannequin(32))}


def agree(frame: RenderedFrame, hits: Hits, least: float = 0.999) -> None:
    """Frames compute in float64 from the camera, rays are float32: they differ by a millionth of the distance."""
    assert frame.parts is not None
    assert frame.normals is not None
    depth, parts, normals = frame.depth.ravel(), frame.parts.ravel(), frame.normals.reshape(-1, 3)
    hit = parts >= 0
    assert np.array_equal(np.isfinite(depth), hit)
    assert (hit == hits.hit).mean() >= least
    both = hit & hits.hit
    # at a grazing hit the depth changes much with the place
    cosine = np.abs((hits.normals * normals).sum(axis=1))
    near = np.abs(np.subtract(depth, hits.depth, out=np.zeros(len(depth)), where=both)) < 5e-5
    assert near[both].mean() >= 0.995
    assert (parts == hits.part_index)[both].mean() >= 0.995
    assert (cosine[both & near] > 0.999).mean() >= 0.99


@pytest.mark.parametrize("camera", CAMERAS, ids=str)
@pytest.mark.parametrize("name", BODIES)
def test_a_frame_is_what_single_rays_see(name, camera):
    body, more = BODIES[name], dict(camera)
    view = looking(body, more.pop("yaw"), **more)
    frame = render_frame(body, view, with_parts=True, with_normals=True, tolerance=1e-6)
    agree(frame, trace(body, view.rays(), tolerance=1e-6))


@pytest.mark.parametrize("camera", CAMERAS[1:4:2], ids=str)
@pytest.mark.parametrize("name", ["pair", "mannequin"])
def test_a_frame_agrees_with_the_numpy_twin(name, camera):
    body, more = BODIES[name], dict(camera)
    view = looking(body, more.pop("yaw"), **more)
    frame = render_frame(body, view, with_parts=True, with_normals=True, tolerance=1e-6)
    agree(frame, trace_reference(body, view.rays(), tolerance=1e-6), 0.998)


@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize("distance", [0.05, 0.3, 0.6])
def test_rays_that_start_inside_of_parts_and_between_them(perspective, distance):
    body = pair()
    view = Camera(20, 10, size=(40, 40), height=1.0, distance=distance, perspective=perspective)
    agree(
        render_frame(body, view, with_parts=True, with_normals=True, tolerance=1e-6),
        trace(body, view.rays(), tolerance=1e-6),
    )


@pytest.mark.parametrize("camera", CAMERAS, ids=str)
def test_a_part_cut_by_its_cube_ends_there(camera):
    """Faces of the cube, behind which all cells are inside, are met too."""
    part, more = analytic.sample(analytic.sphere((0, 0, 0), 0.5), 1, (0, 0, 0), 0.5, 24), dict(camera)
    view = looking(Body((part,)), more.pop("yaw"), **more)
    agree(
        render_frame(Body((part,)), view, with_parts=True, with_normals=True, tolerance=1e-6),
        trace(Body((part,)), view.rays(), tolerance=1e-6),
    )


def test_only_what_is_wanted_is_computed():
    body, view = pair(), looking(pair(), 30.0)
    for with_parts in (False, True):
        frame = render_frame(body, view, with_parts=with_parts)
        assert frame.normals_computed == 0
        assert frame.rays > 0
        assert frame.normals is None
        assert (frame.parts is not None) == with_parts
    frame = render_frame(body, view, with_normals=True)
    assert frame.normals is not None
    assert frame.parts is None
    assert frame.normals_computed == np.count_nonzero(np.linalg.norm(frame.normals, axis=-1) > 0.5)
    frame = render_frame(body, view, with_parts=True, with_normals=True)
    assert frame.parts is not None
    assert frame.normals_computed == np.count_nonzero(frame.parts >= 0)


@pytest.mark.parametrize("camera", CAMERAS, ids=str)
def test_rows_of_a_picture_are_those_of_the_whole(camera):
    body, more = BODIES["mannequin"], dict(camera)
    view = looking(body, more.pop("yaw"), **more)
    whole = render_frame(body, view, with_parts=True, with_normals=True)
    edges = sorted({0, 1, 7, view.size[1] // 2 + 1, view.size[1]})
    bands = [render_frame(body, view, rows, with_parts=True, with_normals=True) for rows in pairwise(edges)]
    for name in ("depth", "parts", "normals"):
        joined = np.concatenate([getattr(band, name) for band in bands])
        assert np.array_equal(joined, getattr(whole, name))


def test_pixels_far_from_the_body_cost_nothing():
    body = Body(analytic.mannequin(32))
    view = Camera(0, size=(128, 128), height=20.0)
    frame = render_frame(body, view)
    assert frame.rays <= 4 * 64
    assert np.isfinite(frame.depth).any()


def test_wrong_distances_cost_nothing():
    """Only signs decide where rays may go: as many cells whether distances are right or a thousand times too large."""
    body = pair()
    stretched = Body(tuple(type(p)(p.part, p.grid * np.float32(1000), p.centre, p.edge) for p in body.parts))
    frames = [render_frame(b, looking(body, 30.0)) for b in (body, stretched)]
    assert (frames[0].rays, frames[0].cells) == (frames[1].rays, frames[1].cells)
    assert frames[0].cells < 12 * frames[0].rays


def test_threads_do_not_change_a_frame(monkeypatch):
    body, frames = pair(), []
    for threads in ("1", "2", "5"):
        monkeypatch.setenv(THREADS_VARIABLE, threads)
        frames.append(render_frame(body, looking(body, 77.0), with_parts=True, with_normals=True))
    for other in frames[1:]:
        for name in ("rays", "cells", "normals_computed", "depth", "parts", "normals"):
            assert np.array_equal(getattr(other, name), getattr(frames[0], name))


def test_without_a_surface_a_frame_is_empty():
    frame = render_frame(Body(()), Camera(0, size=(20, 10)), with_parts=True, with_normals=True)
    assert frame.depth.shape == (10, 20)
    assert np.isinf(frame.depth).all()
    assert frame.rays == 0


def test_mistakes_are_named():
    with pytest.raises(ValueError, match="tolerance"):
        render_frame(pair(), Camera(0), tolerance=0)
    with pytest.raises(ValueError, match="rows"):
        render_frame(pair(), Camera(0, size=(20, 10)), (5, 11))
    with pytest.raises(ValueError, match="camera"):
        Camera(0, height=0)
    with pytest.raises(ValueError, match="camera"):
        Camera(0, distance=-1, perspective=True)
