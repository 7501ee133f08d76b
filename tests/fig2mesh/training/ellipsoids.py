"""Ellipsoids from four sides, with texture coordinates and another colour behind than in front: small truths."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.camera import axes
from fig2mesh.skeleton import JOINT, JOINT_NAMES, PART
from fig2mesh.training.samples.texture_data import Drawings

SIZE = 64
QUARTERS = (("head", "torso"), ("l_foot", "r_foot"))
"""Parts above and below, left and right."""

FRONT, BACK = (200, 60, 40), (40, 60, 200)


def ellipsoid(radii: tuple[float, float, float]) -> dict[str, NDArray[np.generic]]:
    """One body (4, H, W, …): points of the surface under every pixel give labels, texture coordinates and colours."""
    radius = np.array(radii)
    out: dict[str, list[NDArray[np.generic]]] = {"picture": [], "labels": [], "depth": [], "uv": [], "points": []}
    for view in range(4):
        turn = axes(90.0 * view)
        across = np.abs(turn) @ radius
        pitch = 2 * max(across[0], radius[1]) / (0.9 * SIZE)
        along = (np.arange(SIZE) + 0.5 - SIZE / 2) * pitch
        x, y = np.meshgrid(along, -along)
        inside2 = 1 - (x / across[0]) ** 2 - (y / radius[1]) ** 2
        seen = inside2 > 0
        z = np.where(seen, across[2] * np.sqrt(np.maximum(inside2, 0)), -np.inf)
        points = np.stack([x, y, np.where(seen, z, 0.0)], axis=-1) @ turn
        u = 0.5 + np.arctan2(points[..., 0] / radius[0], points[..., 2] / radius[2]) / (2 * np.pi)
        v = 0.5 - points[..., 1] / (2 * radius[1])
        left = points[..., 0] > 0
        upper, lower = (np.where(left, *(PART[name] for name in names)) for names in QUARTERS)
        labels = np.where(points[..., 1] > 0, upper, lower)
        colour = np.where(points[..., 2:] >= 0, FRONT, BACK)
        out["labels"].append(np.where(seen, labels, 0).astype(np.uint8))
        out["depth"].append(z.astype(np.float16))
        out["uv"].append((np.stack([u, v], axis=-1) * seen[..., None]).astype(np.float16))
        out["picture"].append(np.where(seen[..., None], colour, 255).astype(np.uint8))
        out["points"].append(points)
    return {name: np.stack(images) for name, images in out.items()}


def drawings(count: int, seed: int = 0) -> Drawings:
    rng = np.random.default_rng(seed)
    bodies = [ellipsoid(tuple(rng.uniform((0.3, 0.7, 0.2), (0.6, 0.9, 0.5)))) for _ in range(count)]
    columns = {name: np.stack([body[name] for body in bodies]) for name in ("picture", "labels", "depth", "uv")}
    return Drawings(**columns)


def write_shards(folder: Path, count: int = 12) -> None:
    """One shard of each split, as `fig2mesh data build` writes them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "build.json").write_text("{}\n")
    for number, split in enumerate(("train", "valid-clips", "valid-characters")):
        made = drawings(count if split == "train" else 3, number)
        np.savez(
            folder / f"{split}-00000.npz",
            picture=made.picture,
            labels=made.labels,
            depth=made.depth,
            uv=made.uv,
            joints=np.stack([joints() for _ in range(len(made))]),
        )


def joints() -> NDArray[np.float32]:
    """(21, 3) a pelvis, a head and a face that looks forward."""
    result = np.zeros((len(JOINT_NAMES), 3), np.float32)
    result[JOINT["head"]], result[JOINT["eyes"]] = (0.2, 0.4, 0.0), (0.2, 0.45, 0.1)
    return result
