"""Rotations of a clip's bones → canonical pose rotations (`rig.KEYS`), and limits that keep poses human.

All arrays of rotations are (N, 20, 3, 3), global, BODY, in the order of `KEYS`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.training.bodies.rig import KEY, KEY_MIRROR, KEY_PARENT, KEYS, T_POSE

Rotations = NDArray[np.float64]

LIMB_END: dict[str, str] = {
    f"{side}_{limb}": f"{side}_{end}"
    for side in "lr"
    for limb, end in (
        ("upper_arm", "lower_arm"),
        ("lower_arm", "hand"),
        ("upper_leg", "lower_leg"),
        ("lower_leg", "foot"),
    )
}
"""Limb → the key whose bone starts where the limb ends."""

# fmt: off
TWIST_LIMIT_DEG: dict[str, tuple[str, float]] = {
    "upper_arm": ("clavicle", 80), "lower_arm": ("upper_arm", 45), "hand": ("lower_arm", 80),
    "upper_leg": ("hips", 60), "lower_leg": ("upper_leg", 30),
}
# fmt: on
"""Limb → the key against which its twist is measured, and the largest twist that skin allows, degrees."""

HEAD_TURN_LIMIT_DEG = 35.0
"""Maximum angle between straight ahead and the gaze; drawn figures seldom show the back of a head."""

# fmt: off
_SEGMENT: dict[str, tuple[float, float, float]] = {
    "hips": (0, 0.06, 0), "spine1": (0, 0.07, 0), "spine2": (0, 0.07, 0), "spine3": (0, 0.09, 0),
    "neck": (0, 0.05, 0.01), "head": (0, 0.13, 0.01), "clavicle": (0.105, 0, 0), "upper_arm": (0.172, 0, 0),
    "lower_arm": (0.15, 0, 0), "hand": (0.1, 0, 0), "upper_leg": (0, -0.245, 0), "lower_leg": (0, -0.245, 0),
    "foot": (0, -0.035, 0.11),
}
# fmt: on
_ATTACH = {"upper_leg": (0.052, -0.005, 0.0), "clavicle": (0.0, -0.02, 0.0)}
"""Starts of these keys, from the start (hips) or the end (spine3) of the parent key; all in standing heights."""


def about(axis: NDArray[np.floating], angle: NDArray[np.floating] | float) -> NDArray[np.float64]:
    """(..., 3, 3) rotations by `angle` (...) radians about `axis` (..., 3) of any length; identity for a zero axis."""
    axis = np.asarray(axis, np.float64)
    length = np.linalg.norm(axis, axis=-1)
    x, y, z = np.moveaxis(axis / np.maximum(length, 1e-12)[..., None], -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*x.shape, 3, 3)
    turn = np.where(length < 1e-9, 0.0, angle)[..., None, None]
    return np.asarray(np.eye(3) + np.sin(turn) * cross + (1 - np.cos(turn)) * (cross @ cross))


def angle_between(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """(...,) radians between directions (..., 3)."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(np.multiply(a, b), axis=-1)))


def swings(a: NDArray[np.floating], b: NDArray[np.floating]) -> NDArray[np.float64]:
    """(..., 3, 3) smallest (swing) rotations that take directions `a` to `b` (..., 3), which are not opposite."""
    return about(np.cross(a, b), angle_between(a, b))


def twists(rotations: NDArray[np.floating], axis: NDArray[np.floating]) -> NDArray[np.float64]:
    """(...,) twist of `rotations` (..., 3, 3) about the unit `axis` (3,), radians; 0 where that is undefined."""
    m = rotations
    odd = np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], -1) @ axis
    even = 1 + np.trace(m, axis1=-2, axis2=-1)
    return np.where(even > 1e-3, 2 * np.arctan2(odd, np.maximum(even, 1e-3)), 0.0)


def body_axes(rest_positions: NDArray[np.floating]) -> NDArray[np.float64]:
    """(3, 3) rotation from a clip's axes to BODY, from the positions (20, 3) of its bones in an upright stance."""
    at = {key: rest_positions[index] for key, index in KEY.items()}
    up = at["head"] - (at["l_foot"] + at["r_foot"]) / 2
    up = np.eye(3)[np.abs(up).argmax()] * np.sign(up[np.abs(up).argmax()])
    left = at["l_upper_leg"] - at["r_upper_leg"]
    left = left - up * (left @ up)
    left = left / np.linalg.norm(left)
    return np.stack([left, up, np.cross(left, up)])


def retarget(rest: Rotations, rest_positions: NDArray[np.floating], frames: Rotations) -> Rotations:
    """Return the canonical rotations of a clip's frames.

    rest, rest_positions : (20, 3, 3) and (20, 3), the bones in an upright stance with feet ahead, the clip's axes
    frames : (N, 20, 3, 3) global rotations of the same bones

    Every limb of the result points, in BODY, the way the clip's limb does; a hand lies along its rest lower arm.
    """
    axes = body_axes(rest_positions)
    result = axes @ frames @ np.swapaxes(rest, -1, -2) @ axes.T
    for name, end in LIMB_END.items():
        direction = axes @ (rest_positions[KEY[end]] - rest_positions[KEY[name]])
        turn = swings(T_POSE[KEY[name]], direction)
        result[:, KEY[name]] = result[:, KEY[name]] @ turn
        if name.endswith("lower_arm"):
            result[:, KEY[end]] = result[:, KEY[end]] @ turn
    return np.asarray(result)


