"""Reader of glTF files: documents, buffers, accessors, images, and nodes with their transforms.

Documents are validated before they are used: types by `exporters.gltf.shape`, numbers where they are used. Every
problem raises `DamagedFile`; any other exception from here is a bug.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from exporters.errors import ExportError
from exporters.gltf import meshopt
from exporters.gltf.container import Bytes, mapped, split_glb
from exporters.gltf.lost import drop_lost
from exporters.gltf.outline import outline_form
from exporters.gltf.shape import DOCUMENT, MESHOPT, RTC
from exporters.solid import merged_by_position
from georef.untrusted.damage import DamagedFile, decoding
from georef.untrusted.json_file import parse_json, read_bytes
from georef.untrusted.json_shape import check_shape

DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MAX_BYTES = 1 << 30
"""Largest file, or referenced file, that is read: clients of 3D Tiles fail at a tenth of it."""

FREE_NUMBERS, NUMBERS_PER_BYTE = 1 << 22, 64
"""Limit of numbers read through accessors: a constant, and more for each byte of the buffers. Valid files are read some
ten times; a hundred thousand accessors of the same bytes would take hours. Instances of meshes count as well."""

MAX_SCENE_VERTICES = 20_000_000
"""Limit over all instances of all meshes: nodes may refer to one mesh a million times."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


class NotDecoded(DamagedFile):
    """Valid data in a form that is not decoded here, or whose decoder is not installed."""


class Compressed(NotDecoded):
    """Compressed data without a decoder here."""


