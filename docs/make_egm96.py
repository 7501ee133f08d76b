"""Make georef/data/egm96_15.tif, the EGM96 geoid grid that the package ships.

    apt-get download proj-data && dpkg-deb -x proj-data_*.deb proj-data
    python docs/make_egm96.py proj-data/usr/share/proj/egm96_15.gtx georef/data/egm96_15.tif

The result is a geodetic TIFF grid (https://proj.org/en/stable/specifications/geodetictiffgrids.html) with heights in
whole millimetres, which PROJ reads as it is. Needs tifffile, which scikit-image brings.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
import tifffile

STEP_M = 0.001
"""Unit of the stored integers; the grid is rounded to it, so that no node is off by more than half of it."""

METADATA = f"""<GDALMetadata>
<Item name="TYPE">VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL</Item>
<Item name="DESCRIPTION" sample="0" role="description">geoid_undulation</Item>
<Item name="UNITTYPE" sample="0" role="unittype">metre</Item>
<Item name="SCALE" sample="0" role="scale">{STEP_M}</Item>
<Item name="OFFSET" sample="0" role="offset">0</Item>
<Item name="area_of_use">World</Item>
<Item name="target_crs_epsg_code">5773</Item>
</GDALMetadata>
"""

GEO_KEYS = (1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 2, 2048, 0, 1, 4326)
"""Geographic coordinates, values at points (not areas), WGS 84."""


def make(gtx: Path, target: Path) -> None:
    """Write the grid of `gtx` (https://vdatum.noaa.gov/docs/gtx_info.html) as a geodetic TIFF grid."""
    content = gtx.read_bytes()
    south, west, lat_step, lon_step, rows, columns = struct.unpack(">4d2i", content[:40])
    heights = np.frombuffer(content[40:], ">f4").reshape(rows, columns)[::-1].astype(np.float64)
    north = south + (rows - 1) * lat_step
    tags = [
        (33550, "d", 3, (lon_step, lat_step, 0.0), True),  # ModelPixelScale
        (33922, "d", 6, (0.0, 0.0, 0.0, west, north, 0.0), True),  # ModelTiepoint
        (34735, "H", len(GEO_KEYS), GEO_KEYS, True),
        (42112, "s", 0, METADATA, True),
    ]
    tifffile.imwrite(
        target,
        np.round(heights / STEP_M).astype("<i4"),
        photometric="minisblack",
        tile=(256, 256),
        compression="zlib",
        predictor=True,
        compressionargs={"level": 9},
        software=None,
        metadata=None,
        extratags=tags,
    )


if __name__ == "__main__":
    make(Path(sys.argv[1]), Path(sys.argv[2]))
