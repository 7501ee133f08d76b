"""Index files in readers of tables; runs in an environment of its own.

stdin:  {"gpkg": path, "geojson": path, "stac": path of the collection, "figure": path of the .geojson of one figure}
stdout: for each reader: its version, the names, the points (lon, lat, height) and what it warned of, or its error
"""

import json
import sys
import warnings
from pathlib import Path

import geopandas
import pyogrio
import pystac
import stac_geoparquet


def main() -> None:
    job = json.load(sys.stdin)
    gdal = ".".join(map(str, pyogrio.__gdal_version__))
    readers = {
        "gpkg": (f"geopandas {geopandas.__version__}, GDAL {gdal}", lambda: table(job["gpkg"])),
        "index": (f"geopandas {geopandas.__version__}, GDAL {gdal}", lambda: table(job["geojson"])),
        "geojson": (f"geopandas {geopandas.__version__}, GDAL {gdal}", lambda: table(job["figure"])),
        "stac pystac": (f"pystac {pystac.__version__}", lambda: items(job["stac"])),
        "stac geodataframe": (f"stac-geoparquet {stac_geoparquet.__version__}", lambda: frame(job["stac"])),
        "stac arrow": (f"stac-geoparquet {stac_geoparquet.__version__}", lambda: arrow(job["stac"])),
    }
    print(json.dumps({name: {"version": version, **guarded(read)} for name, (version, read) in readers.items()}))


def guarded(read) -> dict:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = read()
        except Exception as error:
            return {"error": f"{type(error).__name__}: {error}"[:300]}
    return found | {"warnings": [str(each.message) for each in caught]}


def table(path: str) -> dict:
    rows = geopandas.read_file(path)
    layers = [str(name) for name, _ in pyogrio.list_layers(path)]
    points = [[point.x, point.y, point.z if point.has_z else None] for point in rows.geometry]
    return {"names": list(rows["name"]), "points": points, "crs": rows.crs.to_string(), "layers": layers}


def items(path: str) -> dict:
    found = list(pystac.read_file(path).get_items(recursive=True))
    missing = [
        asset.href
        for item in found
        for asset in item.get_assets().values()
        if not Path(asset.get_absolute_href()).exists()
    ]
    return {
        "names": [item.properties.get("title", item.id) for item in found],
        "points": [item.geometry["coordinates"] for item in found],
        "missing": missing,
    }


def plain(path: str) -> list:
    return [item.to_dict(transform_hrefs=False) for item in pystac.read_file(path).get_items(recursive=True)]


def frame(path: str) -> dict:
    rows = stac_geoparquet.to_geodataframe(plain(path))
    return {
        "names": list(rows.get("title", rows["id"])),
        "points": [[p.x, p.y, p.z if p.has_z else None] for p in rows.geometry.centroid]
        if not all(rows.geometry.geom_type == "Point")
        else [[p.x, p.y, p.z if p.has_z else None] for p in rows.geometry],
    }


def arrow(path: str) -> dict:
    import stac_geoparquet.arrow

    read = stac_geoparquet.arrow.parse_stac_items_to_arrow(plain(path)).read_all()
    return {"names": read.column("id").to_pylist(), "points": []}


main()
