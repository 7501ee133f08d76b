"""Facts about glTF files."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from exporters.errors import ExportError
from exporters.facts import file_sizes, size_facts, solid_facts
from exporters.gltf.outline import OUTLINE
from exporters.gltf.reader import Compressed, Gltf, read_gltf
from exporters.gltf.stated import stated_corners, stated_counts
from exporters.texture_files import texture_size
from georef.untrusted.damage import DamagedFile


def gltf_facts(path: Path) -> dict[str, Any]:
    """Return facts about a .glb or .gltf file; see `exporters.inspect.inspect`."""
    gltf = read_gltf(path)
    try:
        return _facts(gltf)
    except DamagedFile as error:
        raise ExportError(path, f"broken glTF ({error})", "run fig2mesh validate") from error


def _shape(gltf: Gltf) -> dict[str, Any]:
    outlines = gltf.scene_outlines()
    meshes = [mesh for mesh in range(len(gltf.items("meshes"))) if mesh not in gltf.outlines]
    solids = gltf.scene_solids()
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in solids)])
    vertices = np.concatenate([np.empty((0, 3), np.float32), *(vertices for vertices, _ in solids)])
    faces = [faces + start for (_, faces), start in zip(solids, starts, strict=False)]
    solid = solid_facts(vertices, np.concatenate([np.empty((0, 3), np.int64), *faces]))
    if outlines and "bounds_m" in solid:
        solid |= size_facts(np.concatenate([vertices, *(vertices for _, vertices, _ in outlines)]))
    count = sum(
        len(gltf.mesh_arrays(mesh, primitive)[0]) for mesh in meshes for primitive in range(len(gltf.primitives(mesh)))
    )
    return {"vertices": count, **solid, "outline": _outline_facts(outlines) if outlines else None}


def _facts(gltf: Gltf) -> dict[str, Any]:
    asset, extras, tables = gltf.document.get("asset", {}), gltf.extras, gltf.tables
    images, notes = gltf.items("images"), list(gltf.lost)
    uris = [item["uri"] for kind in ("buffers", "images") for item in gltf.items(kind) if "uri" in item]
    referenced = [gltf.path.parent / unquote(uri) for uri in uris if not uri.startswith("data:")]
    try:
        shape = _shape(gltf)
    except Compressed as reason:
        shape = stated_counts(gltf) | size_facts(stated_corners(gltf))
        notes.append(f"the mesh is not decoded here ({reason})")
    parts = observed = None
    try:
        parts = _part_names(gltf, tables[0]) if tables else None
        observed = _observed(gltf, tables[0]) if tables else None
    except DamagedFile as error:
        notes.append(f"the table of parts is damaged ({error})")
    return {
        "format": "glTF 2.0 binary" if gltf.path.suffix.lower() == ".glb" else "glTF 2.0",
        "files": file_sizes(gltf.path, *referenced),
        "name": next((node["name"] for node in gltf.items("nodes") if "name" in node), None),
        "copyright": asset.get("copyright"),
        "generator": asset.get("generator"),
        **shape,
        "texture_px": texture_size(gltf.image(0)) if images and images[0].get("name") != OUTLINE else None,
        "parts": parts,
        "observed": observed,
        "placement": extras.get("georeference"),
        "metadata": extras.get("metadata"),
        "notes": notes or None,
    }


def _outline_facts(outlines: list[tuple[str, NDArray[Any], NDArray[Any]]]) -> dict[str, Any]:
    return {"form": outlines[0][0], "triangles": sum(len(faces) for _, _, faces in outlines)}


def _part_names(gltf: Gltf, table: dict[str, Any]) -> list[str]:
    return gltf.texts(_column(table, "name"))


def _observed(gltf: Gltf, table: dict[str, Any]) -> dict[str, float] | None:
    """Observed share of each part; None in files without."""
    if "observedShare" not in table.get("properties", {}):
        return None
    names, shares = _part_names(gltf, table), gltf.column(_column(table, "observedShare")["values"], "<f4")
    if len(names) != len(shares):
        raise DamagedFile(f"{len(names)} names of parts, but {len(shares)} shares")
    return {name: round(float(share), 3) for name, share in zip(names, shares, strict=True)}


def _column(table: dict[str, Any], name: str) -> dict[str, Any]:
    columns: dict[str, dict[str, Any]] = table.get("properties", {})
    if name not in columns:
        raise DamagedFile(f"the property table has no {name}")
    return columns[name]
