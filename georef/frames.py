"""Table of coordinate frames: every array of coordinates in this project is in one of these.

An array names its frame where it enters or leaves a function; a `georef.transform.Transform` carries the two frames
that it joins. Longitude always comes before latitude. All solid frames are right-handed, so transforms between them
preserve orientation; IMAGE, whose rows run downwards, has no third axis.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Frame:
    """One row of the table.

    name : upper-case identifier, unique
    unit : unit of the coordinates, in their order where they differ
    axes : direction in which the first, second and third coordinate grow; two entries for a plane
    handedness : "right" for right-handed solid frames (curvilinear ones by east, north, up), "none" for planes
    notes : origin and anything else needed to interpret the numbers
    """

    name: str
    unit: str
    axes: tuple[str, ...]
    handedness: Literal["right", "none"]
    notes: str

    def __str__(self) -> str:
        return self.name


IMAGE = Frame(
    "IMAGE",
    "pixels",
    ("right", "down"),
    "none",
    "origin: outer corner of the top left pixel, so pixel centres lie at +0.5",
)
FIGURE = Frame(
    "FIGURE",
    "figure units",
    ("right as seen", "up", "to the viewer"),
    "right",
    "origin: pelvis; the drawn figure is 1.79 units high, after the 1.79 m of the paper",
)
PART = Frame(
    "PART",
    "half the edge of the part's cube",
    ("right as seen", "up", "to the viewer"),
    "right",
    "[-1, 1] along each axis; origin: mean of the part's anchor joints, for the head the head joint",
)
ASSET = Frame(
    "ASSET",
    "metres",
    ("left of the figure", "up", "front of the figure"),
    "right",
    "glTF axes; origin: on the ground between the feet",
)
TILE = Frame(
    "TILE",
    "metres",
    ("left of the figure", "back of the figure", "up"),
    "right",
    "3D Tiles axes; (x, y, z) ASSET is (x, -z, y) TILE, so an unturned tile faces south; origin as ASSET",
)
ENU = Frame(
    "ENU",
    "metres",
    ("east", "north", "up along the ellipsoid's normal"),
    "right",
    "origin: the place of the figure; ENU frames of different places are different frames under one name",
)
ECEF = Frame(
    "ECEF",
    "metres",
    ("to 0 E on the equator", "to 90 E on the equator", "to the north pole"),
    "right",
    "EPSG:4978, WGS 84; origin: centre of the earth; float64 only, a float32 has steps of 0.5 m here",
)
GEODETIC = Frame(
    "GEODETIC",
    "degrees, degrees, metres",
    ("longitude east", "latitude north", "height above the ellipsoid"),
    "right",
    "EPSG:4979 with longitude first, WGS 84; no matrix joins it to ECEF, see georef.geodesy",
)
MAP = Frame(
    "MAP",
    "unit of the sheet's reference system",
    ("easting or longitude", "northing or latitude"),
    "none",
    "the reference system of one map sheet, first coordinate always the easterly one",
)

FRAMES: dict[str, Frame] = {frame.name: frame for frame in (IMAGE, FIGURE, PART, ASSET, TILE, ENU, ECEF, GEODETIC, MAP)}
