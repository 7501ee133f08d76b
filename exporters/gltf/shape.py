"""What the readers of glTF take for granted of a document, which `exporters.gltf.reader` checks before.

Only members that are used here are named; the full rules are for the Khronos validator. Extras may be anything.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html#properties-reference
"""

from __future__ import annotations

from typing import Any

from georef.untrusted.json_shape import WHOLE, Needed, Nullable, Numbers, Values

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")

_SPAN = {"buffer": Needed(WHOLE), "byteOffset": WHOLE, "byteLength": Needed(WHOLE), "byteStride": WHOLE}
_PACKED = _SPAN | {"byteStride": Needed(WHOLE), "count": Needed(WHOLE), "mode": Needed(str), "filter": str}
_PART_OF_VIEW = {"bufferView": Needed(WHOLE), "byteOffset": WHOLE}

_ACCESSOR = {
    "bufferView": WHOLE,
    "byteOffset": WHOLE,
    "componentType": Needed(WHOLE),
    "count": Needed(WHOLE),
    "type": Needed(str),
    "normalized": bool,
    "min": Numbers(),
    "max": Numbers(),
    "sparse": {
        "count": Needed(WHOLE),
        "indices": Needed(_PART_OF_VIEW | {"componentType": Needed(WHOLE)}),
        "values": Needed(_PART_OF_VIEW),
    },
}

_FEATURE_IDS = {"attribute": WHOLE, "featureCount": Needed(WHOLE), "propertyTable": WHOLE}

_PRIMITIVE = {
    "attributes": Needed(Values(WHOLE)),
    "indices": WHOLE,
    "material": WHOLE,
    "mode": WHOLE,
    "extensions": {"EXT_mesh_features": {"featureIds": [_FEATURE_IDS]}},
}

_MANIFOLD = {
    "manifoldPrimitive": Needed({"indices": Needed(WHOLE), "attributes": Needed(Values(WHOLE))}),
}

_COLUMN = {"values": Needed(WHOLE), "stringOffsets": WHOLE, "arrayOffsets": WHOLE}

_STRUCTURAL_METADATA = {
    "schema": {
        "classes": Values({"properties": Values({"type": Needed(str), "componentType": str, "array": bool})}),
    },
    "propertyTables": [{"class": Needed(str), "count": Needed(WHOLE), "properties": Values(_COLUMN)}],
    "propertyTextures": [{"class": Needed(str), "properties": Values({"index": WHOLE})}],
}

DOCUMENT: dict[str, Any] = {
    "asset": {"copyright": str},
    "extensionsUsed": [str],
    "extensionsRequired": [str],
    "scene": Nullable(WHOLE),
    "scenes": [{"nodes": [WHOLE]}],
    "nodes": [
        {
            "name": str,
            "children": [WHOLE],
            "mesh": WHOLE,
            "skin": WHOLE,
            "matrix": Numbers(16),
            "translation": Numbers(3),
            "rotation": Numbers(4),
            "scale": Numbers(3),
        }
    ],
    "meshes": [{"primitives": Needed([_PRIMITIVE]), "extensions": {"EXT_mesh_manifold": _MANIFOLD}}],
    "accessors": [_ACCESSOR],
    "bufferViews": [_SPAN | {"extensions": dict.fromkeys(MESHOPT, _PACKED)}],
    "buffers": [
        {"byteLength": Needed(WHOLE), "uri": str, "extensions": {name: {"fallback": bool} for name in MESHOPT}}
    ],
    "images": [{"bufferView": WHOLE, "uri": str, "mimeType": str}],
    "textures": [{"source": WHOLE, "sampler": WHOLE}],
    "samplers": [dict],
    "materials": [{"name": str, "pbrMetallicRoughness": {"baseColorFactor": Numbers(4)}}],
    "skins": [{"inverseBindMatrices": WHOLE, "joints": Needed([WHOLE])}],
    "animations": [
        {
            "name": str,
            "channels": Needed([{"sampler": Needed(WHOLE), "target": Needed({"node": WHOLE, "path": Needed(str)})}]),
            "samplers": Needed([{"input": Needed(WHOLE), "output": Needed(WHOLE), "interpolation": str}]),
        }
    ],
    "extensions": {"EXT_structural_metadata": _STRUCTURAL_METADATA, "CESIUM_RTC": {"center": Needed(Numbers(3))}},
}
