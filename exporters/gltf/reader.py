"""glTF files back into arrays, for checking and inspecting what was written.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from exporters.errors import DAMAGE, ExportError
from exporters.gltf import meshopt
from exporters.solid import merged_by_position
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json, read_bytes

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MAX_BYTES = 1 << 30
"""Largest file, or file beside it, that is read: 3D Tiles' clients give up at a tenth."""

FREE_NUMBERS, NUMBERS_A_BYTE = 1 << 22, 64
"""How many numbers accessors may give: so many, and so many more for each byte of the buffers. Sound files are read
some ten times over; a hundred thousand accessors of the same bytes would take hours. What nodes show counts as well."""

MAX_SCENE_VERTICES = 20_000_000
"""Of all instances of all meshes: nodes may show one mesh a million times."""

WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}


class NotReadHere(ValueError):
    """Sound data in a form that is not decoded here, or whose decoder is not installed."""


@dataclass(frozen=True)
class Gltf:
    """A glTF file: `document`, the JSON; `buffers`, the bytes; `path`, where it came from."""

    document: dict[str, Any]
    buffers: tuple[bytes, ...]
    path: Path
    _given: list[int] = field(default_factory=lambda: [0], compare=False, repr=False)

    def items(self, kind: str) -> list[dict[str, Any]]:
        """A top-level array of the document, empty if absent."""
        found = self.document.get(kind, [])
        return found if isinstance(found, list) else []

    def view(self, index: int) -> bytes:
        """The bytes of a buffer view, decompressed if they are compressed.

        Raises ValueError where it lies outside its buffer, NotReadHere without the decoder.
        """
        view = self.items("bufferViews")[index]
        for name in MESHOPT:
            if name in view.get("extensions", {}):
                packed = view["extensions"][name]
                self._charge(int(packed["count"]) * int(packed["byteStride"]))
                try:
                    return meshopt.decode(self._span(packed, index), packed)
                except ExportError as error:
                    raise NotReadHere(f"bufferView {index}: {error.finding}; {error.remedy}") from error
        return self._span(view, index)

    def _span(self, view: dict[str, Any], index: int) -> bytes:
        data: bytes = self.buffers[view["buffer"]]
        begin, length = int(view.get("byteOffset", 0)), int(view["byteLength"])
        if begin < 0 or begin + length > len(data):
            raise ValueError(f"bufferView {index} ends at byte {begin + length} of {len(data)}")
        return data[begin : begin + length]

    def _charge(self, numbers: int) -> None:
        """Count what is asked of the file. Raises NotReadHere beyond `FREE_NUMBERS` and `NUMBERS_A_BYTE`."""
        if numbers < 0:
            raise ValueError(f"a negative number of elements, {numbers}")
        self._given[0] += numbers
        if self._given[0] > FREE_NUMBERS + NUMBERS_A_BYTE * sum(map(len, self.buffers)):
            raise NotReadHere("its accessors hold far more than the file does")

    def accessor(self, index: int) -> NDArray[Any]:
        """An accessor's values, (N,) or (N, width), sparse replacements applied.

        Raises ValueError out of bounds, NotReadHere for more than a file of this size has to say.
        """
        accessor = self.items("accessors")[index]
        dtype = np.dtype(DTYPES[accessor["componentType"]])
        width, count = WIDTHS[accessor["type"]], accessor["count"]
        self._charge(int(count) * width)
        if "bufferView" in accessor:
            view = self.items("bufferViews")[accessor["bufferView"]]
            values = self._strided(
                accessor["bufferView"], accessor.get("byteOffset", 0), dtype, count, width, view.get("byteStride")
            )
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            self._charge(int(sparse["count"]) * width)
            places, replacements = sparse["indices"], sparse["values"]
            index_type = np.dtype(DTYPES[places["componentType"]])
            rows = self._strided(
                places["bufferView"], places.get("byteOffset", 0), index_type, sparse["count"], 1, None
            )
            values = values.copy()
            values[rows[:, 0]] = self._strided(
                replacements["bufferView"], replacements.get("byteOffset", 0), dtype, sparse["count"], width, None
            )
        return values[:, 0] if width == 1 else values

    def numbers(self, index: int) -> NDArray[Any]:
        """An accessor's values as floats where it says that its integers are normalised, else as they are."""
        values = self.accessor(index)
        if not self.items("accessors")[index].get("normalized") or values.dtype.kind == "f":
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
            raise ValueError(f"rows of {row} bytes every {step}")
        end = offset + step * (count - 1) + row
        if count < 1 or offset < 0 or end > len(data):
            raise ValueError(f"{count} elements end at byte {end} of the {len(data)} in bufferView {view}")
        return np.ndarray((count, width), dtype, data, offset, (step, dtype.itemsize))

    def image(self, index: int) -> bytes:
        """The bytes of an image file, embedded or beside the document. Raises ValueError where there are none."""
        item = self.items("images")[index]
        if "bufferView" in item:
            return self.view(item["bufferView"])
        if "uri" not in item:
            raise ValueError(f"image {index} has neither bufferView nor uri")
        return _resource(self.path, item["uri"])

    def mesh_arrays(self, mesh: int = 0, primitive: int = 0) -> tuple[NDArray[Any], NDArray[np.int64]]:
        """Positions (V, 3) and triangles (F, 3) of one primitive, in the frame of its mesh.

        Strips and fans become triangles; points and lines have none. Raises NotReadHere for Draco's compression.
        """
        item = self.items("meshes")[mesh]["primitives"][primitive]
        if "KHR_draco_mesh_compression" in item.get("extensions", {}):
            raise NotReadHere("compressed with Draco")
        if "POSITION" not in item["attributes"]:
            return np.empty((0, 3), np.float32), np.empty((0, 3), np.int64)
        positions = self.numbers(item["attributes"]["POSITION"])
        indices = self.accessor(item["indices"]) if "indices" in item else np.arange(len(positions))
        return positions, _triangles(indices.astype(np.int64), item.get("mode", 4))

    def solid_arrays(self, mesh: int = 0) -> tuple[NDArray[Any], NDArray[Any]]:
        """Positions and triangles of a mesh with its seams undone.

        By EXT_mesh_manifold where the file has it, else by merging equal positions of all primitives.
        """
        item = self.items("meshes")[mesh]
        extension = item.get("extensions", {}).get("EXT_mesh_manifold")
        if extension is not None:
            primitive = extension["manifoldPrimitive"]
            indices = self.accessor(primitive["indices"]).astype(np.int64)
            return self.numbers(primitive["attributes"]["POSITION"]), indices.reshape(-1, 3)
        parts = [self.mesh_arrays(mesh, primitive) for primitive in range(len(item["primitives"]))]
        starts = np.cumsum([0, *(len(positions) for positions, _ in parts)])
        positions = np.concatenate([positions for positions, _ in parts])
        faces = np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)])
        return merged_by_position(positions, faces)

    def instances(self) -> list[tuple[int, NDArray[np.float64]]]:
        """The meshes of the default scene, each with its (4, 4) matrix scene_from_mesh."""
        nodes, found = self.items("nodes"), []
        scenes = self.items("scenes")
        below = {child for node in nodes for child in node.get("children", [])}
        roots = scenes[self.document.get("scene", 0)].get("nodes", []) if scenes else set(range(len(nodes))) - below
        pending = [(index, np.eye(4)) for index in roots]
        met: set[int] = set()
        while pending:
            index, above = pending.pop()
            if index in met:
                raise ValueError(f"node {index} has two parents, or nodes form a cycle")
            met.add(index)
            matrix = above @ _local_matrix(nodes[index])
            if "mesh" in nodes[index]:
                found.append((int(nodes[index]["mesh"]), matrix))
            pending += [(child, matrix) for child in nodes[index].get("children", [])]
        return found

    def scene_vertices(self) -> NDArray[np.float64]:
        """All vertices (N, 3) float64 of the default scene, y-up: the ASSET frame of files of ours."""
        clouds = [np.empty((0, 3))]
        count = 0
        for mesh, matrix in self.instances():
            for primitive in range(len(self.items("meshes")[mesh]["primitives"])):
                vertices = self.mesh_arrays(mesh, primitive)[0]
                count = _counted(count, len(vertices))
                self._charge(vertices.size)
                clouds.append(_moved(vertices, matrix))
        return np.concatenate(clouds)

    def scene_solids(self) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Positions and triangles of each mesh of the default scene where it stands there, its seams undone."""
        solids = []
        count = 0
        known: dict[int, tuple[NDArray[Any], NDArray[Any]]] = {}
        for mesh, matrix in self.instances():
            vertices, faces = known[mesh] = known[mesh] if mesh in known else self.solid_arrays(mesh)
            count = _counted(count, max(len(vertices), len(faces)))
            self._charge(vertices.size + faces.size)
            mirrored = np.linalg.det(matrix[:3, :3]) < 0
            solids.append((_moved(vertices, matrix), faces[:, ::-1] if mirrored else faces))
        return solids


def _counted(count: int, more: int) -> int:
    if count + more > MAX_SCENE_VERTICES:
        raise NotReadHere(f"more than {MAX_SCENE_VERTICES / 1e6:.0f} million vertices or triangles in its scene")
    return count + more


def _moved(vertices: NDArray[Any], matrix: NDArray[np.float64]) -> NDArray[Any]:
    if np.array_equal(matrix, np.eye(4)):
        return vertices  # as they are in the file, to the bit
    return vertices.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def _triangles(indices: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Corners (F, 3) of triangles, a strip or a fan, by the `mode` of the primitive; none for points and lines."""
    if mode == 4:
        return indices.reshape(-1, 3)
    if mode not in (5, 6) or len(indices) < 3:
        return np.empty((0, 3), np.int64)
    if mode == 6:
        return np.stack([np.full(len(indices) - 2, indices[0]), indices[1:-1], indices[2:]], axis=1)
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    faces[1::2, [1, 2]] = faces[1::2, [2, 1]]  # every other triangle of a strip runs the other way
    return faces


