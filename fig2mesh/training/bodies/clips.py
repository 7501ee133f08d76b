"""Poses for training: frames of motion clips, retargeted, mixed, varied and thinned.

Whole clips are held out before anything else happens, so that no held-out pose shares a limb with a training clip;
hand-made stances are for training only, as long as there are clips to hold out.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fig2mesh.errors import FigureError
from fig2mesh.training.bodies.bullet_clips import motion_folder, read_motion
from fig2mesh.training.bodies.bvh import Bvh, read_bvh
from fig2mesh.training.bodies.gltf_scene import read_scene
from fig2mesh.training.bodies.retarget import (
    LIMB_END,
    Rotations,
    about,
    angle_between,
    canonical_joints,
    mirrored,
    normalise_poses,
    plausible,
    retarget,
)
from fig2mesh.training.bodies.rig import KEY, KEY_PARENT, KEYS, T_POSE, PoseSet
from fig2mesh.training.bodies.stances import stances

__all__ = ["Clip", "canonical_joints", "collect_poses", "held_out", "read_clips"]

HELD_OUT_SHARE = 0.15
HELD_OUT_COUNT = 400
MADE_SHARE, MIXED_SHARE = 0.25, 0.30  # of the training poses; the rest are frames of clips and their mirror images
NOISE_DEG = 10.0
GLB_FRAMES, BVH_FRAMES = 14, 40  # per clip; BVH motions last for seconds, GLB clips for a step or a blow

_SKIP = re.compile(r"t-?pose|rest pose|death|experimental|inactive|awaken|spawn|sleeping|lie_|backflip|^roll", re.I)
"""Clips of no stance, of a fall, or of figures that lie about."""

_LOWER = frozenset(
    KEY[k] for k in ("hips", "spine1", *(f"{s}_{b}" for s in "lr" for b in ("upper_leg", "lower_leg", "foot")))
)


def _bones(trunk: str, limbs: str) -> dict[str, str]:
    """Key → bone: six trunk bones, then seven limb bones with @L for "L" or "R", @l for "l", @Left for "Left"."""
    result = dict(zip(KEYS[:6], trunk.split(), strict=True))
    names = ("clavicle", "upper_arm", "lower_arm", "hand", "upper_leg", "lower_leg", "foot")
    for name, bone in zip(names, limbs.split(), strict=True):
        for letter, word in (("l", "Left"), ("r", "Right")):
            result[f"{letter}_{name}"] = bone.replace("@Left", word).replace("@L", letter.upper()).replace("@l", letter)
    return result


# fmt: off
BONES: tuple[dict[str, str], ...] = (
    _bones("DEF-hips DEF-spine.001 DEF-spine.002 DEF-spine.003 DEF-neck DEF-head",
           "DEF-shoulder.@L DEF-upper_arm.@L DEF-forearm.@L DEF-hand.@L DEF-thigh.@L DEF-shin.@L DEF-foot.@L"),
    _bones("pelvis spine_01 spine_02 spine_03 neck_01 head",
           "clavicle_@l upperarm_@l lowerarm_@l hand_@l thigh_@l calf_@l foot_@l"),
    _bones("hips spine spine chest chest head",
           "chest upperarm.@l lowerarm.@l wrist.@l upperleg.@l lowerleg.@l foot.@l"),
    _bones("root spine04 spine03 spine02 neck01 head",
           "clavicle.@L upperarm01.@L lowerarm01.@L wrist.@L upperleg01.@L lowerleg01.@L foot.@L"),
    _bones("Hips LowerBack Spine Spine1 Neck1 Head",
           "@LeftShoulder @LeftArm @LeftForeArm @LeftHand @LeftUpLeg @LeftLeg @LeftFoot"),
    _bones("Hips Spine Spine1 Spine3 Neck Head",
           "@LeftShoulder @LeftArm @LeftForeArm @LeftHand @LeftUpLeg @LeftLeg @LeftFoot"),
    _bones("Hips Spine Spine1 Spine2 Neck Head",
           "@LeftShoulder @LeftArm @LeftForeArm @LeftHand @LeftUpLeg @LeftLeg @LeftFoot"),
    _bones("Hips lowerback Chest Chest2 Neck Head",
           "@LeftCollar @LeftShoulder @LeftElbow @LeftWrist @LeftHip @LeftKnee @LeftAnkle"),
)
# fmt: on
"""Known skeletons; a file uses the first of which it has all bones."""


@dataclass(frozen=True)
class Clip:
    """Frames of one motion; `name` is "source/clip", `rotations` (N, 20, 3, 3) as `retarget` returns them."""

    name: str
    rotations: Rotations


def read_clips(assets: Path | None) -> list[Clip]:
    """Read all usable clips under a folder, sorted by name; those of `pybullet_data`, where installed, without one."""
    if assets is None:
        folder = motion_folder()
        paths = [] if folder is None else sorted(folder.glob("*.txt"))
        clips = [Clip(f"bullet/{path.stem}", read_motion(path, BVH_FRAMES)) for path in paths]
    else:
        if not assets.is_dir():
            raise FigureError(str(assets), "not a directory", "name the folder that holds the clips")
        clips = []
        for path in sorted(assets.rglob("*")):
            if path.suffix == ".glb":
                clips.extend(_glb_clips(path))
            elif path.suffix == ".bvh":
                clips.extend(_bvh_clips(path))
    return sorted((clip for clip in clips if len(clip.rotations)), key=lambda clip: clip.name)


def held_out(names: Iterable[str], seed: int = 0) -> frozenset[str]:
    """Choose the clips held out of training: the `HELD_OUT_SHARE` (at least one of two) of the lowest seeded hashes."""
    order = sorted(set(names), key=lambda name: hashlib.sha256(f"{seed}:{name}".encode()).digest())
    return frozenset(order[: math.ceil(HELD_OUT_SHARE * len(order))] if len(order) > 1 else ())


def collect_poses(assets: Path | None, *, count: int = 3000, seed: int = 0) -> tuple[PoseSet, PoseSet]:
    """Return training poses (at most `count`) and held-out poses (at most 400), all facing +z.

    Without `assets` the clips come from the package `pybullet_data`; without that too, all poses are hand-made.
    """
    clips = read_clips(assets)
    rng = np.random.default_rng(seed)
    hidden_clips = held_out((clip.name for clip in clips), seed)
    apart = [clip for clip in clips if clip.name in hidden_clips]
    kept = [clip for clip in clips if clip.name not in hidden_clips]
    names, made = stances(max(count if kept else 2 * count, HELD_OUT_COUNT), rng)
    names, made = _usable(names, normalise_poses(made))
    if not apart:
        hidden = np.arange(len(names)) % 7 == 0
        held = _thin([(names[hidden], made[hidden])], [HELD_OUT_COUNT])
        names, made = names[~hidden], made[~hidden]
    else:
        frames, mixed = _frames(apart, rng), _mixed(apart, 4 * HELD_OUT_COUNT, rng)
        held = _thin([frames, mixed], [HELD_OUT_COUNT * 2 // 3, HELD_OUT_COUNT - HELD_OUT_COUNT * 2 // 3])
    if kept:
        shares = [round(count * MADE_SHARE), round(count * MIXED_SHARE)]
        pools = [(names, made), _mixed(kept, 2 * count, rng), _frames(kept, rng)]
        train = _thin(pools, [*shares, count - sum(shares)])
    else:
        train = _thin([(names, made)], [count])
    return _pose_set(*train, rng), _pose_set(*held, rng)


def _glb_clips(path: Path) -> Iterator[Clip]:
    scene = read_scene(path)
    names = [name for name in scene.clips if not _SKIP.search(name)]
    bones = _match(scene.names)
    if bones is None or not names:
        return
    rest = scene.global_matrices(next((name for name in ("T-Pose", "Rest Pose") if name in scene.clips), None))[bones]
    for name in names:
        fractions = np.linspace(0, 1, GLB_FRAMES)
        frames = np.stack([scene.global_matrices(name, fraction)[bones, :3, :3] for fraction in fractions])
        turned = retarget(_orthonormal(rest[:, :3, :3]), rest[:, :3, 3], _orthonormal(frames))
        yield Clip(f"{path.stem}/{name}", turned)


def _bvh_clips(path: Path) -> Iterator[Clip]:
    motion = read_bvh(path)
    bones = _match(motion.names)
    if bones is None or _SKIP.search(path.stem):
        return
    rest, positions = _rest(motion, bones)
    frames = np.unique(np.linspace(0, len(motion.motion) - 1, BVH_FRAMES).round().astype(int))
    yield Clip(f"{path.parent.name}/{path.stem}", retarget(rest, positions, motion.poses(frames)[0][:, bones]))


def _rest(motion: Bvh, bones: NDArray[np.intp]) -> tuple[Rotations, NDArray[np.float64]]:
    """(20, 3, 3) rotations and (20, 3) positions of the rest pose, or of the most upright frame if it is not a stance.

    Some files align every bone's offset with its own x axis; at rest their legs then lie along the trunk.
    """
    rotations, positions = motion.poses()
    at = positions[0, bones]
    head, feet = at[KEY["head"]] - at[KEY["hips"]], at[KEY["l_foot"]] + at[KEY["r_foot"]] - 2 * at[KEY["hips"]]
    if head @ feet < 0:
        return rotations[0, bones], at
    rotations, positions = motion.poses(np.arange(len(motion.motion)))
    at = positions[:, bones]
    down = np.array([0.0, -1.0, 0.0])
    bend = angle_between(at[:, KEY["hips"]] - at[:, KEY["head"]], down)
    for name in (name for name in LIMB_END if name.endswith("leg")):
        bend = bend + angle_between(at[:, KEY[LIMB_END[name]]] - at[:, KEY[name]], down)
    best = int(bend.argmin())
    return rotations[best, bones], at[best]


def _match(names: tuple[str, ...]) -> NDArray[np.intp] | None:
    """(20,) bone of each key, None for an unknown skeleton."""
    for bones in BONES:
        if set(bones.values()) <= set(names):
            return np.array([names.index(bones[key]) for key in KEYS])
    return None


def _orthonormal(matrices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Nearest rotations; nodes may carry scale."""
    u, _, v = np.linalg.svd(matrices)
    return np.asarray(u @ v)


