"""Options that every command has which starts from a drawing; of what takes time to load, click alone is imported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from fig2mesh.skeleton import FIGURE_HEIGHT

F = TypeVar("F", bound=Callable[..., Any])

FILE = click.Path(path_type=Path)

TRANSFORMS = ("auto", "helmert", "affine", "poly1", "poly2", "poly3", "tps", "projective")
"""Those of `georef.mapsheet`, whose import takes longer than --help may."""


def figure_files(command: F) -> F:
    """What belongs to the picture of a figure: silhouette, joints, parts, and where it is."""
    silhouette = "Silhouette, bright on dark; default: the alpha channel, or inferred."
    options = (
        click.option("--mask", type=FILE, metavar="PNG", help=silhouette),
        click.option("--keypoints", type=FILE, metavar="JSON", help="The 21 joints; default: inferred."),
        click.option("--part-labels", type=FILE, metavar="PNG", help="Part label of every pixel."),
        click.option(
            "--bbox", type=int, nargs=4, metavar="X0 Y0 X1 Y1", help="Part of the picture that holds the figure."
        ),
    )
    # The one applied last is listed first.
    for option in reversed(options):
        command = option(command)
    return command


def place_options(command: F) -> F:
    """Where the figure stands, which way it looks and how large it is: `fig2mesh.convert.place.PlaceRequest`."""
    options = (
        click.option("--lonlat", type=float, nargs=2, metavar="LON LAT", help="Place on WGS 84, degrees."),
        click.option(
            "--map",
            "map_sheet",
            type=FILE,
            metavar="SHEET",
            help="Place from a georeferenced map instead: its picture with tags, a world file, .points or a IIIF "
            "annotation beside it; or one of these files.",
        ),
        click.option(
            "--at",
            type=float,
            nargs=2,
            metavar="X Y",
            help="Pixel of SHEET where the feet are; default: where they are drawn, if FIGURE is the sheet.",
        ),
        click.option(
            "--size-from",
            type=click.Choice(["height", "map"]),
            default="height",
            show_default=True,
            help="map: as large on the globe as drawn on the map, in place of --height-m.",
        ),
        click.option(
            "--map-transform",
            type=click.Choice(TRANSFORMS),
            default="auto",
            show_default=True,
            help="Fitted to control points; auto: as the file says, or affine.",
        ),
        click.option(
            "--map-crs",
            metavar="CRS",
            help="Reference system of the sheet, such as EPSG:2056, where its files name none; for points in longitude "
            "and latitude, the projection to fit in.",
        ),
        click.option(
            "--facing",
            default="viewer",
            metavar="N|NE|…|DEG|viewer",
            show_default=True,
            help="Compass bearing of the nose; viewer: towards the reader of the map, south without --map.",
        ),
        click.option("--height-m", type=float, metavar="M", help=f"Height of the figure.  [default: {FIGURE_HEIGHT}]"),
        click.option(
            "--altitude",
            type=float,
            metavar="M",
            default=0.0,
            show_default=True,
            help="Height of the feet.",
        ),
        click.option(
            "--altitude-datum",
            default="ellipsoid",
            metavar="ellipsoid|egm96|GRIDFILE",
            show_default=True,
            help="What --altitude is measured from.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


def messages(command: F) -> F:
    """How much is said."""
    command = click.option("-v", "--verbose", count=True, help="More messages; twice: tracebacks.")(command)
    return click.option("-q", "--quiet", is_flag=True, help="Only errors.")(command)
