"""Request of `fig2mesh globe`."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.conversion.fields import check_fields, option, request_class


@request_class
class GlobeRequest:
    """How models are shown on a globe."""

    output: Path | None = option(
        default=None,
        short="o",
        metavar="DIR",
        help="Write page, files and CesiumJS into DIR, which any web server can serve, instead of showing them.",
    )
    cesium: Path | None = option(
        default=None,
        metavar="DIR",
        help="The npm package cesium; default: node_modules/cesium in this folder or one above.",
    )
    port: int = option(
        default=0, low=0, high=65535, metavar="N", default_text="a free one", help="Of the page's server."
    )
    open: bool = option(default=True, help="Open the page in a browser.")
    overwrite: bool = option(default=False, help="Replace the page in DIR.")

    def __post_init__(self) -> None:
        check_fields(self)
