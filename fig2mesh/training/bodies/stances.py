"""Stances that are common in drawings and rare in motion clips, made from random angles.

A stance combines a pose of each arm with a pose of the legs. Arms are given by the directions of upper and
lower arm in the trunk's axes, for the left side; right arms and legs are mirrored left ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.training.bodies.retarget import Rotations, about, swings
from fig2mesh.training.bodies.rig import KEY, KEYS, T_POSE

_ARMS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float], float]] = {
    "hang": ((0.22, -1.0, 0.0), (0.12, -1.0, 0.2), 0.13),
    "akimbo": ((0.85, -0.68, -0.1), (-0.62, -0.72, 0.26), 0.12),
    "raise": ((0.45, 1.0, 0.1), (0.1, 1.0, 0.15), 0.3),
    "wave": ((0.95, 0.25, 0.15), (0.3, 1.0, 0.2), 0.25),
    "out": ((1.0, 0.0, 0.05), (1.0, 0.1, 0.15), 0.25),
    "offer": ((0.35, -0.55, 0.75), (0.1, 0.1, 1.0), 0.25),
    "point": ((0.7, 0.15, 0.75), (0.7, 0.2, 0.8), 0.3),
    "chest": ((0.45, -0.9, 0.2), (-0.75, 0.3, 0.75), 0.15),
    "pray": ((0.25, -0.95, 0.3), (-0.45, 0.55, 0.75), 0.1),
    "salute": ((0.95, 0.15, 0.4), (-0.62, 0.75, 0.2), 0.1),
    "behind": ((0.35, -0.9, -0.4), (-0.55, -0.65, -0.35), 0.1),
    "lap": ((0.2, -0.9, 0.25), (-0.1, -0.25, 0.95), 0.12),
    "carry": ((0.25, -0.95, 0.1), (0.05, 0.25, 1.0), 0.15),
}
"""Arm pose → directions of upper and lower arm, standard deviation of both."""

# fmt: off
_ARM_PAIRS: tuple[tuple[str, str, float], ...] = (
    ("hang", "hang", 3), ("akimbo", "akimbo", 2), ("akimbo", "hang", 1), ("akimbo", "wave", 1), ("raise", "raise", 1.5),
    ("wave", "hang", 2), ("raise", "hang", 1), ("out", "out", 1.5), ("offer", "hang", 1), ("offer", "offer", 1),
    ("point", "hang", 1.5), ("point", "akimbo", 0.7), ("chest", "chest", 0.6), ("chest", "hang", 0.8),
    ("pray", "pray", 0.6), ("salute", "hang", 0.8), ("behind", "behind", 0.7), ("carry", "hang", 1),
    ("carry", "carry", 1), ("out", "hang", 1), ("raise", "akimbo", 0.7), ("carry", "raise", 0.7),
)
# fmt: on

# fmt: off
_LEGS: dict[str, float] = {
    "stand": 6, "straddle": 1.5, "relaxed": 2, "walk": 4, "run": 1.5, "chair": 2, "crossed": 1.2, "kneel": 0.8,
    "half_kneel": 1, "kick": 1.5, "dance": 1.2, "squat": 0.6, "lunge": 0.8,
}
# fmt: on


def stances(count: int, rng: np.random.Generator) -> tuple[NDArray[np.str_], Rotations]:
    """(N,) names such as "made/walk-hang-wave" and (N, 20, 3, 3) rotations that face the front."""
    pairs = np.array([weight for *_, weight in _ARM_PAIRS])
    weights = np.array(list(_LEGS.values()))
    names, poses = [], []
    for _ in range(count):
        left, right, _ = _ARM_PAIRS[rng.choice(len(pairs), p=pairs / pairs.sum())]
        if rng.random() < 0.5:
            left, right = right, left
        legs = list(_LEGS)[rng.choice(len(weights), p=weights / weights.sum())]
        if legs in ("chair", "crossed") and rng.random() < 0.5:
            left, right = ("lap", "lap") if rng.random() < 0.6 else ("lap", right)
        names.append(f"made/{legs}-{left}-{right}")
        poses.append(_stance(legs, left, right, rng))
    return np.array(names, str), np.stack(poses) if poses else np.empty((0, len(KEYS), 3, 3))


def _stance(legs: str, left: str, right: str, rng: np.random.Generator) -> NDArray[np.float64]:
    """(20, 3, 3) rotations of one stance."""
    pose = np.tile(np.eye(3), (len(KEYS), 1, 1))
    lean = {"run": 12.0, "walk": 3.0, "squat": 22.0, "lunge": 8.0, "kick": -6.0, "crossed": 3.0}.get(legs, 0.0)
    sway = 0.0 if legs in ("chair", "crossed") else rng.normal(0, 3)
    pose[KEY["hips"]] = _x(lean / 3 + rng.normal(0, 2)) @ _z(sway) @ _y(rng.normal(0, 5))
    bend, side, turn = lean * 2 / 9 + rng.normal(0, 2), -sway / 3 + rng.normal(0, 1.5), rng.normal(0, 3)
    for below, key in zip(("hips", "spine1", "spine2"), ("spine1", "spine2", "spine3"), strict=True):
        pose[KEY[key]] = pose[KEY[below]] @ _x(bend) @ _z(side) @ _y(turn)
    pose[KEY["neck"]] = _z(rng.normal(0, 5)) @ _x(rng.normal(2, 4))
    pose[KEY["head"]] = _y(rng.normal(0, 12)) @ _z(rng.normal(0, 6)) @ _x(rng.normal(2, 8))
    trunk, hips = pose[KEY["spine3"]], pose[KEY["hips"]]
    flip = np.diag([-1.0, 1.0, 1.0])
    first = bool(rng.random() < 0.5)
    for sign, name, hold in (("l", left, first), ("r", right, not first)):
        across = np.eye(3) if sign == "l" else flip
        limbs = _arm(name, rng) | _leg(legs, hold, flip @ hips @ flip if sign == "r" else hips, rng)
        for key, rotation in limbs.items():
            base = trunk if key in ("clavicle", "upper_arm", "lower_arm", "hand") else np.eye(3)
            pose[KEY[f"{sign}_{key}"]] = base @ across @ rotation @ across
    return pose


def _arm(name: str, rng: np.random.Generator) -> dict[str, NDArray[np.float64]]:
    """Rotations of a left arm's keys in the trunk's axes."""
    upper, lower, spread = _ARMS[name]
    u, v = (np.array(d) / np.linalg.norm(d) + rng.normal(0, spread / 2, 3) for d in (upper, lower))
    u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
    shrug = about(np.array([0.0, 0.0, 1.0]), np.radians(max(0.0, 25 * u[1]) + rng.normal(0, 2)))
    arm = swings(T_POSE[KEY["l_upper_arm"]], u)
    inside = v - (v @ u) * u
    if np.linalg.norm(inside) > 0.15:  # bent enough for the elbow to define the twist of the upper arm
        ahead = inside / np.linalg.norm(inside)
        arm = np.stack([u, np.cross(ahead, u), ahead], 1)
    forearm = swings(u, v) @ arm
    hand = forearm @ _y(rng.normal(-5, 10)) @ _z(rng.normal(0, 15)) @ about(np.array([1.0, 0, 0]), rng.normal(0, 0.5))
    return {"clavicle": shrug, "upper_arm": arm, "lower_arm": forearm, "hand": hand}


def _leg(name: str, first: bool, hips: NDArray[np.float64], rng: np.random.Generator) -> dict[str, NDArray[np.float64]]:
    """Rotations of a left leg's keys, BODY, under `hips`; `first` distinguishes the two legs of an uneven stance.

    Angles in degrees: raise the thigh ahead, spread it outwards, turn it outwards about itself, bend the knee.
    """
    u = rng.uniform
    raised, spread, turned, knee, flat = {
        "stand": (u(-4, 4), u(2, 9), u(5, 25), u(0, 6), True),
        "straddle": (u(-4, 6), u(13, 28), u(10, 35), u(0, 10), True),
        "relaxed": (u(-3, 3), u(2, 6), u(0, 15), u(0, 4), True)
        if first
        else (u(10, 25), u(5, 14), u(15, 40), u(18, 42), True),
        "walk": (u(14, 34), u(1, 5), u(0, 12), u(3, 14), True)
        if first
        else (u(-26, -10), u(1, 5), u(0, 12), u(5, 35), False),
        "run": (u(40, 75), u(0, 6), u(0, 10), u(50, 100), False)
        if first
        else (u(-30, -10), u(0, 6), u(0, 10), u(25, 90), False),
        "chair": (u(78, 94), u(4, 18), u(0, 12), u(72, 102), True),
        "crossed": (u(72, 88), u(42, 55), u(68, 80), u(112, 128), False),
        "kneel": (u(-5, 20), u(4, 12), u(0, 10), u(85, 105), False),
        "half_kneel": (u(82, 98), u(5, 16), u(0, 12), u(85, 105), True)
        if first
        else (u(-15, 5), u(3, 10), u(0, 8), u(82, 100), False),
        "kick": (u(35, 100), u(0, 20), u(0, 15), u(0, 35), False)
        if first
        else (u(-5, 12), u(2, 8), u(5, 25), u(2, 18), True),
        "dance": (u(25, 75), u(15, 45), u(20, 50), u(50, 120), False)
        if first
        else (u(-3, 5), u(2, 8), u(8, 30), u(0, 8), True),
        "squat": (u(75, 105), u(12, 30), u(10, 30), u(95, 125), True),
        "lunge": (u(50, 80), u(15, 35), u(10, 25), u(55, 85), True)
        if first
        else (u(-25, -8), u(10, 25), u(5, 25), u(0, 15), True),
    }[name]
    yaw = _y(spread) if raised > 60 else _z(spread)  # a thigh that lies level spreads about the vertical
    thigh = hips @ yaw @ _x(-raised) @ _y(turned)
    shin = thigh @ _x(knee)
    down = u(35, 75) if name in ("kneel", "half_kneel", "crossed") else u(5, 40)
    foot = shin @ _x(down)
    if flat:
        ahead = thigh[:, 2] if raised <= 60 else thigh @ np.array([0, -1.0, 0])
        foot = _y(float(np.degrees(np.arctan2(ahead[0], ahead[2])))) @ _x(rng.normal(0, 4))
    return {"upper_leg": thigh, "lower_leg": shin, "foot": foot}


def _x(degrees: float) -> NDArray[np.float64]:
    return about(np.array([1.0, 0, 0]), np.radians(degrees))


def _y(degrees: float) -> NDArray[np.float64]:
    return about(np.array([0, 1.0, 0]), np.radians(degrees))


def _z(degrees: float) -> NDArray[np.float64]:
    return about(np.array([0, 0, 1.0]), np.radians(degrees))