def _usable(names: NDArray[np.str_], rotations: Rotations) -> tuple[NDArray[np.str_], Rotations]:
    good = plausible(rotations)
    return names[good], rotations[good]


def _stack(clips: list[Clip]) -> tuple[NDArray[np.str_], Rotations]:
    """Usable frames of all clips and their mirror images."""
    names = np.repeat([clip.name for clip in clips], [len(clip.rotations) for clip in clips])
    rotations = np.concatenate([clip.rotations for clip in clips])
    both = np.concatenate([rotations, mirrored(rotations)])
    return _usable(np.concatenate([names, names]), normalise_poses(both))


def _frames(clips: list[Clip], rng: np.random.Generator) -> tuple[NDArray[np.str_], Rotations]:
    """Frames of clips, and the same frames with noise."""
    names, rotations = _stack(clips)
    noisy, shaken = _usable(names, normalise_poses(_perturbed(rotations, rng)))
    return np.concatenate([names, noisy]), np.concatenate([rotations, shaken])


def _mixed(clips: list[Clip], count: int, rng: np.random.Generator) -> tuple[NDArray[np.str_], Rotations]:
    """Upper bodies of some frames on the lower bodies of others, a third of them with noise."""
    names, rotations = _stack(clips)
    upper, lower = rng.integers(len(names), size=(2, count)) if len(names) else np.empty((2, 0), int)
    hips = rotations[:, KEY["hips"]]
    carry = hips[lower] @ np.swapaxes(hips[upper], -1, -2)  # the trunk keeps its turn against the hips
    result = carry[:, None] @ rotations[upper]
    result[:, list(_LOWER)] = rotations[lower][:, list(_LOWER)]
    shaken = rng.random(len(result)) < 1 / 3
    result[shaken] = _perturbed(result[shaken], rng)
    both = np.array([f"{a}+{b}" for a, b in zip(names[upper], names[lower], strict=True)], str)
    return _usable(both, normalise_poses(result))


