"""HTML page of a scene on a globe: rendered by the same shader, to a billboard in CesiumJS (paper §4.5)."""

from __future__ import annotations

import html
import json
from collections.abc import Collection

from fig2mesh.view.page import figure_json
from fig2mesh.view.scene import ViewScene
from fig2mesh.view.template import asset, filled
from georef.placement import GeoPlacement


def globe_page(scene: ViewScene, placement: GeoPlacement, cesium: str, effects: Collection[str] | None = None) -> str:
    """HTML page of a figure on a globe.

    cesium : URL of the built CesiumJS, with a slash at its end; absolute or relative to the page
    effects : enabled effects; None: `fig2mesh.view.page.default_effects`
    """
    place = {
        "lon_deg": placement.lon_deg,
        "lat_deg": placement.lat_deg,
        "height_m": placement.height_m,
        "heading_deg": placement.heading_deg,
        "cesium": cesium,
    }
    return filled(
        "globe.html",
        {
            "title": html.escape(scene.name),
            "cesium": html.escape(cesium),
            "place": json.dumps(place).replace("</", "<\\/"),
            "shader": asset("shader.glsl"),
            "figure": figure_json(scene, effects),
            "offline": asset("offline_viewer.js"),
            "view": asset("view.js"),
            "globe": asset("globe.js"),
        },
    )
