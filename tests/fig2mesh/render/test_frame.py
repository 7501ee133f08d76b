from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.field.camera import framing
from fig2mesh.field.compiled import THREADS_VARIABLE
from fig2mesh.field.reference import trace_reference
from fig2mesh.field.trace import trace
from fig2mesh.image_frame import ImageFrame
from fig2mesh.records import Hits
from fig2mesh.render.frame import Frame, FrameCamera, render_frame
from fig2mesh.render.surface_colours import SurfaceColours, surface_colours
from fig2mesh.skeleton import PART
from fig2mesh.texture.sources import Sources
from tests.fig2mesh.field.fields import harsh, pair

ALL = frozenset({"colour", "depth", "parts", "normals"})
FRAME = ImageFrame((100.0, 100.0), 0.01)
"""The drawing of these tests: 200 x 200 pixels, FIGURE's origin in the middle, 2 units high."""

PLAIN = {PART["torso"]: (10.0, 200.0, 30.0), PART["l_upper_arm"]: (20.0, 40.0, 220.0)}


def drawing() -> Sources:
    """Red grows to the right and green downwards; plain pictures of one colour each."""
    y, x = np.mgrid[0:200, 0:200].astype(np.float32) + 0.5
    seen = np.stack([x, y, np.full_like(x, 255.0)], axis=-1)
    plain = {part: np.full((100, 100, 3), colour, np.float32) for part, colour in PLAIN.items()}
    return Sources(seen, plain, 0.5)


def arm_before_torso() -> Body:
    torso = analytic.sample(analytic.sphere((0, 0, 0), 0.5), PART["torso"], (0, 0, 0), 1.2, 48)
    arm = analytic.capsule((-0.3, 0.2, 0.75), (0.3, 0.2, 0.75), 0.08)
    return Body((torso, analytic.sample(arm, PART["l_upper_arm"], (0, 0.2, 0.75), 0.9, 48)))


def looking(body: Body, yaw: float, size: tuple[int, int] = (61, 83), **more: object) -> FrameCamera:
    centre, height = framing(body.bounds(), size, yaw)
    return FrameCamera(yaw, size=size, height=height, centre=centre, **more)  # type: ignore[arg-type]


CAMERAS = [
    {"yaw": 0.0},
    {"yaw": 37.0, "pitch_deg": 20.0},
    {"yaw": 90.0, "size": (8, 8)},
    {"yaw": 200.0, "perspective": True, "distance": 3.0},
    {"yaw": 310.0, "perspective": True, "distance": 1.2, "pitch_deg": -30.0},
]
BODIES = {"pair": pair(), "harsh": harsh(), "mannequin": Body(analytic.mannequin(32))}


def agree(frame: Frame, hits: Hits, least: float = 0.999) -> None:
    """Frames reckon in float64 from the camera, rays are float32: a millionth of the distance apart."""
    assert frame.depth is not None
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
    frame = render_frame(body, view, want=ALL - {"colour"}, tolerance=1e-6)
    agree(frame, trace(body, view.rays(), tolerance=1e-6))


@pytest.mark.parametrize("camera", CAMERAS[1:4:2], ids=str)
@pytest.mark.parametrize("name", ["pair", "mannequin"])
def test_a_frame_agrees_with_the_numpy_twin(name, camera):
    body, more = BODIES[name], dict(camera)
    view = looking(body, more.pop("yaw"), **more)
    frame = render_frame(body, view, want=ALL - {"colour"}, tolerance=1e-6)
    agree(frame, trace_reference(body, view.rays(), tolerance=1e-6), 0.998)


@pytest.mark.parametrize("perspective", [False, True])
@pytest.mark.parametrize("distance", [0.05, 0.3, 0.6])
def test_rays_that_start_inside_of_parts_and_between_them(perspective, distance):
    body = pair()
    view = FrameCamera(20, 10, size=(40, 40), height=1.0, distance=distance, perspective=perspective)
    agree(render_frame(body, view, want=ALL - {"colour"}, tolerance=1e-6), trace(body, view.rays(), tolerance=1e-6))