@dataclass(frozen=True)
class Gltf:
    """A glTF file: `document`, the JSON; `buffers`, the bytes; `path`, its source; `lost`, notes about extensions that
    are not read because they point nowhere, see `exporters.gltf.lost`."""

    document: dict[str, Any]
    buffers: tuple[bytes, ...]
    path: Path
    lost: tuple[str, ...] = ()
    _count_read: list[int] = field(default_factory=lambda: [0], compare=False, repr=False)

    def items(self, kind: str) -> list[dict[str, Any]]:
        """Return a top-level array of the document, empty if absent."""
        found: list[dict[str, Any]] = self.document.get(kind, [])
        return found

    def item(self, kind: str, index: int) -> dict[str, Any]:
        """Return an item of a top-level array. Raises DamagedFile for an index out of range."""
        found = self.items(kind)
        if index >= len(found):
            raise DamagedFile(f"{kind}/{index} does not exist")
        return found[index]

    @property
    def extras(self) -> dict[str, Any]:
        """Extras of the asset; empty if they are not an object."""
        found = self.document.get("asset", {}).get("extras")
        return found if isinstance(found, dict) else {}

    @property
    def tables(self) -> list[dict[str, Any]]:
        """Property tables of EXT_structural_metadata."""
        found: list[dict[str, Any]] = self.extension("EXT_structural_metadata").get("propertyTables", [])
        return found

    def extension(self, name: str) -> dict[str, Any]:
        """Return an extension of the document, empty if absent."""
        found: dict[str, Any] = self.document.get("extensions", {}).get(name, {})
        return found

    def column(self, view: int, dtype: str) -> NDArray[Any]:
        """Return a buffer view as numbers (N,). Raises DamagedFile if its length is not a multiple of their size."""
        data = self.view(view)
        if len(data) % np.dtype(dtype).itemsize:
            raise DamagedFile(f"bufferView {view} of {len(data)} bytes is not a column of {np.dtype(dtype).name}")
        return np.frombuffer(data, dtype)

    def texts(self, column: dict[str, Any]) -> list[str]:
        """Return the strings in a column of a property table. Raises DamagedFile for invalid ones."""
        if "stringOffsets" not in column:
            raise DamagedFile("a column of strings has no stringOffsets")
        data, offsets = bytes(self.view(column["values"])), self.column(column["stringOffsets"], "<u4").tolist()
        with decoding("invalid UTF-8 in a property table", UnicodeDecodeError):
            return [data[begin:end].decode() for begin, end in itertools.pairwise(offsets)]

    def view(self, index: int) -> bytes:
        """Return the bytes of a buffer view, decompressed if necessary.

        Raises DamagedFile where it lies outside its buffer, NotDecoded without the decoder.
        """
        view = self.item("bufferViews", index)
        for name in MESHOPT:
            if name in view.get("extensions", {}):
                packed = view["extensions"][name]
                self._charge(packed["count"] * packed["byteStride"])
                try:
                    return meshopt.decode(self._span(packed, index), packed)
                except ExportError as error:
                    raise Compressed(f"bufferView {index}: {error.finding}; {error.remedy}") from error
        return self._span(view, index)

    def _span(self, view: dict[str, Any], index: int) -> bytes:
        if view["buffer"] >= len(self.buffers):
            raise DamagedFile(f"buffer {view['buffer']} does not exist")
        data: bytes = self.buffers[view["buffer"]]
        begin, length = view.get("byteOffset", 0), view["byteLength"]
        if begin + length > len(data):
            raise DamagedFile(f"bufferView {index} ends at byte {begin + length} of {len(data)}")
        return data[begin : begin + length]

    def _charge(self, numbers: int) -> None:
        """Count numbers read from the file. Raises NotDecoded beyond `FREE_NUMBERS` and `NUMBERS_PER_BYTE`."""
        self._count_read[0] += numbers
        if self._count_read[0] > FREE_NUMBERS + NUMBERS_PER_BYTE * sum(map(len, self.buffers)):
            raise NotDecoded("its accessors contain far more than the file")

    def accessor(self, index: int) -> NDArray[Any]:
        """Return an accessor's values, (N,) or (N, width), with sparse replacements applied.

        Raises DamagedFile out of bounds, NotDecoded beyond the limit of numbers for a file of this size.
        """
        accessor = self.item("accessors", index)
        if accessor["type"] not in WIDTHS:
            raise DamagedFile(f"accessor {index} is of unknown type {accessor['type'][:20]}")
        dtype, width, count = _dtype(accessor["componentType"]), WIDTHS[accessor["type"]], accessor["count"]
        self._charge(count * width)
        if "bufferView" in accessor:
            view = self.item("bufferViews", accessor["bufferView"])
            values = self._strided(
                accessor["bufferView"], accessor.get("byteOffset", 0), dtype, count, width, view.get("byteStride")
            )
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            self._charge(sparse["count"] * width)
            places, replacements = sparse["indices"], sparse["values"]
            index_type = _dtype(places["componentType"])
            rows = self._strided(
                places["bufferView"], places.get("byteOffset", 0), index_type, sparse["count"], 1, None
            )
            if index_type.kind != "u" or rows.max() >= count:
                raise DamagedFile(f"accessor {index}: sparse indices beyond its {count} elements")
            values = values.copy()
            values[rows[:, 0]] = self._strided(
                replacements["bufferView"], replacements.get("byteOffset", 0), dtype, sparse["count"], width, None
            )
        return values[:, 0] if width == 1 else values

    def numbers(self, index: int) -> NDArray[Any]:
        """Return an accessor's values, converted to floats if its integers are normalised."""
        values = self.accessor(index)
        if not self.item("accessors", index).get("normalized") or values.dtype.kind == "f":
            return values
        scaled = values.astype(np.float64) / np.iinfo(values.dtype).max
        return np.maximum(scaled, -1.0) if values.dtype.kind == "i" else scaled

    def _strided(
        self, view: int, offset: int, dtype: np.dtype[Any], count: int, width: int, stride: int | None
    ) -> NDArray[Any]:
        data = self.view(view)
        row = dtype.itemsize * width
        step = stride or row
        if step < row:
            raise DamagedFile(f"rows of {row} bytes every {step}")
        end = offset + step * (count - 1) + row
        if count < 1 or end > len(data):
            raise DamagedFile(f"{count} elements end at byte {end} of the {len(data)} in bufferView {view}")
        return np.ndarray((count, width), dtype, data, offset, (step, dtype.itemsize))

    def image(self, index: int) -> bytes:
        """Return the bytes of an image file, embedded or referenced. Raises DamagedFile if there are none."""
        item = self.item("images", index)
        if "bufferView" in item:
            return bytes(self.view(item["bufferView"]))
        if "uri" not in item:
            raise DamagedFile(f"image {index} has neither bufferView nor uri")
        return _resource(self.path, item["uri"])

    def mesh_arrays(self, mesh: int = 0, primitive: int = 0) -> tuple[NDArray[Any], NDArray[np.int64]]:
        """Return positions (V, 3) and triangles (F, 3) of one primitive, in the frame of its mesh.

        Strips and fans are converted to triangles; points and lines have none. Raises NotDecoded for Draco compression.
        """
        item = self.primitives(mesh)[primitive]
        positions = self._positions(item)
        if not len(positions):
            return positions, np.empty((0, 3), np.int64)
        indices = self._indices(item["indices"], len(positions)) if "indices" in item else np.arange(len(positions))
        return positions, _triangles(indices, item.get("mode", 4))

    def primitives(self, mesh: int) -> list[dict[str, Any]]:
        """Return the primitives of a mesh."""
        found: list[dict[str, Any]] = self.item("meshes", mesh)["primitives"]
        return found

    def _positions(self, primitive: dict[str, Any]) -> NDArray[Any]:
        """Positions (V, 3), empty if a primitive has none."""
        if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
            raise Compressed("compressed with Draco")
        if "POSITION" not in primitive["attributes"]:
            return np.empty((0, 3), np.float32)
        return self.vectors(primitive["attributes"]["POSITION"], 3)

    def vectors(self, accessor: int, width: int) -> NDArray[Any]:
        """Return (N, width) `numbers` of an accessor. Raises DamagedFile for another shape."""
        found = self.numbers(accessor)
        if found.ndim != 2 or found.shape[1] != width:
            raise DamagedFile(f"accessor {accessor} does not contain vectors of {width}")
        return found

    def _indices(self, accessor: int, count: int) -> NDArray[np.int64]:
        """(N,) indices below `count`."""
        found = self.accessor(accessor)
        if found.ndim != 1 or found.dtype.kind != "u":
            raise DamagedFile(f"accessor {accessor} does not contain indices")
        if found.max() >= count:
            raise DamagedFile(f"index {int(found.max())} of {count} vertices")
        return found.astype(np.int64)

    def solid_arrays(self, mesh: int = 0) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return positions and triangles of a mesh with its seams merged.

        By EXT_mesh_manifold if the file has it, else by merging equal positions of all primitives. Outlines have no
        seams: theirs are returned as they are.
        """
        item = self.item("meshes", mesh)
        if outline_form(item) and len(item["primitives"]) == 1:
            return self.mesh_arrays(mesh)
        extension = item.get("extensions", {}).get("EXT_mesh_manifold")
        if extension is not None:
            primitive = extension["manifoldPrimitive"]
            positions = self._positions(primitive)
            return positions, _triangles(self._indices(primitive["indices"], len(positions)), 4)
        if not item["primitives"]:
            raise DamagedFile(f"meshes/{mesh} has no primitives")
        parts = [self.mesh_arrays(mesh, primitive) for primitive in range(len(item["primitives"]))]
        starts = np.cumsum([0, *(len(positions) for positions, _ in parts)])
        positions = np.concatenate([positions for positions, _ in parts])
        faces = np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)])
        return merged_by_position(positions, faces)

    def instances(self) -> list[tuple[int, NDArray[np.float64]]]:
        """Return the meshes of the default scene, each with its (4, 4) matrix scene_from_mesh."""
        nodes, found = self.items("nodes"), []
        scenes = self.items("scenes")
        below = {child for node in nodes for child in node.get("children", [])}
        scene = self.item("scenes", self.document.get("scene") or 0) if scenes else {}
        roots = scene.get("nodes", []) if scenes else set(range(len(nodes))) - below
        pending = [(index, np.eye(4)) for index in roots]
        visited: set[int] = set()
        while pending:
            index, above = pending.pop()
            if index in visited:
                raise DamagedFile(f"node {index} has two parents, or nodes form a cycle")
            visited.add(index)
            node = self.item("nodes", index)
            matrix = above @ local_matrix(node)
            if "mesh" in node:
                found.append((node["mesh"], matrix))
            pending += [(child, matrix) for child in node.get("children", [])]
        return found

    @property
    def outlines(self) -> dict[int, str]:
        """The meshes that are drawn contours, each with its form; see `exporters.gltf.outline`."""
        forms = {index: outline_form(mesh) for index, mesh in enumerate(self.items("meshes"))}
        return {index: form for index, form in forms.items() if form}

    def scene_vertices(self) -> NDArray[np.float64]:
        """Return all vertices (N, 3) float64 of the default scene, y-up: the ASSET frame of files by fig2mesh.

        Those of outlines are among them.
        """
        clouds = [np.empty((0, 3))]
        count = 0
        for mesh, matrix in self.instances():
            for primitive in self.primitives(mesh):
                vertices = self._positions(primitive)
                count = _counted(count, len(vertices))
                self._charge(vertices.size)
                clouds.append(_moved(vertices, matrix))
        return np.concatenate(clouds)

    def scene_solids(self) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Return positions and triangles of each mesh instance of the default scene but outlines, seams merged."""
        outlines = self.outlines
        return self._solids([each for each in self.instances() if each[0] not in outlines])

    def scene_outlines(self) -> list[tuple[str, NDArray[Any], NDArray[Any]]]:
        """Return form, positions and triangles of each outline in the default scene."""
        forms = self.outlines
        found = [each for each in self.instances() if each[0] in forms]
        return [(forms[mesh], *arrays) for (mesh, _), arrays in zip(found, self._solids(found), strict=True)]

    def _solids(self, instances: list[tuple[int, NDArray[np.float64]]]) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        solids = []
        count = 0
        known: dict[int, tuple[NDArray[Any], NDArray[Any]]] = {}
        for mesh, matrix in instances:
            vertices, faces = known[mesh] = known[mesh] if mesh in known else self.solid_arrays(mesh)
            count = _counted(count, max(len(vertices), len(faces)))
            self._charge(vertices.size + faces.size)
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
            solids.append((_moved(vertices, matrix), faces[:, ::-1] if mirrored else faces))
        return solids


