"""Write samples as shards: deterministic by seed, resumable, in parallel."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.atomic_file import atomic_path, sweep_temporary, write_text
from fig2mesh.errors import FigureError
from fig2mesh.training.bodies.pack import Pack, load_pack
from fig2mesh.training.bodies.subject import SPLITS, draw_subject
from fig2mesh.training.samples.shard_jobs import make_shards

SHARD = 50
"""Bodies per shard of training data; validation shards with their dense grids hold `VALID_SHARD`."""

VALID_SHARD = 8
RECIPE = "build.json"
VERSION = 2
"""Version of the content of samples, so that data of an older recipe is not mixed with new."""

_PACK: dict[str, Pack] = {}


@dataclass(frozen=True)
class BuildOptions:
    """Number and content of the samples made from a pack.

    bodies : of the training split; valid : of each of the two held-out splits, with dense grids
    seed : of the random generators
    pictures : add drawn pictures, labels, depth and UV images (four views of each body), which cost most of the space
    shapes : add the parts' masks and distances, which cost most of the time; textures are learned without
    """

    bodies: int = 2000
    valid: int = 48
    seed: int = 0
    pictures: bool = True
    shapes: bool = True


def build(
    pack: Path,
    out: Path,
    options: BuildOptions = BuildOptions(),
    *,
    jobs: int = 1,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Make a folder of shards from a pack; existing shards of the same recipe are kept.

    report : called with the numbers of finished shards and of all shards
    """
    seed, pictures, shapes = options.seed, options.pictures, options.shapes
    digest = hashlib.sha256(pack.read_bytes()).hexdigest() if pack.is_file() else ""
    load_pack(pack)
    recipe = {"version": VERSION, "pack": digest, "seed": seed, "pictures": pictures, "shapes": shapes}
    _check_recipe(out, recipe)
    tasks = []
    for split in SPLITS:
        count, step = (options.bodies, SHARD) if split == "train" else (options.valid, VALID_SHARD)
        for index, first in enumerate(range(0, count, step)):
            rows = range(first, min(first + step, count))
            path = out / f"{split}-{index:05d}.npz"
            if not _complete(path, len(rows)):
                tasks.append((str(pack), split, rows, seed, pictures, shapes, path))
    sweep_temporary(out)
    make_shards(_shard, tasks, jobs, report)


def shards(data: Path, *splits: str) -> list[Path]:
    """List the shards of some splits in order; an error where there are none."""
    found = [path for split in splits for path in sorted(data.glob(f"{split}-?????.npz"))]
    if not found:
        raise FigureError(data, f"holds no {' or '.join(splits)} data", "make it with: fig2mesh data build")
    return found


def read_shard(path: Path, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Read the named arrays of a shard."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in names}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        found = f"not a readable shard ({' '.join(str(error).split())[:80]})"
        raise FigureError(path, found, "make it again with: fig2mesh data build") from None


def recipe_digest(data: Path) -> str:
    """Identifier of a folder of data: 16 hexadecimal digits of its recipe's hash."""
    path = data / RECIPE
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16] if path.is_file() else ""


def _check_recipe(out: Path, recipe: dict[str, Any]) -> None:
    path = out / RECIPE
    if path.exists():
        try:
            before = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            before = None
        if before != recipe:
            raise FigureError(out, "holds data of another recipe", "choose another folder or remove this one")
        return
    out.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps(recipe, indent=2) + "\n")


def _complete(path: Path, rows: int) -> bool:
    if not path.exists():
        return False
    try:
        with np.load(path, allow_pickle=False) as archive:
            return len(archive["seed"]) >= rows
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return False


def _shard(pack: str, split: str, rows: range, seed: int, pictures: bool, shapes: bool, path: Path) -> None:
    from fig2mesh.training.drawing.pictures import draw_views
    from fig2mesh.training.samples.sample import geometry

    if pack not in _PACK:
        _PACK[pack] = load_pack(Path(pack))
    columns: dict[str, list[Any]] = {}
    for row in rows:
        number = seed * 1_000_000 + row
        subject = draw_subject(_PACK[pack], split, number)
        rng = np.random.default_rng([1, SPLITS.index(split), number])
        arrays: dict[str, Any] = (
            geometry(subject, rng, grids=split != "train") if shapes else {"joints": subject.joints}
        )
        if pictures:
            arrays |= draw_views(subject, rng)
        arrays |= {"character": subject.character, "clip": subject.clip, "seed": number}
        for name, value in arrays.items():
            columns.setdefault(name, []).append(value)
    stacked: dict[str, Any] = {name: np.asarray(values) for name, values in columns.items()}
    with atomic_path(path) as partial:
        np.savez_compressed(partial, **stacked)
