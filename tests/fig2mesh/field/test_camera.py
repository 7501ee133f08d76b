from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field import analytic
from fig2mesh.field.body import Body
from fig2mesh.field.camera import VIEW_YAW_DEG, Camera, axes, framing, images, orthographic, perspective
from fig2mesh.field.trace import trace

from .fields import pair

SIZE = (9, 7)


@pytest.mark.parametrize(
    ("yaw", "pitch", "right", "up", "back"),
    [
        (VIEW_YAW_DEG["front"], 0, (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        (VIEW_YAW_DEG["left"], 0, (0, 0, -1), (0, 1, 0), (1, 0, 0)),
        (VIEW_YAW_DEG["back"], 0, (-1, 0, 0), (0, 1, 0), (0, 0, -1)),
        (VIEW_YAW_DEG["right"], 0, (0, 0, 1), (0, 1, 0), (-1, 0, 0)),
        (0, 90, (1, 0, 0), (0, 0, -1), (0, 1, 0)),
    ],
)
def test_views_look_along_the_axes(yaw, pitch, right, up, back):
    assert np.array_equal(axes(yaw, pitch), [right, up, back])
    assert np.array_equal(orthographic(yaw, pitch, size=SIZE, height=1).directions[0], -np.array(back, np.float32))


def test_axes_are_right_handed():
    for yaw, pitch in ((13, 40), (-200, -70), (355, 5)):
        frame = axes(yaw, pitch)
        assert np.allclose(frame @ frame.T, np.eye(3))
        assert np.linalg.det(frame) == pytest.approx(1)


def test_pixel_centres_and_row_order():
    rays = orthographic(0, size=(4, 2), height=1.0, centre=(0.1, 0.2, 0.3), distance=2)
    origins = rays.origins.reshape(2, 4, 3)
    assert np.allclose(origins[0, :, 0], 0.1 + np.array([-0.75, -0.25, 0.25, 0.75]))
    assert np.allclose(origins[:, 0, 1], 0.2 + np.array([0.25, -0.25]))  # row 0 on top
    assert np.allclose(origins[..., 2], 2.3)


def test_perspective_rays_meet_the_picture_plane_where_orthographic_ones_do():
    args = {"size": SIZE, "height": 1.4, "centre": (0.1, 0.2, 0.3), "distance": 3.0}
    parallel, central = orthographic(33, 21, **args), perspective(33, 21, **args)
    assert np.allclose(np.linalg.norm(central.directions, axis=1), 1, atol=1e-6)
    back = axes(33, 21)[2]
    t = 3.0 / -(central.directions @ back)
    expected = parallel.origins + 3.0 * parallel.directions
    assert np.allclose(central.origins + t[:, None] * central.directions, expected, atol=1e-5)


def test_perspective_tends_to_orthographic():
    body, args = pair(), {"size": (64, 64), "height": 1.4}
    parallel = trace(body, orthographic(20, 10, **args))
    share = []
    for distance in (2.0, 8.0, 200.0):
        central = trace(body, perspective(20, 10, distance=distance, **args))
        share.append((central.hit == parallel.hit).mean())
    assert share[0] < share[1] < share[2]
    assert share[2] > 0.99


def test_a_sphere_is_as_wide_as_perspective_says():
    body = Body((analytic.sample(analytic.sphere((0, 0, 0), 0.5), 1, (0, 0, 0), 1.2, 96),))
    hits = trace(body, perspective(0, size=(201, 201), height=2.0, distance=1.5))
    depth = images(hits, (201, 201)).depth
    # half angle of the cone of tangents: sin = r / distance; in the plane through the centre distance * tan
    expected = 1.5 * np.tan(np.arcsin(0.5 / 1.5)) * 2 / 2.0 * 201
    assert abs(np.isfinite(depth[100]).sum() - expected) <= 2
    assert depth[100, 100] == pytest.approx(1.0, abs=5e-4)


def test_front_view_shows_the_figures_left_on_the_right():
    body = Body(analytic.mannequin(24))
    size = (80, 160)
    centre, height = framing(body.bounds(), size)
    seen = images(trace(body, orthographic(0, size=size, height=height, centre=centre)), size).part_index
    names = list(analytic.MANNEQUIN)
    columns = np.arange(80)[None, :] + np.zeros((160, 1))
    rows = np.arange(160)[:, None] + np.zeros((1, 80))
    assert columns[seen == names.index("l_hand")].mean() > 45
    assert columns[seen == names.index("r_hand")].mean() < 35
    assert rows[seen == names.index("head")].mean() < rows[seen == names.index("l_foot")].mean()


@pytest.mark.parametrize(("yaw", "pitch"), [(0, 0), (37, 25), (90, -80)])
def test_framing_shows_everything(yaw, pitch):
    body = Body(analytic.mannequin(24))
    size = (60, 40)
    centre, height = framing(body.bounds(), size, yaw, pitch)
    hit = np.isfinite(
        images(trace(body, orthographic(yaw, pitch, size=size, height=height, centre=centre)), size).depth
    )
    assert hit.any()
    assert not hit[[0, -1]].any()
    assert not hit[:, [0, -1]].any()


def test_wrong_sizes_are_named():
    with pytest.raises(ValueError, match="camera"):
        orthographic(0, size=(0, 4), height=1)
    hits = trace(pair(), orthographic(0, size=(4, 4), height=1))
    with pytest.raises(ValueError, match="16 rays"):
        images(hits, (4, 5))


@pytest.mark.parametrize("nearby", [False, True])
def test_lines_are_rays_in_double_precision(nearby):
    camera = Camera(33, 21, (7, 5), 1.2, (0.1, 0.2, 0.3), 3.0, nearby)
    rays = camera.rays()
    for origins, directions in (camera.lines(np.arange(35)), camera.lines(np.arange(35) - 14, 2)):
        assert np.allclose(origins, rays.origins, atol=1e-6)
        assert np.allclose(directions, rays.directions, atol=1e-6)
    some = camera.rays((2, 4))
    assert np.array_equal(some.origins, rays.origins[14:28])
    assert np.array_equal(some.directions, rays.directions[14:28])
