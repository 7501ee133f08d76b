"""Keep what a stage made in one file, and read it back: `--save-stages`, `--resume-from`.

A stage's result is a tree of frozen records, tuples, dictionaries, arrays and plain values. Arrays go into an .npz
archive, the tree into a JSON text beside them in the same archive; nothing is pickled, so that reading a file from
elsewhere runs no code.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from fig2mesh.convert.record_types import check_fields, fits
from fig2mesh.errors import FigureError, OutputError
from fig2mesh.records import Figure
from fig2mesh.settings import STAGES
from georef.untrusted.damage import DamagedFile, decoding
from georef.untrusted.json_file import parse_json
from georef.untrusted.json_shape import check_shape
from georef.untrusted.npz_file import read_arrays, text_of

REMEDY = "run again with --save-stages and without --resume-from"


def _classes() -> dict[str, type]:
    from fig2mesh import image_frame as frame
    from fig2mesh import records
    from fig2mesh.mesh import bake, close, solid
    from fig2mesh.parts import canvas, layers, limbs, outline, split

    modules = (records, frame, canvas, limbs, split, layers, outline, close, solid, bake)
    return {
        name: value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, type) and dataclasses.is_dataclass(value)
    }


def figure_digest(figure: Figure) -> str:
    """What a figure holds, in 64 hexadecimal digits; its name and where it was cut from do not count."""
    digest = hashlib.sha256()
    for array in (figure.rgba, figure.mask, figure.joints_px, figure.visible, figure.part_labels):
        digest.update(str(array.shape).encode() + array.tobytes())
    digest.update(repr(sorted(figure.depth_order.items())).encode())
    return digest.hexdigest()


def _kinds() -> dict[str, Any]:
    """What each stage that is kept makes; "request" is what was asked for."""
    from fig2mesh.mesh.bake import Baked
    from fig2mesh.mesh.solid import Solid
    from fig2mesh.parts.outline import Outline
    from fig2mesh.records import Mesh, PointCloud, Pose3D, Surface, UvMesh

    return {
        "lift": Pose3D,
        "parts": Outline,
        "cloud": PointCloud,
        "solid": Solid,
        "simplify": tuple[Mesh, ...],
        "figure": Figure,
        "surface": tuple[Surface, ...],
        "unwrap": tuple[UvMesh, ...],
        "bake": tuple[Baked, ...],
        "request": dict[str, Any],
    }


def save_stage(folder: Path, stage: str, value: object) -> None:
    """Write `value` to `folder/stage.npz`, whole or not at all."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_result(folder / f"{stage}.npz", stage, value)
    except OSError as error:
        found = f"{folder / stage}.npz: {error.strerror}"
        raise OutputError("--save-stages", found, "choose a folder that can be written") from None


def write_result(path: Path, stage: str, value: object) -> None:
    """Write what a stage made to a file of its own, whole or not at all; raises OSError where the disk refuses."""
    arrays: dict[str, Any] = {}
    tree = _pack(value, arrays)
    partial = path.with_name(f".{path.stem}.{secrets.token_hex(4)}.partial.npz")
    try:
        np.savez_compressed(partial, __tree__=np.array(json.dumps(tree)), __stage__=np.array(stage), **arrays)
        os.replace(partial, path)
    except OSError:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def clear_stages(folder: Path) -> None:
    """Remove what an earlier run kept, so that its stages are not taken for this one's."""
    for path in folder.glob("*.npz"):
        if path.stem in (*STAGES, "request"):
            path.unlink()


def load_stage(folder: Path, stage: str) -> Any:
    """Read what `save_stage` wrote."""
    path = folder / f"{stage}.npz"
    if not path.exists():
        raise FigureError(path, "no such file", "run once with --save-stages and without --resume-from")
    return read_result(path, stage)


def read_result(path: Path, stage: str) -> Any:
    """Read what `write_result` wrote. Raises FigureError for a file that is damaged, or of another stage."""
    try:
        arrays = read_arrays(path)
        if not {"__stage__", "__tree__"} <= arrays.keys():
            raise DamagedFile("it has no tree of records")
        if (found := text_of(arrays.pop("__stage__"))) != stage:
            raise DamagedFile(f"it holds {found[:40]}")
        value = _unpack(parse_json(text_of(arrays.pop("__tree__"))), arrays, _classes())
        if stage in (kinds := _kinds()) and not fits(value, kinds[stage]):
            raise DamagedFile(f"it holds a {type(value).__name__}")
        return value
    except OSError as error:
        raise FigureError(path, error.strerror or "cannot be read", REMEDY) from None
    except DamagedFile as error:
        reason = str(error)[:80]
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
            raise DamagedFile("a dictionary that is none")
        return {key: _unpack(item, arrays, classes) for key, item in tree["dict"]}
    if "value" not in tree or isinstance(tree["value"], dict | list):
        raise DamagedFile("a value that is none")
    return tree["value"]
