"""Conversion of altitudes above sea level to heights above the ellipsoid: h = H + N.

H is the altitude in its datum, N the geoid's height above the WGS 84 ellipsoid from a grid, h the height for globes.
N is read by PROJ's `vgridshift` from one grid file given by its full path. A pyproj transformation between two
reference systems would, where the grid is missing, return H unchanged with only a warning.
https://proj.org/en/stable/operations/transformations/vgridshift.html
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import TYPE_CHECKING

from georef.errors import PlacementError
from georef.grid_file import check_grid
from georef.placement import check_lonlat

if TYPE_CHECKING:
    from pyproj import Transformer

OPTION = "--altitude-datum"

EGM96_GRID = Path(__file__).parent / "data" / "egm96_15.tif"
"""The bundled 15' EGM96 grid, in whole millimetres; for its origin see georef/data/README.md."""

GRID_SUFFIXES = (".gtx", ".tif", ".tiff")

MAX_UNDULATION_M = 200.0
"""Largest plausible undulation: geoids and levelling datums stay closer (EGM96: -107 m to 86 m), terrain does not."""


def grid_path(datum: str | Path) -> Path | None:
    """Grid file of a height datum; None for "ellipsoid", which needs none.

    datum : "ellipsoid" or "egm96" in any case, or the path of a .gtx or .tif grid

    Raises PlacementError where the grid is missing or the file is of another kind.
    """
    word = str(datum).strip()
    if word.lower() == "ellipsoid":
        return None
    egm96 = word.lower() == "egm96"
    path = EGM96_GRID if egm96 else Path(datum)
    if not path.is_file():
        if egm96:
            raise PlacementError(f"{OPTION} egm96", f"{path} is missing", "reinstall fig2mesh, or give a grid file")
        raise PlacementError(
            f"{OPTION} {datum}", "no such file", "give ellipsoid, egm96 or the path of a .gtx or .tif geoid grid"
        )
    if path.suffix.lower() not in GRID_SUFFIXES:
        raise PlacementError(
            f"{OPTION} {datum}", f"unknown suffix {path.suffix!r}", "give a geoid grid as .gtx or GeoTIFF (.tif)"
        )
    # Resolved, because PROJ reads a leading @ as "optional, ignore if missing" and searches its own folders first
    # for relative names.
    path = path.resolve()
    if any(character in str(path) for character in ',"'):
        raise PlacementError(
            f"{OPTION} {datum}",
            f"PROJ cannot read paths with a comma or a quotation mark ({path})",
            "rename or move the file",
        )
    return path


@functools.lru_cache(maxsize=16)  # each entry keeps its file open
def _shift(path: Path, modified_ns: int) -> Transformer:
    from pyproj import Transformer

    # The modification time is only part of the cache key: a rewritten grid must not be served from the cache.
    return Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad "
        f'+step +proj=vgridshift +grids="{path}" +multiplier=1 '
        "+step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )


def undulation_m(lon_deg: float, lat_deg: float, datum: str | Path) -> float:
    """Undulation N, the height of a datum's zero surface above the WGS 84 ellipsoid.

    lon_deg, lat_deg : GEODETIC, degrees
    datum : as for `grid_path`
    returns : metres, by bilinear interpolation between the grid's nodes; 0 for "ellipsoid"

    Raises PlacementError where the grid is missing or unreadable, has no value there, or holds a value that
    is not plausible for a geoid.
    """
    check_lonlat(lon_deg, lat_deg)
    path = grid_path(datum)
    if path is None:
        return 0.0
    from pyproj.exceptions import ProjError

    try:
        check_grid(path)
        shift = _shift(path, path.stat().st_mtime_ns)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise PlacementError(
            f"{OPTION} {datum}", f"damaged grid ({reason})", "give a geoid grid as .gtx or GeoTIFF (.tif)"
        ) from error
    except ProjError as error:
        raise PlacementError(
            f"{OPTION} {datum}", "PROJ cannot read this as a geoid grid", "give a geoid grid as .gtx or GeoTIFF (.tif)"
        ) from error
    try:
        undulation = float(shift.transform(lon_deg, lat_deg, 0.0, errcheck=True)[2])
    except ProjError:
        undulation = math.nan
    if not math.isfinite(undulation):
        raise PlacementError(
            f"{OPTION} {datum}",
            f"the grid has no value at longitude {lon_deg:.10g}, latitude {lat_deg:.10g}",
            "use a grid that covers the location, or give the altitude above the ellipsoid",
        )
    if abs(undulation) > MAX_UNDULATION_M:
        raise PlacementError(
            f"{OPTION} {datum}",
            f"its value of {undulation:.6g} m at the location is not a plausible geoid height",
            "give a geoid grid, not a terrain model",
        )
    return undulation


def ellipsoidal_height(lon_deg: float, lat_deg: float, altitude_m: float, datum: str | Path = "ellipsoid") -> float:
    """Height h above the WGS 84 ellipsoid of an altitude H in a height datum: h = H + N.

    lon_deg, lat_deg : GEODETIC, degrees
    altitude_m : H, metres above the datum's zero surface
    datum : "ellipsoid" (h = H), "egm96", or the path of a geoid grid (.gtx or .tif)
    returns : metres

    Raises PlacementError as `undulation_m` does, and for an altitude that is not finite. An altitude is never
    passed through unconverted.
    """
    if not math.isfinite(altitude_m):
        raise PlacementError("--altitude", f"{altitude_m} is not a finite number", "give metres")
    return altitude_m + undulation_m(lon_deg, lat_deg, datum)