@pytest.mark.parametrize("camera", CAMERAS, ids=str)
def test_a_part_cut_by_its_cube_ends_there(camera):
    """Faces of the cube, behind which all cells are inside, are met too."""
    part, more = analytic.sample(analytic.sphere((0, 0, 0), 0.5), 1, (0, 0, 0), 0.5, 24), dict(camera)
    view = looking(Body((part,)), more.pop("yaw"), **more)
    agree(
        render_frame(Body((part,)), view, want=ALL - {"colour"}, tolerance=1e-6),
        trace(Body((part,)), view.rays(), tolerance=1e-6),
    )


def test_only_what_is_wanted_is_computed():
    body, view = pair(), looking(pair(), 30.0)
    colours = surface_colours(body, drawing(), FRAME)
    for want in ({"depth"}, {"parts"}, {"depth", "parts"}):
        frame = render_frame(body, view, colours=colours, want=want)
        assert frame.counts.normals == frame.counts.samples == 0
        assert frame.counts.rays > 0
        assert {name for name in ALL if getattr(frame, name) is not None} == want
    frame = render_frame(body, view, colours=colours, want={"normals"})
    assert frame.normals is not None
    assert frame.counts.samples == 0
    assert frame.counts.normals == np.count_nonzero(np.linalg.norm(frame.normals, axis=-1) > 0.5)
    frame = render_frame(body, view, colours=colours, want=ALL)
    assert frame.parts is not None
    seen = np.count_nonzero(frame.parts >= 0)
    assert frame.counts.normals == seen
    assert seen <= frame.counts.samples <= 3 * seen


def test_pixels_far_from_the_body_cost_nothing():
    body = Body(analytic.mannequin(32))
    view = FrameCamera(0, size=(128, 128), height=20.0)
    frame = render_frame(body, view, want={"depth"})
    assert frame.counts.rays <= 4 * 64
    assert frame.depth is not None
    assert np.isfinite(frame.depth).any()


def test_wrong_distances_cost_nothing():
    """Only signs tell where rays may go: as many cells whether distances are right or a thousand times too large."""
    body = pair()
    stretched = Body(tuple(type(p)(p.part, p.grid * np.float32(1000), p.centre, p.edge) for p in body.parts))
    counts = [render_frame(b, looking(body, 30.0), want={"depth"}).counts for b in (body, stretched)]
    assert counts[0] == counts[1]
    assert counts[0].cells < 12 * counts[0].rays


def test_threads_do_not_change_a_frame(monkeypatch):
    body, frames = pair(), []
    colours = surface_colours(body, drawing(), FRAME)
    for threads in ("1", "2", "5"):
        monkeypatch.setenv(THREADS_VARIABLE, threads)
        frames.append(render_frame(body, looking(body, 77.0), colours=colours, want=ALL))
    for other in frames[1:]:
        assert other.counts == frames[0].counts
        for name in ALL:
            assert np.array_equal(getattr(other, name), getattr(frames[0], name))


def test_without_a_surface_a_frame_is_empty():
    body = Body(())
    frame = render_frame(body, FrameCamera(0, size=(20, 10)), want=ALL - {"colour"})
    assert frame.depth is not None
    assert frame.depth.shape == (10, 20)
    assert np.isinf(frame.depth).all()
    assert frame.counts.rays == 0


def pixel(frame: Frame, view: FrameCamera, point: tuple[float, float]) -> np.ndarray:
    """Colour where a front view shows FIGURE x, y."""
    assert frame.colour is not None
    unit = view.size[1] / view.height
    column = (point[0] - view.centre[0]) * unit + view.size[0] / 2
    row = (view.centre[1] - point[1]) * unit + view.size[1] / 2
    return frame.colour[int(row), int(column)].astype(float)


@pytest.fixture(scope="module")
def coloured() -> tuple[Body, SurfaceColours]:
    body = arm_before_torso()
    return body, surface_colours(body, drawing(), FRAME)


