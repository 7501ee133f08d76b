"""Files opened in Blender: requested size, upright, front view in front, colours of the drawing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from exporters.asset import Asset
from exporters.profiles import profile_named
from exporters.write import write
from georef.placement import GeoPlacement
from tests.blender import looked_at
from tests.exporters.analytic import HEIGHT, RADIUS, asset, capsule
from tests.exporters.outlined import hulled, ribboned

COLOUR_TOLERANCE = 12
"""Of 255: 16 samples per pixel under a uniform sky leave some noise on lit surfaces."""
SIZE = (120, 240)


def lopsided(placement: GeoPlacement) -> Asset:
    """The capsule, moved so that left and right, front and back differ: 0.1 m to its left, 0.05 m to its front."""
    mesh = capsule(32, 8)
    return asset(placement, lods=(replace(mesh, vertices=mesh.vertices + np.float32([0.1, 0, 0.05])),))


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".usda", ".usdc", ".usdz"])
def test_size_orientation_material_and_picture(tmp_path: Path, suffix: str) -> None:
    # Towards the reader of a north-up map. Only USD turns the figure itself: there north is -z of the stage.
    path = tmp_path / f"figure{suffix}"
    write(lopsided(GeoPlacement(8.5417, 47.3769, 455.34, heading_deg=180.0)), path)
    found = looked_at(path, tmp_path / "front.png", SIZE)
    # Blender: z up, front -y, the figure's left at +x.
    np.testing.assert_allclose(found["low"], [0.1 - RADIUS, -0.05 - RADIUS, 0], atol=2e-6)
    np.testing.assert_allclose(found["high"], [0.1 + RADIUS, -0.05 + RADIUS, HEIGHT], atol=2e-6)
    (mesh,) = found["meshes"]
    assert mesh["faces"] == len(capsule(32, 8).faces)
    assert mesh["uv"] == ["UVMap" if suffix in (".glb", ".gltf") else "st"]
    assert mesh["materials"] == ["drawing" if suffix in (".glb", ".gltf") else "Drawing"]
    assert mesh["textures"] == [[64, 64]]
    assert mesh["faces_of_materials"] == [mesh["faces"]]
    if suffix in (".glb", ".gltf"):
        # The part of a vertex is kept as a number; names and shares are in a table that Blender does not read.
        assert "_FEATURE_ID_0" in mesh["attributes"]

    with Image.open(tmp_path / "front.png") as image:
        picture = np.asarray(image.convert("RGBA")).astype(int)
    shown = picture[..., 3] > 128
    assert shown.mean() == pytest.approx((2 * RADIUS * HEIGHT - (4 - np.pi) * RADIUS**2) / (HEIGHT**2 / 2), abs=0.01)
    # The texture's green is how far below the top, its red goes round from the back: half of it in front.
    for row in (60, 120, 180):
        patch = picture[row - 3 : row + 4, 57:64, :3].reshape(-1, 3)
        expected = [255 / 2, 255 * row / SIZE[1], 128]
        np.testing.assert_allclose(np.median(patch, axis=0), expected, atol=COLOUR_TOLERANCE)
    assert np.median(picture[110:130, 75:85, 0]) > 128 + COLOUR_TOLERANCE, "the figure's left is at the right"
    assert np.median(picture[110:130, 35:45, 0]) < 128 - COLOUR_TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("profile", [None, "blender"])
@pytest.mark.parametrize("form", ["hull", "ribbon"])
def test_an_outline_is_an_object_of_its_own(tmp_path: Path, form: str, profile: str | None) -> None:
    mesh = hulled(capsule(32, 8)) if form == "hull" else ribboned(capsule(32, 8))
    assert mesh.outline is not None
    path = tmp_path / "figure.glb"
    write(asset(lods=(mesh,)), path, profile=profile_named(profile))
    figure, outline = sorted(looked_at(path)["meshes"], key=lambda each: str(each["name"]))
    assert (figure["name"], figure["faces"], figure["materials"]) == ("farmer", len(mesh.faces), ["drawing"])
    assert (outline["name"], outline["parent"], outline["materials"]) == ("outline", "farmer", ["outline"])
    # EEVEE culls the hull. Blender removes the faces on the back of the ribbon, whose others must not be culled then.
    faces = len(mesh.outline.faces)
    assert (outline["faces"], outline["culled"]) == ((faces, [True]) if form == "hull" else (faces // 2, [False]))
    assert outline["properties"]["outline"]["form"] == form


@pytest.mark.slow
def test_usd_turns_to_its_bearing(tmp_path: Path) -> None:
    """A stage is x east, z south for Cesium: in Blender y is north, and a figure that faces east moves to +x."""
    path = tmp_path / "figure.usdc"
    write(lopsided(GeoPlacement(8.5417, 47.3769, heading_deg=90.0)), path)
    found = looked_at(path)
    np.testing.assert_allclose(found["low"], [0.05 - RADIUS, 0.1 - RADIUS, 0], atol=2e-6)
    np.testing.assert_allclose(found["high"], [0.05 + RADIUS, 0.1 + RADIUS, HEIGHT], atol=2e-6)
