"""Request of `fig2mesh view`."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.conversion.fields import option, request_class
from fig2mesh.conversion.request import FigureFiles, InferenceOptions, PlaceRequest


@request_class
class ViewRequest(FigureFiles, PlaceRequest, InferenceOptions):
    """A figure, and how a browser shows it."""

    output: Path | None = option(
        default=None, short="o", metavar="PAGE.html", help="Write the page there instead of showing it."
    )
    effects: str | None = option(
        default=None,
        metavar="NAME,NAME…",
        help="What is on at first: texture, blend, creases, light, ao, outline, smooth-union, perspective, antialias. "
        "Default: all but perspective, and outline only where the drawing's own is not there.",
    )
    cesium: Path | None = option(
        default=None,
        metavar="DIR",
        help="The npm package cesium; default: node_modules/cesium in this folder or one above. A page written with "
        "-o loads CesiumJS from the folder cesium beside it.",
    )
    port: int = option(
        default=0, low=0, high=65535, metavar="N", default_text="a free one", help="Of the page's server."
    )
    open: bool = option(default=True, help="Open the page in a browser.")
    overwrite: bool = option(default=False, help="Replace an existing page.")
