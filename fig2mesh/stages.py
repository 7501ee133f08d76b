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
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from fig2mesh.errors import FigureError, OutputError
from fig2mesh.records import Figure
from fig2mesh.settings import STAGES


def _classes() -> dict[str, type]:
    from fig2mesh import records
    from fig2mesh.mesh import bake, close, solid
    from fig2mesh.parse import frame
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
        with np.load(path, allow_pickle=False) as archive:
            if str(archive["__stage__"]) != stage:
                raise ValueError(f"it holds {archive['__stage__']}")
            return _unpack(json.loads(str(archive["__tree__"])), archive, _classes())
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        found = f"not a stage file of this version ({' '.join(str(error).split())[:80]})"
        raise FigureError(path, found, "run again with --save-stages and without --resume-from") from None


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


def _unpack(tree: Any, archive: Any, classes: dict[str, type]) -> Any:
    if "record" in tree:
        fields = {name: _unpack(item, archive, classes) for name, item in tree["fields"].items()}
        return classes[tree["record"]](**fields)
    if "array" in tree:
        return archive[tree["array"]]
    if "tuple" in tree:
        return tuple(_unpack(item, archive, classes) for item in tree["tuple"])
    if "dict" in tree:
        return {key: _unpack(item, archive, classes) for key, item in tree["dict"]}
    return tree["value"]
