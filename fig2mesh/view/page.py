"""HTML page of a scene: one self-contained text."""

from __future__ import annotations

import base64
import html
import io
import json
import zlib
from collections.abc import Collection
from typing import Any, Final

from PIL import Image

from fig2mesh.view.scene import LINE_COLOUR, LINE_WIDTH, ViewScene
from fig2mesh.view.template import asset, filled

EFFECTS: Final = {
    "texture": "colours of the drawing",
    "blend": "gradual transition between drawing and plain colours, instead of a hard border",
    "creases": "ink lines where limbs touch, if the drawing has contours",
    "light": "a lamp to the upper left of the viewer",
    "ao": "ambient occlusion",
    "outline": "an ink line along silhouettes",
    "smooth-union": "rounded joints between parts of a limb",
    "perspective": "perspective instead of orthographic projection",
    "antialias": "four rays per pixel",
}
"""Effect → what it adds. In upper case the names are #defines in the shader."""


def view_page(scene: ViewScene, effects: Collection[str] | None = None) -> str:
    """Stand-alone HTML page that shows a scene, for any browser with WebGL 2.

    effects : initially enabled; None: `default_effects`
    """
    return filled(
        "page.html",
        {
            "title": html.escape(scene.name),
            "shader": asset("shader.glsl"),
            "figure": figure_json(scene, effects),
            "view": asset("view.js"),
            "page": asset("page.js"),
        },
    )


def default_effects(scene: ViewScene) -> tuple[str, ...]:
    """Initially enabled effects of a page. Drawings that keep their contours need no outline."""
    off = {"perspective", "outline"} if scene.contours else {"perspective"}
    return tuple(effect for effect in EFFECTS if effect not in off)


def figure_json(scene: ViewScene, effects: Collection[str] | None = None) -> str:
    """Scene as JSON, with textures in base64; safe inside of a script element."""
    field, colours, depth = scene.field, scene.colours, scene.depth
    picture, kind = _encoded(scene)
    brick_of = {brick.owners[0]: i for i, brick in enumerate(field.bricks) if brick.owners[0] == brick.owners[1]}
    pen_colour, pen_width = scene.pen or (LINE_COLOUR, 0.0)
    colour = [c / 255 for c in pen_colour]
    facts: dict[str, Any] = {
        "name": scene.name,
        "effects": list(default_effects(scene) if effects is None else effects),
        "bounds": scene.bounds.tolist(),
        "feet": scene.feet.tolist(),
        "metres_per_unit": scene.metres_per_unit,
        "size": field.size,
        "parts": field.parts,
        "bricks": [
            {
                "place": place.tolist(),
                "nodes": brick.values.shape,
                "origin": brick.origin.tolist(),
                "spacing": brick.spacing,
                "slope": brick.slope,
                "box": brick.box.tolist(),
                "slot": slot,
                "owners": [brick_of.get(owner, i) for owner in brick.owners],
            }
            for i, (brick, place, slot) in enumerate(zip(field.bricks, field.places, scene.slots, strict=True))
        ],
        "slots": [{"place": slot.place, "window": slot.window} for slot in colours.slots],
        "grazing": scene.grazing,
        "pen": [*colour, pen_width],
        "line": [*colour, pen_width or LINE_WIDTH],
        "depth": {"size": depth.z.shape[::-1], "place": depth.place, "z": _base64(_planes(depth.z.tobytes()))},
        "field": _base64(_planes(field.values().tobytes())),
        "paint": _base64(picture),
        "paint_type": kind,
    }
    # "</" would end the script element.
    return json.dumps(facts, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")


def _encoded(scene: ViewScene) -> tuple[bytes, str]:
    """Colour atlas as a lossless image file, and its media type."""
    stream = io.BytesIO()
    Image.fromarray(scene.colours.picture).save(stream, "WEBP", lossless=True, quality=60)
    return stream.getvalue(), "image/webp"


def _planes(values: bytes) -> bytes:
    """Compress 16-bit numbers with zlib, all low bytes before all high bytes, which compresses better."""
    return zlib.compress(values[0::2] + values[1::2], 9)


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
