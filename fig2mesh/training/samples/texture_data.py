"""Four-sided drawings of bodies that have texture coordinates, in memory: what the texture networks learn from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import PART
from fig2mesh.training.samples.build import read_shard, shards

NAMES: Final = ("picture", "labels", "depth", "uv")


@dataclass(frozen=True)
class Drawings:
    """B bodies from four sides: front, left, back, right.

    picture : (B, 4, H, W, 3) uint8 sRGB, empty where not requested
    labels : (B, 4, H, W) uint8, `PART_NAMES`
    depth : (B, 4, H, W) float16, VIEW z, FIGURE units, -inf where nothing is visible
    uv : (B, 4, H, W, 2) float16, body texture coordinates; zeros where nothing is visible and on skirts
    """

    picture: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    depth: NDArray[np.float16]
    uv: NDArray[np.float16]

    def __len__(self) -> int:
        return len(self.labels)

    def known(self, rows: NDArray[np.integer], views: NDArray[np.integer]) -> NDArray[np.bool_]:
        """(N, H, W) bool: pixels that have texture coordinates."""
        labels = self.labels[rows, views]
        return np.asarray((labels > 0) & (labels != PART["garment"]))


def load_drawings(data: Path, splits: Sequence[str], *, pictures: bool, limit: int | None = None) -> Drawings:
    """Load the bodies of all shards of some splits that have texture coordinates; characters have none.

    limit : maximum number of bodies of each split
    """
    columns: dict[str, list[NDArray[np.generic]]] = {name: [] for name in NAMES}
    for split in splits:
        count = 0
        for path in shards(data, split):
            if limit is not None and count >= limit:
                break
            arrays = read_shard(path, NAMES)
            rows = np.flatnonzero(arrays["uv"].any(axis=(1, 2, 3, 4)))
            rows = rows if limit is None else rows[: limit - count]
            count += len(rows)
            for name in NAMES:
                kept = arrays[name][rows]
                columns[name].append(kept if pictures or name != "picture" else kept[:, :, :0])
    return Drawings(*(np.concatenate(columns[name]) for name in NAMES))
