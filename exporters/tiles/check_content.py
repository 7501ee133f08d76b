"""Content of 3D Tiles: detection of its type, and reading and checking of meshes."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.errors import ExportError
from exporters.findings import Finding
from exporters.gltf.check import check_gltf
from exporters.gltf.reader import MAX_BYTES, read_gltf
from exporters.tiles.b3dm import B3dm, read_b3dm
from exporters.tiles.volumes import is_number_list
from georef.geodesy import tile_from_asset
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import read_bytes

UNCHECKED = {
    b"pnts": "a point cloud",
    b"i3dm": "an instanced model",
    b"cmpt": "a composite",
    b"vctr": "a vector tile",
    b"geom": "a geometry tile",
    b"subt": "a subtree",
}
"""Legal content types that are not checked, by their first four bytes."""


@dataclass(frozen=True)
class Content:
    """Data of a content file.

    kind : "tileset", "mesh", or "other"
    findings : about the file itself
    points : (N, 3) float64 vertices in the frame of the tile; None if not available
    georeference : the record of its place, as written by `exporters.georeference`; None without one
    """

    kind: str
    findings: tuple[Finding, ...] = ()
    points: NDArray[np.float64] | None = None
    georeference: dict[str, Any] | None = None


def read_content(file: Path, external: bool, up_axis: str = "Y") -> Content:
    """Read and check a content file, whose type is detected from its first bytes.

    external : as for `check_gltf`; up_axis : up axis of glTF content in this tileset, by asset.gltfUpAxis of 1.0
    """
    with file.open("rb") as stream:
        magic = stream.read(4)
    if magic in UNCHECKED:
        return Content("other", (Finding("info", "NOT_CHECKED", f"{UNCHECKED[magic]} is not checked", file.name),))
    if magic == b"glTF" or file.suffix.lower() in (".glb", ".gltf"):
        return _mesh(file, tuple(check_gltf(file, external)), up_axis)
    if magic == b"b3dm":
        return _b3dm(file, external, up_axis)
    if file.suffix.lower() == ".json" or magic[:1] == b"{":
        return Content("tileset")
    found = Finding("warning", "CONTENT", f"content of unknown type ({magic!r})", file.name)
    return Content("other", (found,))


def _mesh(file: Path, findings: tuple[Finding, ...], up_axis: str) -> Content:
    try:
        gltf = read_gltf(file)
        vertices = gltf.scene_vertices()
    except (ExportError, DamagedFile):
        return Content("mesh", findings)  # reported by check_gltf
    center = gltf.extension("CESIUM_RTC").get("center", [0.0, 0.0, 0.0])
    points = vertices + np.asarray(center, dtype=np.float64)
    if up_axis == "X":
        points = np.stack([-points[:, 2], points[:, 1], points[:, 0]], axis=1)
    elif up_axis != "Z":
        points = tile_from_asset().apply(points)
    record = gltf.extras.get("georeference")
    return Content("mesh", findings, points, record if isinstance(record, dict) else None)


def _b3dm(file: Path, external: bool, up_axis: str) -> Content:
    try:
        tile = read_b3dm(read_bytes(file, MAX_BYTES))
    except (OSError, DamagedFile) as error:
        return Content("mesh", (Finding("error", "B3DM", str(error), file.name),))
    with tempfile.TemporaryDirectory(prefix="fig2mesh-") as folder:
        inner = Path(folder) / f"{file.name}.glb"
        # Other writers pad the tile to eight bytes after the glTF.
        length = int.from_bytes(tile.glb[8:12], "little")
        inner.write_bytes(tile.glb[:length])
        content = _mesh(inner, tuple(check_gltf(inner, external)), up_axis)
        findings = content.findings + tuple(_check_batches(tile, inner, file.name))
    points = content.points
    center = tile.feature_table.get("RTC_CENTER")
    if center is not None and not is_number_list(center, 3):
        findings += (Finding("error", "B3DM", "RTC_CENTER is not 3 numbers", file.name),)
    elif points is not None and center is not None:
        points = points + np.asarray(center, dtype=np.float64)
    return Content("mesh", findings, points, content.georeference)


def _check_batches(tile: B3dm, glb: Path, name: str) -> list[Finding]:
    length = tile.feature_table.get("BATCH_LENGTH")
    if not isinstance(length, int) or length < 0:
        return [Finding("error", "BATCH_LENGTH", f"BATCH_LENGTH is {length}", name)]
    findings = [
        Finding("error", "BATCH_TABLE", f"{key} has {len(values)} of {length} values", name)
        for key, values in tile.batch_table.items()
        if isinstance(values, list) and len(values) != length
    ]
    try:
        gltf = read_gltf(glb)
        for mesh in gltf.items("meshes"):
            for primitive in mesh["primitives"]:
                accessor = primitive["attributes"].get("_BATCHID")
                if accessor is None:
                    continue
                ids = gltf.accessor(accessor)
                if ids.min() < 0 or ids.max() >= length or (ids != np.rint(ids)).any():
                    findings.append(Finding("error", "BATCH_ID", f"batch ids outside 0..{length - 1}", name))
    except (ExportError, DamagedFile):
        pass  # reported by check_gltf
    return findings
