"""Checks of metadata of 3D Tiles against their schema.

https://github.com/CesiumGS/3d-tiles/tree/main/specification/Metadata
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from exporters.errors import ExportError
from exporters.findings import Finding
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import read_json
from georef.untrusted.json_shape import INDEX, Required, Values, check_shape

COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

_PROPERTY = {"type": str, "componentType": str, "array": bool, "count": INDEX, "required": bool, "enumType": str}

SCHEMA = {
    "classes": Values({"properties": Values(_PROPERTY)}),
    "enums": Values({"values": [{"name": str}]}),
}
"""Shape of the used members of a schema."""


def read_schema(document: dict[str, Any], path: Path) -> tuple[dict[str, Any] | None, list[Finding]]:
    """Read the schema of a tileset, embedded or in a file, None without one, and check it."""
    name = path.name
    schema = document.get("schema")
    if schema is None and "schemaUri" in document:
        uri = str(document["schemaUri"])
        if "://" in uri:
            return None, [Finding("info", "NOT_CHECKED", f"the schema {uri} is remote and not checked", name)]
        try:
            schema = read_json(path.parent / unquote(uri), "write it again", ExportError)
        except ExportError as error:
            return None, [Finding("error", "SCHEMA", f"{uri} cannot be read ({error.finding})", name)]
    if schema is None:
        return None, []
    try:
        check_shape(schema, SCHEMA, "schema")
    except DamagedFile as error:
        return None, [Finding("error", "SCHEMA", str(error), name)]
    return schema, [] if "id" in schema else [Finding("error", "SCHEMA_ID", "the schema has no id", name)]


def check_entity(entity: Any, schema: dict[str, Any] | None, where: str) -> Iterator[Finding]:
    """Check the metadata of a tileset, tile, group or content.

    entity : {"class", "properties"}; schema : that of its tileset, None if it has none
    """
    try:
        check_shape(entity, {"class": Required(str), "properties": dict}, "metadata")
    except DamagedFile as error:
        yield Finding("error", "METADATA", str(error), where)
        return
    name = entity["class"]
    found = (schema or {}).get("classes", {}).get(name)
    if found is None:
        yield Finding("error", "METADATA", f"class {name} is not in the schema", where)
        return
    kinds, values = found.get("properties", {}), entity.get("properties", {})
    for key, kind in kinds.items():
        if kind.get("required") and key not in values:
            yield Finding("error", "METADATA", f"required property {key} of class {name} is missing", where)
    for key, value in values.items():
        if key not in kinds:
            yield Finding("error", "METADATA", f"{key} is not in class {name}", where)
        elif not _fits_property(value, kinds[key], (schema or {}).get("enums", {})):
            text = json.dumps(value, ensure_ascii=False)[:60]
            yield Finding("error", "METADATA_TYPE", f"{key}: {text} is not of type {_named(kinds[key])}", where)


def _named(kind: dict[str, Any]) -> str:
    words = ["array of" if kind.get("array") else "", str(kind.get("componentType", "")), str(kind.get("type"))]
    return " ".join(word for word in words if word)


def _fits_property(value: Any, kind: dict[str, Any], enums: dict[str, Any]) -> bool:
    if not kind.get("array"):
        return _fits(value, kind, enums)
    count = kind.get("count")
    return (
        isinstance(value, list)
        and (count is None or len(value) == count)
        and all(_fits(each, kind, enums) for each in value)
    )


def _fits(value: Any, kind: dict[str, Any], enums: dict[str, Any]) -> bool:
    name = kind.get("type")
    if name == "STRING":
        return isinstance(value, str)
    if name == "BOOLEAN":
        return isinstance(value, bool)
    if name == "ENUM":
        known = enums.get(str(kind.get("enumType")), {}).get("values", [])
        return value in [each.get("name") for each in known]
    count = COMPONENTS.get(str(name))
    if count is None:
        return False
    items = [value] if count == 1 else value
    component = str(kind.get("componentType", ""))
    return isinstance(items, list) and len(items) == count and all(_fits_component(each, component) for each in items)


def _fits_component(value: Any, component: str) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return False
    if component.startswith("FLOAT"):
        return True
    unsigned = component.startswith("UINT")
    bits = component.removeprefix("UINT").removeprefix("INT")
    if bits not in ("8", "16", "32", "64") or value != int(value):
        return False
    low, high = (0, 2 ** int(bits)) if unsigned else (-(2 ** (int(bits) - 1)), 2 ** (int(bits) - 1))
    return bool(low <= value < high)
