"""Request of `fig2mesh globe`."""

from __future__ import annotations

from pathlib import Path

from fig2mesh.conversion.fields import check_fields, option, request_class
from fig2mesh.errors import InputError


@request_class
class GlobeRequest:
    """Options for showing models on a globe."""

    output: Path | None = option(
        default=None,
        short="o",
        metavar="DIR",
        help="Write the page, its files and CesiumJS to DIR, for any web server, instead of showing it.",
    )
    cesium: Path | None = option(
        default=None,
        metavar="DIR",
        help="Folder of the npm package cesium. Default: node_modules/cesium in the current folder or a parent.",
    )
    map: Path | None = option(
        default=None,
        metavar="SHEET",
        help="Drape a georeferenced map sheet over the ground, such as the one that the figures come from: its picture "
        "with a world file, GeoTIFF tags or control points, as for the main job.",
    )
    map_crs: str | None = option(
        default=None,
        metavar="CRS",
        help="Coordinate reference system of the sheet, such as EPSG:2056, if its files name none.",
    )
    port: int = option(
        default=0, low=0, high=65535, metavar="N", default_text="a free one", help="Port of the local web server."
    )
    open: bool = option(default=True, help="Open the page in a browser.")
    overwrite: bool = option(default=False, help="Replace an existing page in DIR.")

    def __post_init__(self) -> None:
        check_fields(self)
        if self.map_crs is not None and self.map is None:
            raise InputError("--map-crs", "there is no sheet", "give --map SHEET with it")
