"""The figure as a billboard in CesiumJS: at its place, from the direction of the camera."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fig2mesh.view.globe import globe_page
from fig2mesh.view.server import page_server
from georef.placement import GeoPlacement
from tests.browser import Look, pixels, serving
from tests.fig2mesh.view.conftest import Painted

BEARING = 120.0
HEIGHT_M = 1.79

BARE = """(() => {
  const { scene } = fig2mesh.viewer;
  for (const name of ['globe', 'skyBox', 'skyAtmosphere', 'sun', 'moon']) scene[name].show = false;
  scene.backgroundColor = Cesium.Color.WHITE;
})()"""
"""So that all that is not white is the figure."""

STAND = """new Promise((done) => {{
  const {{ viewer, shown, feet, centre }} = fig2mesh;
  const {{ camera, scene }} = viewer;
  const [heading, pitch] = [{bearing} + 180, -{pitch}].map(Cesium.Math.toRadians);
  camera.lookAt(centre, new Cesium.HeadingPitchRange(heading, pitch, 6));
  camera.lookAtTransform(Cesium.Matrix4.IDENTITY);
  const wait = () => {{
    scene.render();
    if (shown.pending) {{ setTimeout(wait, 50); return; }}
    scene.render();
    const at = scene.cartesianToCanvasCoordinates(feet);
    const metre = scene.drawingBufferHeight / (2 * Math.tan(camera.frustum.fovy / 2) * 6);
    done({{ x: at.x, y: at.y, metre, yaw: shown.yaw, pitch: shown.pitch, draws: shown.draws }});
  }};
  wait();
}})"""
"""Stand at a bearing from the figure, 6 m away, and wait until the billboard shows that view."""

VIEWS = ((BEARING, 0), (BEARING - 90, 0), (BEARING + 180, 0), (BEARING + 40, 30), (BEARING, 0))
"""Positions of the camera: bearing from the figure, pitch."""


def test_the_billboard_stands_at_its_place(painted: Painted, look: Look, cesium: Path) -> None:
    place = GeoPlacement(8.5417, 47.3769, 412.5, heading_deg=BEARING, figure_height_m=HEIGHT_M)
    page = globe_page(painted.scene, place, "cesium/", ["texture", "smooth-union"])
    steps = [
        ({"evaluate": STAND.format(bearing=bearing, pitch=pitch)}, {"screenshot": True}) for bearing, pitch in VIEWS
    ]
    with serving(page_server(page, folders={"cesium": cesium})) as address:
        actions = [{"evaluate": BARE}, *(action for pair in steps for action in pair)]
        found = look(address, *actions, size=(480, 400))
    assert found["messages"] == []
    assert all(request.startswith(address) for request in found["requests"])
    facts = [result["value"] for result in found["results"][1::2]]
    images = [pixels(result["png"])[..., :3].astype(int) for result in found["results"][2::2]]
    assert [(fact["yaw"], fact["pitch"]) for fact in facts] == [(0, 0), (90, 0), (180, 0), (320, 30), (0, 0)]
    # The first view is kept: it is not drawn again.
    assert facts[-1]["draws"] == facts[-2]["draws"]
    for fact, image in zip(facts, images, strict=True):
        image[:60] = 255  # the button
        image[-60:] = 255  # Cesium's credit
        rows, columns = np.nonzero((image < 240).any(axis=2))
        low = rows.max()
        feet = columns[rows > low - 0.1 * fact["metre"]]
        if fact["pitch"] == 0:
            assert low == pytest.approx(fact["y"], abs=4)
            assert rows.max() - rows.min() == pytest.approx(HEIGHT_M * fact["metre"], abs=6)
        assert (feet.min() + feet.max()) / 2 == pytest.approx(fact["x"], abs=4 if fact["pitch"] == 0 else 12)
    front, _, back, _, again = images
    x, y = round(facts[0]["x"]), round(facts[0]["y"] - 1.2 * facts[0]["metre"])
    # Stripes of the drawing on the chest, the plain blue of unseen sides on the back.
    chest, spine = (image[y - 8 : y + 8, x - 3 : x + 3].reshape(-1, 3) for image in (front, back))
    assert (chest[:, 0] > chest[:, 2]).all()
    np.testing.assert_allclose(spine, np.broadcast_to([40, 90, 190], spine.shape), atol=6)
    assert np.abs(front - again).max() <= 8
