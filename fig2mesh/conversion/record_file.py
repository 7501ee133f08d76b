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
from exporters.errors import DAMAGE
from fig2mesh.conversion.record_types import check_fields, fits, records_in
from fig2mesh.errors import FigureError
from georef.untrusted.json_file import parse_json
from georef.untrusted.npz_file import read_arrays, text_of

REMEDY = "run again with --save-stages and without --resume-from"


def write_record(path: Path, title: str, value: object) -> None:
    """Write a tree to a file, whole or not at all; title : what it is, checked by `read_record`.

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
        if (found := text_of(arrays.pop("__stage__"))) != title:
            raise ValueError(f"it holds {found[:40]}")
        value = _unpack(parse_json(text_of(arrays.pop("__tree__"))), arrays, records_in(kind))
        if not fits(value, kind):
            raise TypeError(f"it holds a {type(value).__name__}")
        return value
    except OSError as error:
        raise FigureError(path, error.strerror or "cannot be read", REMEDY) from None
    except DAMAGE as error:
        reason = " ".join(str(error).split())[:80] or type(error).__name__
        raise FigureError(path, f"not a stage file of this version ({reason})", REMEDY) from None


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
    raise TypeError(f"{type(value).__name__} cannot be kept in a stage file")


def _unpack(tree: Any, arrays: dict[str, Any], classes: dict[str, type]) -> Any:
    if not isinstance(tree, dict):
        raise TypeError(f"a {type(tree).__name__} in its tree")
    if "record" in tree:
        kind = classes[tree["record"]]
        fields = {name: _unpack(item, arrays, classes) for name, item in tree["fields"].items()}
        check_fields(kind, fields)
        return kind(**fields)
    if "array" in tree:
        return arrays[tree["array"]]
    if "tuple" in tree:
        return tuple(_unpack(item, arrays, classes) for item in tree["tuple"])
    if "dict" in tree:
        return {key: _unpack(item, arrays, classes) for key, item in tree["dict"]}
    if isinstance(tree["value"], dict | list):
        raise TypeError("a value that is none")
    return tree["value"]
