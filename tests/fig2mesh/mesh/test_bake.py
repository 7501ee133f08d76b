"""Baking: drawn pixels where the drawing shows the surface, no smearing through what is in front, no gaps."""

from __future__ import annotations

import numpy as np
import pytest

from fig2mesh.field.analytic import sample, sphere
from fig2mesh.field.body import Body
from fig2mesh.image_frame import ImageFrame
from fig2mesh.mesh.bake import Baked, bake, rasterise
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.mesh.normals import vertex_normals
from fig2mesh.mesh.unwrap import unwrap
from fig2mesh.records import UvMesh
from fig2mesh.texture.sources import Sources

SIZE = 256
FRAME = ImageFrame((100.0, 100.0), 0.01)
"""A picture of 200 x 200 pixels, 0.01 units each, the FIGURE origin in its middle."""

CHEST, HAND = 1, 7
RED, BLUE, GREY, GREEN = (200, 0, 0), (0, 0, 200), (120, 120, 120), (0, 200, 0)


@pytest.fixture(scope="module")
def scene() -> tuple[UvMesh, Body, Baked]:
    """A large ball (part 1), a small one floating in front of it (part 7); drawn blue with a red disc.

    What the drawing does not show is grey on the large ball and green on the small one.
    """
    parts = (
        sample(sphere((0, 0, 0), 0.6), CHEST, (0, 0, 0), 1.4, 48),
        sample(sphere((0, 0, 0.9), 0.2), HAND, (0, 0, 0.9), 0.6, 48),
    )
    body = Body(parts)
    mesh = unwrap(isosurface(body, spacing=0.04), texture_size=SIZE)
    rows, columns = np.mgrid[0:200, 0:200] + 0.5
    disc = np.hypot(columns - 100, rows - 100) < 20
    seen = np.where(disc[..., None], np.float32(RED), np.float32(BLUE)).astype(np.float32)
    plain = {
        part: np.broadcast_to(np.float32(colour), (200, 200, 3)).copy()
        for part, colour in ((CHEST, GREY), (HAND, GREEN))
    }
    labels = np.array([part.part for part in parts], np.uint8)
    centres = mesh.solid.vertices[mesh.solid.faces].mean(axis=1)
    faces = labels[body.nearest_part(centres)]
    normals = vertex_normals(mesh.solid, body)
    return mesh, body, bake(mesh, normals, faces, Sources(seen, plain, 1.0), FRAME, SIZE)


def surface_colours(scene: tuple[UvMesh, Body, Baked]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, colour and observed flag of every texel inside a chart."""
    mesh, _, baked = scene
    owner, weights = rasterise(mesh.uv, mesh.faces, SIZE)
    covered = owner >= 0
    corners = mesh.solid.vertices[mesh.solid.faces[owner[covered]]]
    points = np.einsum("nk,nkd->nd", weights[covered], corners)
    return points, baked.color[covered].astype(int), baked.observed[covered] > 0


def test_seen_surface_has_the_drawn_pixel(scene: tuple[UvMesh, Body, Baked]) -> None:
    points, colours, observed = surface_colours(scene)
    distance = np.hypot(points[:, 0], points[:, 1])
    inside = observed & (distance < 0.18)
    outside = observed & (distance > 0.22)
    assert inside.sum() > 100
    assert (colours[inside] == RED).all()
    assert (colours[outside] == BLUE).all()


def test_nothing_smears_onto_what_is_behind(scene: tuple[UvMesh, Body, Baked]) -> None:
    points, colours, observed = surface_colours(scene)
    hidden = (np.hypot(points[:, 0], points[:, 1]) < 0.17) & (points[:, 2] > 0.4) & (points[:, 2] < 0.65)
    assert hidden.sum() > 50
    assert not observed[hidden].any()
    assert (colours[hidden] == GREY).all()


def test_backs_have_the_plain_colour_of_their_part(scene: tuple[UvMesh, Body, Baked]) -> None:
    points, colours, observed = surface_colours(scene)
    for colour, centre, radius in ((GREY, 0.0, 0.6), (GREEN, 0.9, 0.2)):
        back = (points[:, 2] < centre - 0.2 * radius) & (
            np.linalg.norm(points - [0, 0, centre], axis=1) < 1.05 * radius
        )
        assert not observed[back].any()
        assert (colours[back] == colour).all()


def test_share_of_observed_surface(scene: tuple[UvMesh, Body, Baked]) -> None:
    """The fronts of both balls, less what the small one hides; texel density is even
    over the atlas."""
    _, _, observed = surface_colours(scene)
    # A disc of 0.2 hides 1 - sqrt(1 - 1/9) of the large ball's front half.
    large, small = 0.6**2, 0.2**2
    expected = (large * 0.5 * np.sqrt(1 - 1 / 9) + small * 0.5) / (large + small)
    assert observed.mean() == pytest.approx(expected, abs=0.03)


def test_padding_repeats_the_nearest_texel(scene: tuple[UvMesh, Body, Baked]) -> None:
    _, _, baked = scene
    used = {tuple(colour) for colour in baked.color[baked.covered]}
    assert {tuple(colour) for colour in baked.color.reshape(-1, 3)} <= used


def test_every_triangle_is_rasterised_once() -> None:
    """A square cut along its diagonal: every texel belongs to one of the two, the weights give the texel back."""
    uv = np.float32([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]])
    faces = np.int32([[0, 1, 2], [0, 2, 3]])
    owner, weights = rasterise(uv, faces, 100)
    assert (owner[10:90, 10:90] >= 0).all()
    assert (owner >= 0).sum() == 80 * 80
    rows, columns = np.nonzero(owner >= 0)
    back = np.einsum("nk,nkd->nd", weights[rows, columns], uv[faces[owner[rows, columns]]]) * 100
    assert np.allclose(back, np.stack([columns, rows], axis=1) + 0.5, atol=1e-3)