def _counted(count: int, more: int) -> int:
    if count + more > MAX_SCENE_VERTICES:
        raise NotDecoded(f"more than {MAX_SCENE_VERTICES / 1e6:.0f} million vertices or triangles in the scene")
    return count + more


def _moved(vertices: NDArray[Any], matrix: NDArray[np.float64]) -> NDArray[Any]:
    if np.array_equal(matrix, np.eye(4)):
        return vertices  # bitwise unchanged
    return vertices.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def _triangles(indices: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Convert indices to triangles (F, 3) by the `mode` of the primitive; empty for points and lines."""
    if mode == 4 and len(indices) % 3:
        raise DamagedFile(f"{len(indices)} indices are not a multiple of 3")
    if mode == 4:
        return indices.reshape(-1, 3)
    if mode not in (5, 6) or len(indices) < 3:
        return np.empty((0, 3), np.int64)
    if mode == 6:
        return np.stack([np.full(len(indices) - 2, indices[0]), indices[1:-1], indices[2:]], axis=1)
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    faces[1::2, [1, 2]] = faces[1::2, [2, 1]]  # every other triangle of a strip runs the other way
    return faces


def _dtype(component: int) -> np.dtype[Any]:
    if component not in DTYPES:
        raise DamagedFile(f"unknown componentType {component}")
    return np.dtype(DTYPES[component])


def local_matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """(4, 4) matrix from a node to its parent; its quaternion must be a unit quaternion."""
    if "matrix" in node:
        return np.asarray(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= node.get("scale", (1.0, 1.0, 1.0))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix


def _resource(path: Path, uri: str) -> bytes:
    if uri.startswith("data:"):
        import base64

        with decoding("invalid base64 in a data URI", ValueError):
            return base64.b64decode(uri.partition(",")[2])
    try:
        return read_bytes(path.parent / unquote(uri), MAX_BYTES)
    except OSError as error:
        raise DamagedFile(f"{uri[:80]} cannot be read ({error.strerror})") from error
    except DamagedFile as error:
        raise DamagedFile(f"{uri[:80]}: {error}") from error


def read_gltf(path: Path | str) -> Gltf:
    """Read a .glb or .gltf file.

    Raises ExportError for files that are missing, truncated or not glTF; other problems in a document are reported by
    `exporters.validate`.
    """
    path = Path(path)
    try:
        data = read_bytes(path, MAX_BYTES)
        text, binary = (data, None) if path.suffix.lower() == ".gltf" else split_glb(data)
        return _gltf(text, binary, path)
    except OSError as error:
        raise ExportError(path, f"cannot be read ({error.strerror})", "check the path") from error
    except DamagedFile as error:
        raise ExportError(path, f"not a valid glTF file ({error})", "write it again") from error


def open_glb(path: Path) -> Gltf:
    """Map a .glb file into memory: its JSON is parsed, its buffer read on demand by `view` and `accessor`.

    `view` gives memoryviews, valid as long as the record. Raises ExportError for files that are not binary glTF.
    """
    try:
        return glb_of(mapped(path), path)
    except OSError as error:
        raise ExportError(path, f"cannot be read ({error.strerror})", "check the path") from error
    except DamagedFile as error:
        raise ExportError(path, f"not a valid glTF file ({error})", "check the path") from error


def glb_of(data: Bytes, path: Path) -> Gltf:
    """Parse the bytes of a .glb file; path : for messages. Raises ExportError for anything but binary glTF."""
    try:
        gltf = _gltf(*split_glb(data), path)
        if any("uri" in item for item in gltf.items("buffers")):
            raise DamagedFile("its buffers are in other files")
        return gltf
    except DamagedFile as error:
        raise ExportError(path, f"not a valid glTF file ({error})", "give a .glb") from error


def _gltf(text: Bytes, binary: Bytes | None, path: Path) -> Gltf:
    document = parse_json(text)
    check_shape(document, DOCUMENT)
    lost = drop_lost(document)
    check_shape(document.get("extensions", {}), RTC, "/extensions")
    buffers = []
    for index, item in enumerate(document.get("buffers", [])):
        if "uri" not in item and any(item.get("extensions", {}).get(name, {}).get("fallback") for name in MESHOPT):
            buffers.append(b"")  # placeholder for the decompressed data
            continue
        data = _resource(path, item["uri"]) if "uri" in item else binary
        if data is None or len(data) < item["byteLength"]:
            raise DamagedFile(f"buffer {index} has {len(data or b'')} bytes, expected {item['byteLength']}")
        buffers.append(cast(bytes, data))
    return Gltf(document, tuple(buffers), path, lost)
