"""Folders of crops for the figure parser: shards of drawn bodies and of doodles; resumable, deterministic by seed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from exporters.atomic_file import atomic_path, sweep_temporary, write_text
from fig2mesh.errors import FigureError
from fig2mesh.training.bodies.pack import Pack, load_pack
from fig2mesh.training.bodies.subject import SPLITS
from fig2mesh.training.samples.build import read_shard
from fig2mesh.training.samples.shard_jobs import make_shards

KINDS: Final = ("bodies", "doodles")
BODIES, VIEWS, DOODLES = 40, 4, 160
"""Bodies per shard, drawings per body; doodles per shard."""

RECIPE: Final = "crops.json"
VERSION: Final = 1
FIELDS: Final = ("rgba", "labels", "joints", "visible")

_PACK: dict[str, Pack] = {}


@dataclass(frozen=True)
class Crops:
    """N crops, see `training.drawing.crop.Crop`.

    rgba : (N, 256, 256, 4) uint8; labels : (N, 256, 256) uint8; joints : (N, 21, 2) float32; visible : (N, 21) bool
    """

    rgba: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    joints: NDArray[np.float32]
    visible: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.labels)


def build_crops(
    pack: Path,
    out: Path,
    *,
    bodies: int = 2000,
    doodles: int = 3200,
    valid: int = 40,
    seed: int = 0,
    jobs: int = 1,
    report: Callable[[int, int], None] = lambda done, total: None,
) -> None:
    """Make a folder of crops from a pack; existing shards are kept.

    bodies : of the training split, `VIEWS` drawings each; doodles : figures of lines and blobs for training
    valid : bodies of each held-out split, and twice as many doodles of held-out poses
    """
    load_pack(pack)
    recipe = {"version": VERSION, "pack": hashlib.sha256(pack.read_bytes()).hexdigest(), "seed": seed}
    _check_recipe(out, recipe)
    tasks = []
    for split in SPLITS:
        count = {"bodies": bodies if split == "train" else valid, "doodles": doodles if split == "train" else 2 * valid}
        for kind, step in (("bodies", BODIES), ("doodles", DOODLES)):
            if kind == "doodles" and split == "valid-characters":
                continue
            for index, first in enumerate(range(0, count[kind], step)):
                path = out / f"{kind}-{split}-{index:05d}.npz"
                if not path.exists():
                    rows = range(first, min(first + step, count[kind]))
                    tasks.append((str(pack), kind, split, rows, seed, path))
    tasks.sort(key=lambda task: task[2] == "train")
    sweep_temporary(out)
    make_shards(_shard, tasks, jobs, report)


def load_crops(data: Path, split: str, kind: str = "*", limit: int | None = None) -> Crops:
    """Read all crops of a split, or the first `limit` shards of each kind."""
    names = [k for k in KINDS if kind in ("*", k)]
    found = [path for k in names for path in sorted(data.glob(f"{k}-{split}-?????.npz"))[:limit]]
    if not found:
        raise FigureError(data, f"no crops of {split} in it", "make them with: fig2mesh data crops")
    columns: dict[str, list[Any]] = {name: [] for name in FIELDS}
    for path in found:
        for name, value in read_shard(path, FIELDS).items():
            columns[name].append(value)
    return Crops(**{name: np.concatenate(values) for name, values in columns.items()})


def concatenate(*parts: Crops) -> Crops:
    """Concatenate sets of crops, in order."""
    return Crops(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in FIELDS})


def crops_digest(data: Path) -> str:
    """Identifier of a folder of crops: 16 hexadecimal digits of the hash of its recipe and its shards' names."""
    path = data / RECIPE
    names = "".join(sorted(shard.name for shard in data.glob("*-train-?????.npz")))
    return hashlib.sha256((path.read_bytes() if path.is_file() else b"") + names.encode()).hexdigest()[:16]


def _check_recipe(out: Path, recipe: dict[str, Any]) -> None:
    path = out / RECIPE
    text = json.dumps(recipe, indent=2) + "\n"
    if path.exists():
        if path.read_text(encoding="utf-8") != text:
            raise FigureError(out, "holds crops of another recipe", "choose another folder or remove this one")
        return
    out.mkdir(parents=True, exist_ok=True)
    write_text(path, text)


def _shard(pack: str, kind: str, split: str, rows: range, seed: int, path: Path) -> None:
    import cv2

    from fig2mesh.training.drawing.crop import Crop
    from fig2mesh.training.drawing.doodles import Doodler
    from fig2mesh.training.samples.crops import body_crops

    cv2.setNumThreads(1)
    if pack not in _PACK:
        _PACK[pack] = load_pack(Path(pack))
    made: list[Crop] = []
    if kind == "bodies":
        for row in rows:
            made += body_crops(_PACK[pack], split, seed * 1_000_000 + row, VIEWS)
    else:
        doodler = Doodler(_PACK[pack], split)
        made = doodler.draw(len(rows), np.random.default_rng([11, SPLITS.index(split), seed, rows.start]))
    columns: dict[str, Any] = {name: np.stack([getattr(crop, name) for crop in made]) for name in FIELDS}
    with atomic_path(path) as partial:
        np.savez_compressed(partial, **columns)
