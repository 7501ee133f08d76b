"""Builder of the JSON document of a glTF file and its single buffer.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html

Written with `json`: the format is small, and the bytes are under control (an object model such as pygltflib's takes
0.2 s to import and decides the order of keys).
"""

from __future__ import annotations

import json
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from exporters.gltf.container import join_glb

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}

Mode = Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]


def bounds(values: NDArray[Any]) -> dict[str, Any]:
    """Members `min` and `max` of the accessor of (N, W) values."""
    return {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}


def index_array(faces: NDArray[np.int32], vertices: int) -> NDArray[Any]:
    """Convert triangles (F, 3) to (3 F,) indices, 16 bits wide where the number of vertices allows it."""
    # 65535 itself is the restart index and must not occur.
    return faces.reshape(-1).astype(np.uint16 if vertices <= 65535 else np.uint32)


class Document:
    """A document under construction.

    json : the document; `used` and `required`: names of its extensions
    compressed : whether arrays are stored with EXT_meshopt_compression; their uncompressed form then exists as an
        empty fallback buffer, as the extension requires
    """

    def __init__(self, compressed: bool = False) -> None:
        self.json: dict[str, Any] = {}
        self.chunks: list[bytes] = []
        self.length = 0
        self.fallback = 0
        self.compressed = compressed
        self.used: set[str] = set()
        self.required: set[str] = set()

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Append to a top-level array; returns the index."""
        items: list[dict[str, Any]] = self.json.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def require(self, *extensions: str) -> None:
        """Declare extensions as required."""
        self.used |= set(extensions)
        self.required |= set(extensions)

    def view(self, name: str, data: bytes, target: int | None = None) -> int:
        """Append bytes unchanged; returns the index of their bufferView."""
        view: dict[str, Any] = {"name": name, "buffer": 0, "byteOffset": self._append(data), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        return self.add("bufferViews", view)

    def accessor(self, name: str, array: NDArray[Any], target: int | None, mode: Mode, **more: Any) -> int:
        """Append an array, (N,) or (N, width), as one accessor in a bufferView of its own.

        target : ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER or None; mode : of meshopt, if compressed
        """
        little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        rows = little.reshape(len(little), -1)
        size = rows.shape[1] * rows.itemsize
        if target == ARRAY_BUFFER and size % 4:
            # Rows of vertex attributes begin at multiples of four bytes.
            padded = np.zeros((len(rows), size + -size % 4), np.uint8)
            padded[:, :size] = rows.view(np.uint8)
            view = self._packed(name, padded, target, mode, stride=padded.shape[1])
        else:
            view = self._packed(name, rows, target, mode)
        return self.accessor_at(name, little, view, **more)

    def octahedral(self, name: str, normals: NDArray[np.float32]) -> int:
        """Append unit vectors (N, 3), with the octahedral filter of meshopt, as an accessor of 16-bit integers."""
        from exporters.gltf.meshopt import octahedral

        rows = octahedral(normals)
        view = self._packed(name, rows, ARRAY_BUFFER, "ATTRIBUTES", rows.shape[1], "OCTAHEDRAL")
        return self.accessor_at(name, np.empty((len(rows), 3), np.int16), view, normalized=True)

    def accessor_at(self, name: str, array: NDArray[Any], view: int, **more: Any) -> int:
        """Append an accessor of the array that lies at the start of a bufferView."""
        columns = 1 if array.ndim == 1 else array.shape[1]
        return self.add(
            "accessors",
            {
                "name": name,
                "bufferView": view,
                "componentType": COMPONENT_TYPES[array.dtype.str[1:]],
                "count": len(array),
                "type": "SCALAR" if columns == 1 else f"VEC{columns}",
                **more,
            },
        )

    def glb(self) -> bytes:
        """Return the document and its buffer as one binary file."""
        binary = b"".join(self.chunks)
        binary += bytes(-len(binary) % 4)
        text = self.text({"byteLength": len(binary)})
        text += b" " * (-len(text) % 4)
        return join_glb(text, binary)

    def text(self, buffer: dict[str, Any]) -> bytes:
        """Return the document as JSON; buffer : its entry for the buffer."""
        head: dict[str, Any] = {"asset": self.json["asset"]}
        if self.used:
            head["extensionsUsed"] = sorted(self.used)
        if self.required:
            head["extensionsRequired"] = sorted(self.required)
        buffers = [buffer]
        if self.fallback:
            extensions = {"EXT_meshopt_compression": {"fallback": True}}
            buffers.append({"byteLength": self.fallback, "extensions": extensions})
        body = {key: value for key, value in self.json.items() if key != "asset"}
        return json.dumps(
            head | body | {"buffers": buffers}, ensure_ascii=False, allow_nan=False, separators=(",", ":")
        ).encode()

    def _append(self, data: bytes) -> int:
        # Alignment to eight bytes suits every component type, and property tables require it.
        padding = -self.length % 8
        self.chunks += [bytes(padding), data]
        self.length += padding + len(data)
        return self.length - len(data)

    def _packed(
        self, name: str, rows: NDArray[Any], target: int | None, mode: Mode, stride: int = 0, filtered: str = ""
    ) -> int:
        size = rows.shape[1] * rows.itemsize
        more = {"byteStride": stride} if stride else {}
        if not self.compressed:
            view = self.view(name, rows.tobytes(), target)
            self.json["bufferViews"][view] |= more
            return view
        from exporters.gltf.meshopt import encode

        data = encode(rows, mode)
        self.require("EXT_meshopt_compression")
        offset = self.fallback + -self.fallback % 8
        self.fallback = offset + rows.nbytes
        packed = {
            "buffer": 0,
            "byteOffset": self._append(data),
            "byteLength": len(data),
            "byteStride": size,
            "count": len(rows),
            "mode": mode,
            **({"filter": filtered} if filtered else {}),
        }
        view_item: dict[str, Any] = {
            "name": name,
            "buffer": 1,
            "byteOffset": offset,
            "byteLength": rows.nbytes,
            **more,
        }
        if target is not None:
            view_item["target"] = target
        return self.add("bufferViews", view_item | {"extensions": {"EXT_meshopt_compression": packed}})
