"""Inspection of files: format, size, topology, texture and placement as plain data."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from exporters.errors import ExportError
from exporters.gis.inspect import places_facts
from exporters.gltf.inspect import gltf_facts
from exporters.tiles.inspect import tileset_facts
from exporters.triangles.inspect import triangle_facts
from exporters.usd.process import usd_facts_isolated
from georef.errors import PlacementError
from georef.untrusted.damage import DamagedFile

# fmt: off
FACTS = {
    ".glb": gltf_facts, ".gltf": gltf_facts, ".usda": usd_facts_isolated, ".usdc": usd_facts_isolated,
    ".usdz": usd_facts_isolated, ".ply": triangle_facts, ".obj": triangle_facts, ".czml": places_facts,
    ".geojson": places_facts, ".json": tileset_facts,
}
KEYS = (
    "format", "files", "name", "copyright", "generator", "vertices", "triangles", "bounds_m", "size_m", "watertight",
    "solid", "components", "genus", "volume_m3", "outline", "texture_px", "parts", "observed", "placement",
    "lods", "metadata", "notes",
)
# fmt: on


def inspect(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return facts about a file or tileset, JSON-serialisable; facts that a format does not contain are None.

    path : as for `exporters.validate.validate`
    returns : format, files (name → bytes), name, copyright, generator, vertices, triangles, bounds_m [low, high] in
        the frame of the file, size_m, watertight, solid, components, genus, volume_m3, outline (form and triangles of
        the drawn contour, which only bounds_m and size_m also count), texture_px [width, height],
        parts, observed (part → observed share of its surface), placement (lon_deg, lat_deg, height_m, heading_deg and
        any further recorded values), lods, metadata, notes (what is missing or damaged, a line each)

    Raises ExportError for files that cannot be read.
    """
    path = Path(path)
    if not path.exists():
        raise ExportError(path, "no such file or folder", "check the path")
    file = path / "tileset.json" if path.is_dir() else path
    facts = FACTS.get(file.suffix.lower())
    if facts is None:
        raise ExportError(
            path, f"cannot inspect files with suffix {path.suffix or 'none'}", f"give one of {', '.join(FACTS)}"
        )
    try:
        found = facts(file)
    except (DamagedFile, PlacementError) as error:
        raise ExportError(path, f"damaged ({error})", "run fig2mesh validate") from error
    return {key: found.get(key) for key in KEYS}
