"""Summary of a finished conversion, in a few lines: what was made, where it stands, and what opens it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from exporters.write import is_tileset
from fig2mesh.conversion.convert import Conversion
from georef.bearing import COMPASS_POINTS
from georef.placement import GeoPlacement

OPENED_BY = {
    ".glb": "Blender or any other glTF viewer",
    ".gltf": "Blender or any other glTF viewer",
    ".usda": "Omniverse, Blender or usdview",
    ".usdc": "Omniverse, Blender or usdview",
    ".usdz": "Quick Look, Omniverse or Blender",
    ".ply": "MeshLab or Blender",
    ".obj": "Blender or MeshLab",
    ".czml": "CesiumJS",
    ".geojson": "QGIS",
}
"""Programs that open a format, by suffix."""
ON_GLOBE = (".glb", ".czml")
"""Suffixes of files that `fig2mesh globe` shows, besides tilesets."""


def summary_of(done: Conversion) -> str:
    """One line: name, height, size of mesh and texture, and the place with its hemispheres spelt out.

    Swapped longitudes and latitudes show here as a place in the wrong country.
    """
    asset = done.asset
    mesh = asset.mesh
    facts = [f"{length(done.placed.height_m)} tall", f"{len(mesh.faces):,} triangles"]
    if mesh.texture is not None:
        height, width = mesh.texture.pixels.shape[:2]
        facts.append(f"texture of {width} × {height} px")
    facts.append(place_of(asset.placement) if asset.placement else "without a place on the earth")
    return f"{asset.name}: {', '.join(facts)}"


def place_of(placement: GeoPlacement) -> str:
    """Place and facing, as in "at 47.376900° N 8.541700° E, facing NE (45°)"."""
    lat, lon = placement.lat_deg, placement.lon_deg
    where = f"at {abs(lat):.6f}° {'S' if lat < 0 else 'N'} {abs(lon):.6f}° {'W' if lon < 0 else 'E'}"
    return f"{where}, facing {COMPASS_POINTS[round(placement.heading_deg / 22.5) % 16]} ({placement.heading_deg:.0f}°)"


def length(metres: float) -> str:
    """A length with a unit that keeps its digits few, such as 1.79 m, 6.2 km or 12 mm."""
    if metres >= 1000:
        return f"{metres / 1000:.3g} km"
    return (
        f"{metres:.3g} m" if metres >= 1 else f"{metres * 100:.3g} cm" if metres >= 0.01 else f"{metres * 1000:.3g} mm"
    )


def opening(targets: Sequence[str], placed: bool) -> str | None:
    """One line about the programs that open the outputs; None where these are pictures alone."""
    found: dict[str, list[str]] = {}
    for target in targets:
        program = "CesiumJS" if is_tileset(target) else OPENED_BY.get(Path(target).suffix.lower())
        if program is not None:
            found.setdefault(program, []).append(target)
    if not found:
        return None
    line = "open " + ", ".join(f"{' and '.join(files)} in {program}" for program, files in found.items())
    shown = [target for target in targets if is_tileset(target) or Path(target).suffix.lower() in ON_GLOBE]
    return f"{line}; on a globe: fig2mesh globe {shown[0]}" if placed and shown else line
