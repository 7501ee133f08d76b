"""Request of `fig2mesh view`."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.conversion.fields import option, request_class
from fig2mesh.conversion.request import FigureFiles, InferenceOptions, PlaceRequest


@request_class
class ViewRequest(FigureFiles, PlaceRequest, InferenceOptions):
    """A figure, and options for showing it in a browser."""

    output: Path | None = option(
        default=None, short="o", metavar="PAGE.html", help="Write the page to this file instead of showing it."
    )
    effects: str | None = option(
        default=None,
        metavar="NAME,NAME…",
        help="Initially enabled effects: texture, blend, creases, light, ao, outline, smooth-union, perspective, "
        "antialias. Default: all except perspective, and outline only if the drawing has no contours of its own.",
    )
    cesium: Path | None = option(
        default=None,
        metavar="DIR",
        help="Folder of the npm package cesium. Default: node_modules/cesium in the current folder or a parent. A page "
        "written with -o loads CesiumJS from a folder cesium next to it.",
    )
    port: int = option(
        default=0, low=0, high=65535, metavar="N", default_text="a free one", help="Port of the local web server."
    )
    open: bool = option(default=True, help="Open the page in a browser.")
    overwrite: bool = option(default=False, help="Replace an existing page.")
