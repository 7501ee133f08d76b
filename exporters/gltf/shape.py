"""Shape of glTF documents, which `exporters.gltf.reader` checks before using them.

Only members that are used here are included; the Khronos validator checks all rules. Extras may be anything. The
extensions of figures are checked apart, by `exporters.gltf.lost`: a file is also read without them.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#properties-reference
"""

from __future__ import annotations

from typing import Any

from georef.untrusted.json_shape import INDEX, Nullable, Numbers, Required, Values

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_SPAN = {"buffer": Required(INDEX), "byteOffset": INDEX, "byteLength": Required(INDEX), "byteStride": INDEX}
_PACKED = _SPAN | {"byteStride": Required(INDEX), "count": Required(INDEX), "mode": Required(str), "filter": str}
_PART_OF_VIEW = {"bufferView": Required(INDEX), "byteOffset": INDEX}

_ACCESSOR = {
    "bufferView": INDEX,
    "byteOffset": INDEX,
    "componentType": Required(INDEX),
    "count": Required(INDEX),
    "type": Required(str),
    "normalized": bool,
    "min": Numbers(),
    "max": Numbers(),
    "sparse": {
        "count": Required(INDEX),
        "indices": Required(_PART_OF_VIEW | {"componentType": Required(INDEX)}),
        "values": Required(_PART_OF_VIEW),
    },
}

_FEATURE_IDS = {"attribute": INDEX, "featureCount": Required(INDEX), "propertyTable": INDEX}

_PRIMITIVE = {
    "attributes": Required(Values(INDEX)),
    "indices": INDEX,
    "material": INDEX,
    "mode": INDEX,
}

FEATURES = {"featureIds": [_FEATURE_IDS]}
"""EXT_mesh_features of a primitive."""

MANIFOLD = {
    "manifoldPrimitive": Required({"indices": Required(INDEX), "attributes": Required(Values(INDEX))}),
    "mergeIndices": INDEX,
    "mergeValues": INDEX,
}
"""EXT_mesh_manifold of a mesh."""

_COLUMN = {"values": Required(INDEX), "stringOffsets": INDEX, "arrayOffsets": INDEX}

TABLE_METADATA = {
    "schema": {
        "classes": Values({"properties": Values({"type": Required(str), "componentType": str, "array": bool})}),
    },
    "propertyTables": [{"class": Required(str), "count": Required(INDEX), "properties": Values(_COLUMN)}],
    "propertyTextures": [{"class": Required(str), "properties": Values({"index": INDEX})}],
}
"""EXT_structural_metadata of a document."""

SURFACE_METADATA = {"propertyTextures": [INDEX]}
"""EXT_structural_metadata of a primitive."""

_TARGET = {"node": INDEX, "path": Required(str)}

DOCUMENT: dict[str, Any] = {
    "asset": {"copyright": str},
    "extensionsUsed": [str],
    "extensionsRequired": [str],
    "scene": Nullable(INDEX),
    "scenes": [{"nodes": [INDEX]}],
    "nodes": [
        {
            "name": str,
            "children": [INDEX],
            "mesh": INDEX,
            "skin": INDEX,
            "matrix": Numbers(16),
            "translation": Numbers(3),
            "rotation": Numbers(4),
            "scale": Numbers(3),
        }
    ],
    "meshes": [{"primitives": Required([_PRIMITIVE])}],
    "accessors": [_ACCESSOR],
    "bufferViews": [_SPAN | {"extensions": dict.fromkeys(MESHOPT, _PACKED)}],
    "buffers": [
        {"byteLength": Required(INDEX), "uri": str, "extensions": {name: {"fallback": bool} for name in MESHOPT}}
    ],
    "images": [{"bufferView": INDEX, "uri": str, "mimeType": str}],
    "textures": [{"source": INDEX, "sampler": INDEX}],
    "samplers": [dict],
    "materials": [{"name": str, "pbrMetallicRoughness": {"baseColorFactor": Numbers(4)}, "doubleSided": bool}],
    "skins": [{"inverseBindMatrices": INDEX, "joints": Required([INDEX])}],
    "animations": [
        {
            "name": str,
            "channels": Required([{"sampler": Required(INDEX), "target": Required(_TARGET)}]),
            "samplers": Required([{"input": Required(INDEX), "output": Required(INDEX), "interpolation": str}]),
        }
    ],
}

RTC = {"CESIUM_RTC": {"center": Required(Numbers(3))}}
"""Extensions of the document without which its vertices are elsewhere."""
