"""PLY and OBJ files: their size and references, and their triangles, read by trimesh.

http://paulbourke.net/dataformats/obj/ and http://paulbourke.net/dataformats/mtl/
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from exporters.errors import ExportError
from georef.untrusted.damage import DamagedFile
from georef.untrusted.image_file import check_header
from georef.untrusted.json_file import is_plain_file, read_bytes

MAX_TRIANGLE_BYTES = 256 << 20
"""Largest PLY or OBJ that is read: some 10 million triangles; trimesh needs about ten times as much memory."""

MAX_LIBRARY_BYTES = 1 << 20
"""Largest material library."""

MAX_TEXTURE_BYTES = 256 << 20

MAX_REFERENCES = 64
"""Limit of files that an OBJ and its libraries refer to; figures have two."""

Reference = tuple[Path, str, str, Path]
"""File, keyword, referenced name, and its path."""


def references_of(path: Path) -> list[Reference]:
    """Return the material libraries of an OBJ, and the textures of those, each once.

    Raises ExportError for more than `MAX_REFERENCES`, and for a file that cannot be read.
    """
    libraries = list(_named(path, "mtllib", MAX_TRIANGLE_BYTES))
    existing = [library for *_, library in libraries if is_plain_file(library)]
    found = libraries + [texture for each in existing for texture in _named(each, "map_Kd", MAX_LIBRARY_BYTES)]
    if len(found) > MAX_REFERENCES:
        raise ExportError(path, f"refers to {len(found)} files", f"give a model with at most {MAX_REFERENCES}")
    return found


def check_triangle_file(path: Path) -> None:
    """Raise ExportError for a .ply or .obj that is too large, or that refers to devices, pipes or huge files."""
    try:
        size = path.stat().st_size
        if not path.is_file():
            raise ExportError(path, "not a regular file", "give a .ply or .obj file")
    except OSError as error:
        raise ExportError(path, error.strerror or "cannot be read", "check the path") from None
    if size > MAX_TRIANGLE_BYTES:
        finding = f"{size / 1e6:.0f} MB, more than the limit of {MAX_TRIANGLE_BYTES / 1e6:.0f} MB"
        raise ExportError(path, finding, "simplify the model")
    if path.suffix.lower() != ".obj":
        return
    for file, word, name, target in references_of(path):
        if not os.path.exists(target):
            continue  # reported by `exporters.validate`
        limit = MAX_LIBRARY_BYTES if word == "mtllib" else MAX_TEXTURE_BYTES
        try:
            data = read_bytes(target, limit)
            if word == "map_Kd":
                check_header(data)
        except (OSError, DamagedFile) as error:
            raise ExportError(file, f"{word} {name[:80]}: {error}", "give the model with its files") from None


def _named(file: Path, keyword: str, limit: int) -> Iterator[Reference]:
    try:
        data = read_bytes(file, limit)
    except (OSError, DamagedFile) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ExportError(file, reason, "give the model with its files") from None
    known = set()
    for line in data.splitlines():
        if not line.lstrip().startswith(keyword.encode()):
            continue
        word, _, name = line.decode("utf-8", "replace").strip().partition(" ")
        name = name.strip()
        if word == keyword and name not in known and "\0" not in name:
            known.add(name)
            yield file, word, name, file.parent / name


def read_triangles(path: Path) -> Any:
    """Read a .ply or .obj file as trimesh.Trimesh, without merging vertices. Raises ExportError if unreadable."""
    import trimesh

    check_triangle_file(path)
    try:
        mesh = trimesh.load_mesh(str(path), process=False)
    except Exception as error:  # trimesh passes on all exceptions of its parsers
        raise ExportError(path, f"cannot be read ({error})", "write it again") from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise ExportError(path, "does not contain a single triangle mesh", "write it again")
    faces, vertices = np.asarray(mesh.faces), np.asarray(mesh.vertices)
    if vertices.shape[1:] != (3,):
        raise ExportError(path, "its vertices do not have 3 coordinates", "write it again")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ExportError(path, "its triangles use vertices that do not exist", "write it again")
    return mesh
