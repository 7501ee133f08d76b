"""Facts about PLY and OBJ files."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from exporters.facts import file_sizes, solid_facts
from exporters.solid import merged_by_position
from exporters.triangles.files import read_triangles


def triangle_facts(path: Path) -> dict[str, Any]:
    """Return facts about a .ply or .obj file; see `exporters.inspect.inspect`."""
    mesh = read_triangles(path)
    vertices, faces = merged_by_position(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    image = getattr(getattr(mesh.visual, "material", None), "image", None)
    ply = path.suffix.lower() == ".ply"
    companions = [] if ply else [path.with_suffix(".mtl"), path.with_name(f"{path.stem}_texture.png")]
    return {
        "format": "Stanford PLY" if ply else "Wavefront OBJ",
        "files": file_sizes(path, *companions),
        "name": path.stem,
        "vertices": len(mesh.vertices),
        **solid_facts(vertices, faces),
        "texture_px": list(image.size) if image is not None else None,
        **_comments(path),
    }


def _comments(path: Path) -> dict[str, Any]:
    """Read credits and place from the comments at the top that fig2mesh writes."""
    facts: dict[str, Any] = {}
    place: dict[str, Any] = {}
    with path.open("rb") as stream:
        for raw in stream:
            word, _, rest = raw.decode("ascii", "replace").strip().partition(" ")
            if word not in ("ply", "format", "comment", "#"):
                break
            key, _, value = rest.replace(": ", " ", 1).partition(" ")
            if key in ("copyright", "generator"):
                facts[key] = value
            elif key in ("lon_deg", "lat_deg", "height_m", "heading_deg", "figure_height_m"):
                with suppress(ValueError):
                    place[key] = float(value)
            elif key in ("crs", "height_datum"):
                place[key] = value
    return facts | {"placement": place or None}