def test_the_front_is_the_drawing(coloured):
    body, colours = coloured
    view = looking(body, 0.0, (200, 200))
    frame = render_frame(body, view, colours=colours, want={"colour"})
    for x, y in ((0.0, 0.0), (-0.2, -0.3), (0.1, 0.21), (0.3, 0.1)):
        assert np.allclose(pixel(frame, view, (x, y)), (100 + 100 * x, 100 - 100 * y, 255, 255), atol=1.5)
    assert frame.colour is not None
    assert not frame.colour[0, 0].any()  # transparent beside the body


def test_the_back_is_plain_and_hidden_places_are_not_smeared(coloured):
    body, colours = coloured
    frame = render_frame(body, looking(body, 180.0), colours=colours, want={"colour", "parts"})
    assert frame.colour is not None
    assert frame.parts is not None
    assert (frame.colour[frame.parts == 0][:, :3] == PLAIN[PART["torso"]]).all()
    # from below the torso's top behind the arm can be seen, where the drawing has the arm
    view = FrameCamera(0, -50, size=(200, 200), height=1.6, centre=(0, 0, 0.3))
    frame = render_frame(body, view, colours=colours, want=ALL)
    assert frame.colour is not None
    assert frame.depth is not None
    rays = view.rays()
    points = (
        rays.origins + np.where(np.isfinite(frame.depth), frame.depth, 0).reshape(-1, 1) * rays.directions
    ).reshape(200, 200, 3)
    behind = (frame.parts == 0) & (np.abs(points[..., 0]) < 0.25) & (np.abs(points[..., 1] - 0.2) < 0.06)
    behind &= points[..., 2] > 0
    assert behind.sum() > 20
    assert (frame.colour[behind][:, :3] == PLAIN[PART["torso"]]).all()
    beside = (frame.parts == 0) & (points[..., 1] < 0.0) & (points[..., 1] > -0.2) & (points[..., 2] > 0.3)
    assert (frame.colour[beside][:, 2] == 255).all()


def test_drawing_and_plain_colour_blend_without_a_step(coloured):
    body, colours = coloured
    frame = render_frame(body, looking(body, 90.0, (400, 400)), colours=colours, want={"colour", "parts"})
    assert frame.colour is not None
    assert frame.parts is not None
    row = frame.colour[260][frame.parts[260] == 0][:, 2].astype(int)  # blue: 255 drawn, 30 plain
    assert {row.max(), row.min()} == {255, 30}
    assert np.abs(np.diff(row)).max() < 40


def test_small_frames_use_small_pictures(coloured):
    _, colours = coloured
    assert colours.at(0.001).seen.shape[0] == 200
    assert colours.at(0.02).seen.shape[0] == 100
    assert colours.at(0.04).plain.shape[1] == 50
    for pitch in (0.001, 0.02, 0.04):  # the same place in each
        level = colours.at(pitch)
        row, column = level.maps[0, 2] * -0.33 + level.maps[0, 3], level.maps[0, 0] * 0.41 + level.maps[0, 1]
        assert int(level.seen[round(row), round(column), 0]) == pytest.approx(141, abs=2)
        assert int(level.seen[round(row), round(column), 1]) == pytest.approx(133, abs=2)


def test_mistakes_are_named():
    body = pair()
    with pytest.raises(ValueError, match="want"):
        render_frame(body, FrameCamera(0), want={"colours"})
    with pytest.raises(ValueError, match="want"):
        render_frame(body, FrameCamera(0), want=frozenset())
    with pytest.raises(ValueError, match="colours"):
        render_frame(body, FrameCamera(0))
    with pytest.raises(ValueError, match="tolerance"):
        render_frame(body, FrameCamera(0), want={"depth"}, tolerance=0)
    with pytest.raises(ValueError, match="camera"):
        FrameCamera(0, height=0)
    with pytest.raises(ValueError, match="camera"):
        FrameCamera(0, distance=-1, perspective=True)