def _local_matrix(node: dict[str, Any]) -> NDArray[np.float64]:
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

        return base64.b64decode(uri.partition(",")[2])
    try:
        return read_bytes(path.parent / unquote(uri), MAX_BYTES)
    except OSError as error:
        raise ValueError(f"{uri[:80]} is not there ({error.strerror})") from error
    except DamagedFile as error:
        raise DamagedFile(f"{uri[:80]}: {error}") from error


def read_gltf(path: Path | str) -> Gltf:
    """Open a .glb or .gltf file.

    Raises ExportError for files that are not there, cut off or no glTF at all; what is wrong inside a document is
    for `exporters.validate` to say.
    """
    path = Path(path)
    try:
        data = read_bytes(path, MAX_BYTES)
        if path.suffix.lower() == ".gltf":
            return _with_buffers(parse_json(data), None, path)
        text, binary = _chunks(data)
        return _with_buffers(parse_json(text), binary, path)
    except OSError as error:
        raise ExportError(path, f"no readable glTF ({error.strerror})", "check the name") from error
    except DAMAGE as error:
        raise ExportError(path, f"no readable glTF ({error})", "write it again") from error


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    magic, version, length = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2:
        raise ValueError(f"starts with {magic!r} version {version}, expected b'glTF' version 2")
    if length != len(data):
        raise ValueError(f"header says {length} bytes, file has {len(data)}")
    chunks: list[bytes] = []
    place = 12
    for kind in (b"JSON", b"BIN\0"):
        if place == length:
            break
        size, found = struct.unpack_from("<I4s", data, place)
        if found != kind or size % 4 or place + 8 + size > length:
            raise ValueError(f"chunk at byte {place} is {found!r} of {size} bytes, expected {kind!r} within the file")
        chunks.append(data[place + 8 : place + 8 + size])
        place += 8 + size
    return chunks[0], chunks[1] if len(chunks) > 1 else None


def _with_buffers(document: dict[str, Any], binary: bytes | None, path: Path) -> Gltf:
    if not isinstance(document, dict):
        raise ValueError("the document is not a JSON object")
    buffers = []
    for index, item in enumerate(document.get("buffers", [])):
        if "uri" not in item and any(item.get("extensions", {}).get(name, {}).get("fallback") for name in MESHOPT):
            buffers.append(b"")  # stands for what the compressed views hold
            continue
        data = _resource(path, item["uri"]) if "uri" in item else binary
        if data is None or len(data) < item["byteLength"]:
            raise ValueError(f"buffer {index} has {len(data or b'')} bytes, expected {item['byteLength']}")
        buffers.append(data)
    return Gltf(document, tuple(buffers), path)
