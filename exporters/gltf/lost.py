"""Extensions of glTF that point nowhere: what is left of them by tools that rewrite files without knowing them.

gltf-pipeline, for instance, removes accessors that only an unknown extension refers to, and keeps the extension. The
picture is whole, so such a file is still read, as if it had no such extension; what was lost is reported.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from exporters.gltf.shape import FEATURES, MANIFOLD, SURFACE_METADATA, TABLE_METADATA
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_shape import check_shape

MESH_FEATURES, MESH_MANIFOLD, METADATA = "EXT_mesh_features", "EXT_mesh_manifold", "EXT_structural_metadata"

REASON = "dropped by a tool that does not know it"

Item = dict[str, Any]


def drop_lost(document: Item) -> tuple[str, ...]:
    """Remove from a document the extensions of figures that are damaged or point nowhere; returns a line for each.

    document : of the shape `DOCUMENT`, changed here
    """
    return tuple(_lost(document))


def _lost(document: Item) -> Iterator[str]:
    yield from _not_objects(document, "the file")
    yield from _checked(document, METADATA, "the file", lambda found: _metadata(document, found))
    surfaces = len(document.get("extensions", {}).get(METADATA, {}).get("propertyTextures", []))
    tables = len(document.get("extensions", {}).get(METADATA, {}).get("propertyTables", []))
    for number, mesh in enumerate(document.get("meshes", [])):
        where = f"meshes/{number}"
        yield from _not_objects(mesh, where)
        yield from _checked(mesh, MESH_MANIFOLD, where, lambda found, mesh=mesh: _manifold(document, mesh, found))
        for index, primitive in enumerate(mesh["primitives"]):
            here = f"{where}/primitives/{index}"
            yield from _not_objects(primitive, here)
            yield from _checked(primitive, MESH_FEATURES, here, lambda found, item=primitive: _features(item, found))
            yield from _checked(primitive, METADATA, here, lambda found: _surface(found, surfaces))
            if not tables:
                for feature in primitive.get("extensions", {}).get(MESH_FEATURES, {}).get("featureIds", []):
                    if feature.pop("propertyTable", None) is not None:
                        yield f"{MESH_FEATURES} of {here} names a property table, and there is none; {REASON}"


def _checked(item: Item, name: str, where: str, check: Any) -> Iterator[str]:
    """Remove an extension of an item if the check of it raises DamagedFile."""
    if name not in item.get("extensions", {}):
        return
    try:
        check(item["extensions"][name])
    except DamagedFile as error:
        del item["extensions"][name]
        yield f"{name} of {where} {error}; {REASON}"


def _not_objects(item: Item, where: str) -> Iterator[str]:
    if not isinstance(item.get("extensions", {}), dict):
        del item["extensions"]
        yield f"the extensions of {where} are not an object and are not read"


def _shaped(value: Any, shape: Any) -> None:
    try:
        check_shape(value, shape)
    except DamagedFile as error:
        raise DamagedFile(f"is damaged ({error})") from error


def _named(document: Item, kind: str, index: int) -> Item:
    items: list[Item] = document.get(kind, [])
    if index >= len(items):
        raise DamagedFile(f"names {kind.removesuffix('s')} {index} of {len(items)}")
    return items[index]


def _metadata(document: Item, found: Any) -> None:
    _shaped(found, TABLE_METADATA)
    classes = found.get("schema", {}).get("classes", {})
    for table in found.get("propertyTables", []):
        for name, column in table.get("properties", {}).items():
            for key in ("values", "stringOffsets", "arrayOffsets"):
                if key in column:
                    _named(document, "bufferViews", column[key])
            if name not in classes.get(table["class"], {}).get("properties", {}):
                raise DamagedFile(f"has a property {name[:40]} that its schema does not describe")
    for holder in found.get("propertyTextures", []):
        for texture in holder.get("properties", {}).values():
            if "index" in texture:
                _named(document, "textures", texture["index"])


def _manifold(document: Item, mesh: Item, found: Any) -> None:
    _shaped(found, MANIFOLD)
    solid = found["manifoldPrimitive"]
    indices = _named(document, "accessors", solid["indices"])
    positions = [_named(document, "accessors", index) for index in solid["attributes"].values()]
    count = len(document["accessors"])
    for key in ("mergeIndices", "mergeValues"):
        if key in found:
            _named(document, "accessors", found[key])
    known = [each["indices"] for each in mesh["primitives"] if each.get("indices", count) < count]
    corners = sum(document["accessors"][index]["count"] for index in known)
    other = indices["type"] != "SCALAR" or (corners and indices["count"] != corners)
    if other or "POSITION" not in solid["attributes"] or any(each["type"] != "VEC3" for each in positions):
        raise DamagedFile(f"names accessor {solid['indices']}, which holds something else")


def _features(primitive: Item, found: Any) -> None:
    _shaped(found, FEATURES)
    for feature in found.get("featureIds", []):
        name = f"_FEATURE_ID_{feature.get('attribute')}"
        if "attribute" in feature and name not in primitive["attributes"]:
            raise DamagedFile(f"names the attribute {name}, which does not exist")


def _surface(found: Any, textures: int) -> None:
    _shaped(found, SURFACE_METADATA)
    for index in found.get("propertyTextures", []):
        if index >= textures:
            raise DamagedFile(f"names property texture {index} of {textures}")
