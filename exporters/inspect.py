"""What is in a file: kind, size, solid, texture, place, as plain data for people and scripts."""

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
    "solid", "components", "genus", "volume_m3", "texture_px", "parts", "observed", "placement", "lods", "metadata",
)
# fmt: on


def inspect(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Facts about a file or tileset, JSON-serialisable; what a format does not say is None.

    path : any kind that `exporters.validate.validate` takes
    returns : format, files (name → bytes), name, copyright, generator, vertices, triangles, bounds_m [low, high] in
        the frame of the file, size_m, watertight, solid, components, genus, volume_m3, texture_px [width, height],
        parts, observed (part → share that the drawing showed), placement (lon_deg, lat_deg, height_m, heading_deg and
        what else is recorded), lods, metadata

    Raises ExportError for what cannot be read.
    """
    path = Path(path)
    if not path.exists():
        raise ExportError(path, "is not there", "check the name")
    file = path / "tileset.json" if path.is_dir() else path
    facts = FACTS.get(file.suffix.lower())
    if facts is None:
        raise ExportError(path, f"cannot inspect suffix {path.suffix or 'none'}", "see exporters.write.FORMATS")
    try:
        found = facts(file)
    except (DamagedFile, PlacementError) as error:
        raise ExportError(path, f"damaged ({error})", "see fig2mesh validate") from error
    return {key: found.get(key) for key in KEYS}
