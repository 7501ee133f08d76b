"""Shards of stick figures whose parts are capsules between their anchors: the layout of real ones, exact fields."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fig2mesh.field.camera import axes
from fig2mesh.skeleton import BODY_PARTS, JOINT_NAMES, KINDS, PART_KIND, anchor_joints, part_centre

RADIUS = dict(zip(KINDS, (0.18, 0.11, 0.05, 0.04, 0.04, 0.07, 0.055, 0.045), strict=True))
# fmt: off
STANDING = {
    "head": (0, 0.75, 0), "eyes": (0, 0.75, 0.1), "neck": (0, 0.58, 0), "thorax": (0, 0.5, 0), "pelvis": (0, 0, 0),
    "shoulder": (0.2, 0.5, 0), "elbow": (0.45, 0.35, -0.05), "wrist": (0.65, 0.2, 0.05), "hand": (0.75, 0.15, 0.08),
    "hip": (0.1, -0.05, 0), "knee": (0.14, -0.45, 0.06), "ankle": (0.13, -0.85, 0), "foot": (0.15, -0.9, 0.15),
}
# fmt: on


def joints(rng: np.random.Generator, bodies: int) -> np.ndarray:
    """(M, 21, 3) joints about a standing pose, FIGURE."""
    places = []
    for name in JOINT_NAMES:
        side, _, rest = name.partition("_")
        x, y, z = STANDING[rest if side in ("l", "r") and rest else name]
        places.append((-x if side == "r" else x, y, z))
    return np.array(places) + rng.normal(0, 0.03, (bodies, 21, 3))


def capsule(points: np.ndarray, start: np.ndarray, end: np.ndarray, radius: float) -> np.ndarray:
    """Signed distance of points (..., 3)."""
    along = end - start
    share = np.clip((points - start) @ along / (along @ along), 0, 1)
    return np.linalg.norm(points - start - share[..., None] * along, axis=-1) - radius


def field(label: int, places: np.ndarray, points: np.ndarray, scale: float = 1.0) -> np.ndarray:
    """Signed distance to a part from its anchors (A, 3); the torso is a capsule from hips to shoulders."""
    kind = PART_KIND[label]
    if kind == "torso":
        start, end = places[2:].mean(0), places[:2].mean(0)
    else:
        start, end = places[0], places[1]
    return capsule(points, start, end, RADIUS[kind] * scale)


def write_shard(path: Path, bodies: int = 2, seed: int = 0, *, grids: bool = False, samples: int = 400) -> Path:
    """One shard; points are `samples` inside and as many outside."""
    rng = np.random.default_rng(seed)
    skeletons = joints(rng, bodies)
    shape = (bodies, 14)
    centre, edge = np.zeros((*shape, 3)), np.zeros(shape)
    points, distance = np.zeros((*shape, 2 * samples, 3)), np.zeros((*shape, 2 * samples))
    masks = np.zeros((bodies, 4, 14, 64, 64), bool)
    grid = np.zeros((*shape, 64, 64, 64), np.float16) if grids else None
    pixel = (np.arange(64) + 0.5) / 32 - 1
    depth = np.linspace(-1, 1, 48)
    picture = np.stack(np.meshgrid(-pixel, pixel, depth, indexing="ij"), -1)[..., [1, 0, 2]]
    node = np.linspace(-1, 1, 64)
    nodes = np.stack(np.meshgrid(node, node, node, indexing="ij"), -1)
    for body in range(bodies):
        for label in BODY_PARTS:
            part = label - 1
            chosen = skeletons[body][list(anchor_joints(label))]
            centre[body, part] = part_centre(label, skeletons[body])
            reach = np.abs(chosen - centre[body, part]).max() + RADIUS[PART_KIND[label]]
            edge[body, part] = 2.2 * reach
            local = 2 * (chosen - centre[body, part]) / edge[body, part]
            scale = 2 / edge[body, part]
            tried = rng.uniform(-1, 1, (60 * samples, 3)).astype(np.float16).astype(np.float64)
            close = local.mean(0) + rng.normal(0, 0.15, (20 * samples, 3))
            tried = np.concatenate([tried, np.clip(close, -1, 1).astype(np.float16)])
            found = field(label, local, tried, scale)
            inside, outside = np.flatnonzero(found < 0), np.flatnonzero(found >= 0)
            rows = np.concatenate([rng.choice(inside, samples), rng.choice(outside, samples)])
            points[body, part], distance[body, part] = tried[rows], found[rows]
            for view in range(4):
                seen = local @ axes(90 * view).T
                masks[body, view, part] = (field(label, seen, picture, scale) < 0).any(-1)
            if grid is not None:
                grid[body, part] = field(label, local, nodes, scale)
    packed = np.packbits(masks, axis=-1)
    arrays = {
        "joints": skeletons.astype(np.float32),
        "centre": centre.astype(np.float32),
        "edge": edge.astype(np.float32),
        "size": np.zeros((*shape, 3), np.float32),
        "points": points.astype(np.float16),
        "distance": distance.astype(np.float16),
        "mask_amodal": packed,
        "mask_visible": packed,
        "character": np.array(["stick"] * bodies),
        "clip": np.array(["standing"] * bodies),
        "seed": np.arange(bodies),
    }
    if grid is not None:
        arrays["grid"] = grid
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **arrays)
    return path