def _perturbed(rotations: Rotations, rng: np.random.Generator) -> Rotations:
    """Random turns of up to `NOISE_DEG` at every joint; knees and elbows only bend, and never backwards."""
    result = rotations.copy()
    limit = np.radians(NOISE_DEG)
    for key, index in KEY.items():
        parent, size = KEY_PARENT.get(key), len(rotations)
        turn = about(rng.normal(size=(size, 3)), rng.uniform(0, limit, size) * (1 if key in _FREE else 0.4))
        if parent is None or key.endswith("foot"):  # feet stay as level as they were
            result[:, index] = turn @ rotations[:, index]
            continue
        local = np.swapaxes(rotations[:, KEY[parent]], -1, -2) @ rotations[:, index]
        if key.endswith(("lower_arm", "lower_leg")):
            straight, bent = T_POSE[index], local @ T_POSE[index]
            axis = np.cross(np.broadcast_to(straight, bent.shape), bent)
            usual = [1.0, 0, 0] if key.endswith("leg") else [0, -1.0 if key.startswith("l") else 1.0, 0]
            axis = np.where(np.linalg.norm(axis, axis=1, keepdims=True) < 0.1, usual, axis)
            turn = about(axis, np.maximum(rng.uniform(-limit, limit, size), -angle_between(straight, bent)))
        result[:, index] = result[:, KEY[parent]] @ turn @ local
    return result