def canonical_joints(rotations: NDArray[np.floating]) -> NDArray[np.float64]:
    """(N, 20, 3) end of the segment of each key on a body of standing height 1, BODY with the pelvis at 0.

    "l_clavicle" gives the shoulder, "l_upper_arm" the elbow, "l_foot" the toes, "head" the crown.
    """
    result = np.empty((len(rotations), len(KEYS), 3))
    pelvis = np.zeros((len(rotations), 3))
    for key, index in KEY.items():
        parent, plain = KEY_PARENT.get(key), key.removeprefix("l_").removeprefix("r_")
        mirror = np.array([-1.0 if key.startswith("r_") else 1.0, 1, 1])
        start = pelvis if parent is None or plain == "upper_leg" else result[:, KEY[parent]]
        if parent is not None and plain in _ATTACH:
            start = start + rotations[:, KEY[parent]] @ (_ATTACH[plain] * mirror)
        result[:, index] = start + rotations[:, index] @ (_SEGMENT[plain] * mirror)
    return result


def mirrored(rotations: NDArray[np.floating]) -> Rotations:
    """Return the poses with left and right exchanged."""
    flip = np.diag([-1.0, 1.0, 1.0])
    return np.asarray(flip @ rotations[:, list(KEY_MIRROR)] @ flip)


def face_front(rotations: NDArray[np.floating]) -> Rotations:
    """Turn poses about y until hips and shoulders together face +z."""
    joints = canonical_joints(rotations)
    shoulders = joints[:, KEY["l_clavicle"]] - joints[:, KEY["r_clavicle"]]
    hips = rotations[:, KEY["hips"], :, 0]
    left = hips + shoulders / np.maximum(np.linalg.norm(shoulders, axis=1, keepdims=True), 1e-9)
    turn = about(np.array([0.0, 1.0, 0.0]), np.arctan2(left[:, 2], left[:, 0]))
    return np.asarray(turn[:, None] @ rotations)


def limit_head_turn(rotations: NDArray[np.floating]) -> Rotations:
    """Turn heads back until they face at most `HEAD_TURN_LIMIT_DEG` off +z; necks turn half as far."""
    result = np.array(rotations, np.float64)
    look, ahead = result[:, KEY["head"], :, 2], np.array([0.0, 0.0, 1.0])
    excess = np.maximum(angle_between(look, ahead) - np.radians(HEAD_TURN_LIMIT_DEG), 0.0)
    axis = np.cross(look, ahead)
    result[:, KEY["neck"]] = about(axis, excess / 2) @ result[:, KEY["neck"]]
    result[:, KEY["head"]] = about(axis, excess) @ result[:, KEY["head"]]
    return result


def limit_twist(rotations: NDArray[np.floating]) -> Rotations:
    """Clamp the twist of each limb to `TWIST_LIMIT_DEG`; directions stay."""
    result = np.array(rotations, np.float64)
    for side in "lr":
        for name, (above, limit) in TWIST_LIMIT_DEG.items():
            key, axis = KEY[f"{side}_{name}"], T_POSE[KEY[f"{side}_{name}"]]
            parent = result[:, KEY[above if above == "hips" else f"{side}_{above}"]]
            twist = twists(np.swapaxes(parent, -1, -2) @ result[:, key], axis)
            change = np.clip(twist, -np.radians(limit), np.radians(limit)) - twist
            result[:, key] = result[:, key] @ about(np.broadcast_to(axis, (len(change), 3)), change)
    return result


def normalise_poses(rotations: NDArray[np.floating]) -> Rotations:
    """Make poses face the front, look ahead and keep within the twist limits."""
    return limit_twist(limit_head_turn(face_front(rotations)))


def plausible(rotations: NDArray[np.floating]) -> NDArray[np.bool_]:
    """(N,) True where a pose is upright (trunk within 70°) and its limbs stay out of trunk, head and each other."""
    joints = canonical_joints(rotations)
    at = {key: joints[:, index] for key, index in KEY.items()}
    trunk = at["spine3"] / np.linalg.norm(at["spine3"], axis=1, keepdims=True)
    good = (trunk[:, 1] > np.cos(np.radians(70))) & (at["head"][:, 1] > at["spine3"][:, 1])
    skull = at["neck"] + 0.5 * (at["head"] - at["neck"])
    legs: dict[str, NDArray[np.float64]] = {}
    for side in "lr":
        hip = rotations[:, KEY["hips"]] @ (np.array(_ATTACH["upper_leg"]) * [1 if side == "l" else -1, 1, 1])
        knee, ankle = at[f"{side}_upper_leg"], at[f"{side}_lower_leg"]
        thigh = hip[:, None] + np.linspace(0.25, 1, 6)[:, None] * (knee - hip)[:, None]
        legs[side] = np.concatenate([thigh, knee[:, None] + np.linspace(0, 1, 7)[:, None] * (ankle - knee)[:, None]], 1)
    for side in "lr":
        elbow, wrist, tip = (at[f"{side}_{name}"] for name in ("upper_arm", "lower_arm", "hand"))
        for point in (elbow, (elbow + wrist) / 2, wrist, (wrist + tip) / 2):
            inner = np.einsum("nji,nj->ni", rotations[:, KEY["spine2"]], point)
            inside = (inner[:, 1] > -0.05) & (inner[:, 1] < 0.27)
            good &= ~(inside & ((inner[:, 0] / 0.085) ** 2 + (inner[:, 2] / 0.065) ** 2 < 1))
            good &= np.linalg.norm(point - skull, axis=1) > 0.065
            for leg in legs.values():
                good &= np.linalg.norm(leg - point[:, None], axis=2).min(1) > 0.04
    gaps = np.linalg.norm(legs["l"][:, :, None] - legs["r"][:, None], axis=3)
    return np.asarray(good & (gaps.min((1, 2)) > 0.04))
