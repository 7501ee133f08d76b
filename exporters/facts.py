"""Facts that are determined the same way for files of all formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from exporters.solid import measure_topology
from georef.untrusted.json_file import is_plain_file


def solid_facts(vertices: NDArray[Any], faces: NDArray[Any]) -> dict[str, Any]:
    """Size and topology of triangles; vertices : (V, 3) in the frame of the file, seams undone; faces : (F, 3)."""
    if not len(faces):
        return {"triangles": 0}
    found = measure_topology(vertices, faces)
    return {
        "triangles": len(faces),
        **size_facts(vertices),
        "watertight": found.closed,
        "solid": found.solid,
        "components": found.components,
        "genus": found.genus,
        "volume_m3": found.volume,
    }


def size_facts(vertices: NDArray[Any]) -> dict[str, Any]:
    """Bounds and size of vertices (V, 3), V > 0, in the frame of the file."""
    low, high = vertices.min(axis=0).astype(float), vertices.max(axis=0).astype(float)
    return {"bounds_m": [low.tolist(), high.tolist()], "size_m": (high - low).tolist()}


def file_sizes(*paths: Path) -> dict[str, int]:
    """Sizes in bytes of the files that exist, by name."""
    return {path.name: path.stat().st_size for path in paths if is_plain_file(path)}