_FREE = frozenset(key for key in KEYS if key.endswith(("arm", "hand", "leg", "head")))


def _thin(pools: list[tuple[NDArray[np.str_], Rotations]], counts: list[int]) -> tuple[NDArray[np.str_], Rotations]:
    """The most different poses of each pool; the last pool makes up for what others lack."""
    names, rotations, owed = [], [], 0
    for (pool_names, pool), count in zip(pools, counts, strict=True):
        chosen = farthest_points(canonical_joints(pool).reshape(len(pool), -1), count + owed)
        owed += count - len(chosen)
        names.append(pool_names[chosen])
        rotations.append(pool[chosen])
    return np.concatenate(names), np.concatenate(rotations)


def farthest_points(points: NDArray[np.floating], count: int) -> NDArray[np.intp]:
    """(min(count, N),) indices of points (N, D): the most central one, then always the one farthest from all chosen."""
    points = np.asarray(points, np.float32)
    count = min(count, len(points))
    chosen = np.empty(count, np.intp)
    near = np.full(len(points), np.inf, np.float32)
    following = int(((points - points.mean(0)) ** 2).sum(1).argmin()) if count else 0
    for index in range(count):
        chosen[index] = following
        near = np.minimum(near, ((points - points[following]) ** 2).sum(1))
        following = int(near.argmax())
    return chosen


def _pose_set(names: NDArray[np.str_], rotations: Rotations, rng: np.random.Generator) -> PoseSet:
    """Poses with random finger curls: mostly loose hands, often fists."""
    size = (len(names), 2)
    kind = rng.random(size)
    fist = np.where(kind < 0.8, rng.normal(1.1, 0.12, size), rng.uniform(0, 1.3, size))
    curl = np.clip(np.where(kind < 0.5, rng.normal(0.2, 0.12, size), fist), 0, 1.3)
    return PoseSet(names, rotations.astype(np.float32), curl.astype(np.float32))
