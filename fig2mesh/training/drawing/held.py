"""Things held in a hand: staffs, swords, flags, umbrellas, tools, cups, balls, bags, flowers, shields."""

from __future__ import annotations

import numpy as np

from fig2mesh.skeleton import PART
from fig2mesh.training.drawing.thing_shapes import Points, Thing, at, body_length, ellipse, line, polygon


def held(joints: Points, shape: tuple[int, ...], rng: np.random.Generator) -> list[Thing]:
    """Draw a staff, sword, flag, umbrella, tool, cup, ball, box, bag, flowers or a shield in one hand."""
    side = str(rng.choice(["l", "r"]))
    hand, wrist = at(joints, f"{side}_hand", f"{side}_wrist")
    tall = body_length(joints)
    tilt = rng.normal(0, 0.25)
    up = np.array([np.sin(tilt), -np.cos(tilt)])
    across = np.array([-up[1], up[0]])
    front = bool(rng.random() < 0.6)
    spared = (PART[f"{side}_hand"],) if rng.random() < 0.6 else ()
    kind = rng.choice(["staff", "sword", "flag", "umbrella", "tool", "cup", "ball", "box", "bag", "flowers", "shield"])
    thick = rng.uniform(0.006, 0.02) * tall
    if kind in ("staff", "flag", "umbrella", "tool"):
        above = rng.uniform(0.15, 0.7) * tall
        below = rng.uniform(0.05, 0.5) * tall if kind != "umbrella" else rng.uniform(0.02, 0.06) * tall
        head = hand + up * above
        mask = line(shape, np.stack([hand - up * below, head]), thick)
        if kind == "flag":
            wide = rng.uniform(0.1, 0.3) * tall * rng.choice([-1, 1])
            flag = [
                head,
                head + across * wide + up * rng.normal(0, 0.03) * tall,
                head + across * wide - up * 0.15 * tall,
                head - up * 0.17 * tall,
            ]
            mask |= polygon(shape, np.stack(flag))
        if kind == "umbrella":
            wide = rng.uniform(0.12, 0.26) * tall
            arc = [head + wide * (across * np.cos(a) + up * np.sin(a) * 0.7) for a in np.linspace(0, np.pi, 9)]
            mask |= polygon(shape, np.stack(arc))
        if kind == "tool":
            blade = rng.uniform(0.02, 0.1, 2) * tall
            mask |= polygon(
                shape,
                np.stack(
                    [
                        head + across * blade[0],
                        head + across * blade[0] - up * blade[1],
                        head - across * blade[0] * rng.uniform(0, 1),
                        head,
                    ]
                ),
            )
    elif kind == "sword":
        way = hand - wrist
        turn = way / max(float(np.linalg.norm(way)), 1e-3) if rng.random() < 0.5 else up
        end = hand + turn * rng.uniform(0.2, 0.45) * tall
        side_way = np.array([-turn[1], turn[0]])
        guard = hand + turn * 0.03 * tall
        mask = line(shape, np.stack([hand - turn * 0.03 * tall, end]), rng.uniform(0.01, 0.025) * tall)
        mask |= line(shape, np.stack([guard - side_way * 0.04 * tall, guard + side_way * 0.04 * tall]), thick)
    elif kind == "bag":
        drop, wide = rng.uniform(0.04, 0.15) * tall, rng.uniform(0.04, 0.1) * tall
        low = hand + [0, drop]
        mask = line(shape, np.stack([hand, low + [wide * 0.6, 0]]), thick * 0.7)
        mask |= line(shape, np.stack([hand, low - [wide * 0.6, 0]]), thick * 0.7)
        mask |= polygon(
            shape,
            np.stack(
                [low + [-wide * 0.8, 0], low + [wide * 0.8, 0], low + [wide, wide * 1.4], low + [-wide, wide * 1.4]]
            ),
        )
    elif kind == "cup":
        wide, high = rng.uniform(0.02, 0.05) * tall, rng.uniform(0.05, 0.13) * tall
        cup = [
            hand - across * wide + up * high,
            hand - across * wide * 0.6 + up * high * 0.3,
            hand - across * wide * 0.2,
            hand - across * wide * 0.7 - up * high * 0.4,
            hand + across * wide * 0.7 - up * high * 0.4,
            hand + across * wide * 0.2,
            hand + across * wide * 0.6 + up * high * 0.3,
            hand + across * wide + up * high,
        ]
        mask = polygon(shape, np.stack(cup))
    elif kind == "flowers":
        mask = np.zeros(shape[:2], bool)
        for _ in range(int(rng.integers(3, 9))):
            where = hand + up * rng.uniform(0, 0.08) * tall + across * rng.normal(0, 0.03) * tall
            mask |= ellipse(shape, where, (0.02 * tall, 0.02 * tall), 0)
    elif kind == "shield":
        mask = ellipse(shape, wrist, tuple(rng.uniform(0.07, 0.14, 2) * tall), tilt)
    else:
        size = rng.uniform(0.025, 0.07, 2) * tall
        centre = hand + up * rng.uniform(-0.3, 1) * size[1]
        corner = np.stack(
            [centre + sx * across * size[0] + sy * up * size[1] for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        )
        mask = polygon(shape, corner) if kind == "box" else ellipse(shape, centre, (size[0], size[0]), 0)
    return [Thing(mask, PART["prop"], "cloth.held", front, spared)]
