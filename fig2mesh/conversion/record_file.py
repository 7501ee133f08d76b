"""Write a tree of records to one file, and read it back.

A tree consists of frozen records, tuples, dictionaries, arrays and plain values. Arrays go into an .npz archive, the
tree into a JSON text beside them in the same archive; nothing is pickled, so that reading a file from elsewhere runs
no code.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from exporters.atomic_file import atomic_path
from fig2mesh.conversion.record_types import check_fields, fits, records_in
from fig2mesh.errors import FigureError
from georef.untrusted.damage import DamagedFile, decoding
from georef.untrusted.json_file import parse_json
from georef.untrusted.json_shape import check_shape
from georef.untrusted.npz_file import read_arrays, text_of

REMEDY = "run again with --save-stages and without --resume-from"


def write_record(path: Path, title: str, value: object) -> None:
    """Write a tree to a file, whole or not at all; title : checked by `read_record`.

    Raises OSError where the disk refuses.
    """
    arrays: dict[str, Any] = {}
    tree = _pack(value, arrays)
    with atomic_path(path) as partial:
        np.savez_compressed(partial, __tree__=np.array(json.dumps(tree)), __stage__=np.array(title), **arrays)


def read_record(path: Path, title: str, kind: Any) -> Any:
    """Read what `write_record` wrote.

    kind : type of the value: a record, or a tuple or dictionary of such

    Raises FigureError for a file that is missing, damaged, of another title or of another type.
    """
    try:
        arrays = read_arrays(path)
        if not {"__stage__", "__tree__"} <= arrays.keys():
            raise DamagedFile("it has no tree of records")
        if (found := text_of(arrays.pop("__stage__"))) != title:
            raise DamagedFile(f"it holds {found[:40]}")
        value = _unpack(parse_json(text_of(arrays.pop("__tree__"))), arrays, records_in(kind))
        if not fits(value, kind):
            raise DamagedFile(f"it holds a {type(value).__name__}")
        return value
    except OSError as error:
        raise FigureError(path, error.strerror or "cannot be read", REMEDY) from None
    except DamagedFile as error:
        raise FigureError(path, f"not a stage file of this version ({str(error)[:80]})", REMEDY) from None


def _pack(value: Any, arrays: dict[str, Any]) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _pack(getattr(value, f.name), arrays) for f in dataclasses.fields(value)}
        return {"record": type(value).__name__, "fields": fields}
    if isinstance(value, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, tuple | list):
        return {"tuple": [_pack(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"dict": [[key, _pack(item, arrays)] for key, item in value.items()]}
    if value is None or isinstance(value, bool | int | float | str):
        return {"value": value}
    raise TypeError(f"{type(value).__name__} cannot be stored in a stage file")


NODE = {"record": str, "fields": dict, "array": str, "tuple": list, "dict": [list]}
"""A node of the tree, by the one key that it has."""


def _unpack(tree: Any, arrays: dict[str, Any], classes: dict[str, type]) -> Any:
    if not isinstance(tree, dict):
        raise DamagedFile(f"a {type(tree).__name__} in its tree")
    check_shape(tree, NODE)
    if "record" in tree:
        if tree["record"] not in classes:
            raise DamagedFile(f"a record of kind {tree['record'][:40]}")
        kind = classes[tree["record"]]
        fields = {name: _unpack(item, arrays, classes) for name, item in tree.get("fields", {}).items()}
        check_fields(kind, fields)
        with decoding(kind.__name__, ValueError, LookupError):  # records refuse shapes that do not belong together
            return kind(**fields)
    if "array" in tree:
        if tree["array"] not in arrays:
            raise DamagedFile(f"no array {tree['array'][:40]}")
        return arrays[tree["array"]]
    if "tuple" in tree:
        return tuple(_unpack(item, arrays, classes) for item in tree["tuple"])
    if "dict" in tree:
        if not all(len(pair) == 2 and not isinstance(pair[0], dict | list) for pair in tree["dict"]):
            raise DamagedFile("an invalid dictionary")
        return {key: _unpack(item, arrays, classes) for key, item in tree["dict"]}
    if "value" not in tree or isinstance(tree["value"], dict | list):
        raise DamagedFile("an invalid value")
    return tree["value"]
