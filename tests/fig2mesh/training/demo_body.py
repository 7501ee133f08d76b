"""A body of ellipsoids and capsules, to draw and to rasterise in tests."""

from __future__ import annotations

import numpy as np

from fig2mesh.field.camera import VIEW_YAW_DEG, axes
from fig2mesh.skeleton import PART
from fig2mesh.training.drawing.draw import Layers
from fig2mesh.training.drawing.faces import Face
from fig2mesh.training.drawing.raster import rasterise

MATERIALS = ("skin", "hair", "cloth.shirt", "cloth.trousers", "shoe", "eye")
HEIGHT = 1.79


def capsule(start, end, radius: float, end_radius: float | None = None, rings: int = 24):
    """Vertices (V, 3), faces (F, 3), uv (V, 2): round between two points, with round ends."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    along = b - a
    length = max(float(np.linalg.norm(along)), 1e-9)
    z = along / length
    x = np.cross(z, [0.3, 0.2, 0.93])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    theta = np.linspace(0, np.pi, rings + 1)
    phi = np.linspace(0, 2 * np.pi, rings, endpoint=False)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    share = (1 - np.cos(t)) / 2
    r = radius + ((end_radius or radius) - radius) * share
    middle = a + (share * length)[..., None] * z
    side = np.sin(t) ** 0.5
    out = (r * side)[..., None] * (np.cos(p)[..., None] * x + np.sin(p)[..., None] * y)
    cap = (-np.cos(t) * r * np.abs(np.cos(t)))[..., None] * z
    i, j = np.meshgrid(np.arange(rings), np.arange(rings), indexing="ij")
    q, s = i * rings + j, i * rings + (j + 1) % rings
    faces = np.concatenate([np.stack([q, s, q + rings], -1), np.stack([s, s + rings, q + rings], -1)]).reshape(-1, 3)
    uv = np.stack([p / (2 * np.pi) * 2 * np.pi * radius, share * length], axis=-1)
    return (middle + out + cap).reshape(-1, 3), faces, uv.reshape(-1, 2)


def body(rng: np.random.Generator, shirt_sleeve: bool = True) -> dict[str, np.ndarray]:
    """vertices, faces, normals, uv, face_part, face_material of a standing body with random arms and legs."""
    swing = lambda low, high: rng.uniform(low, high)  # noqa: E731
    pieces = [
        ("torso", 2, (0, 0.05, 0), (0, 0.46, 0), 0.15, 0.19),
        ("torso", 3, (0, -0.08, 0), (0, 0.06, 0), 0.16, 0.15),
    ]
    pieces += [
        ("head", 0, (0, 0.5, 0), (0, 0.62, 0), 0.06, 0.06),
        ("head", 0, (0, 0.63, 0.01), (0, 0.78, 0.01), 0.085, 0.11),
    ]
    pieces += [("head", 1, (0, 0.76, -0.035), (0, 0.83, -0.02), 0.115, 0.11)]
    for side, sign in (("l", 1), ("r", -1)):
        shoulder = np.array([0.19 * sign, 0.44, 0])
        lift, fore = swing(-1.3, 0.9), swing(-1.5, 1.5)
        elbow = shoulder + 0.29 * np.array([sign * np.cos(lift), np.sin(lift), swing(-0.2, 0.5)])
        wrist = elbow + 0.26 * np.array([sign * np.cos(lift + fore), np.sin(lift + fore), swing(-0.1, 0.6)])
        hand = wrist + 0.1 * (wrist - elbow) / 0.26
        hip = np.array([0.1 * sign, -0.06, 0])
        out, bend = swing(0, 0.4), swing(0, 0.7)
        knee = hip + 0.42 * np.array([sign * np.sin(out), -np.cos(out), 0.6 * bend])
        ankle = knee + 0.4 * np.array([0.3 * sign * np.sin(out), -1, -bend])
        pieces += [
            (f"{side}_upper_arm", 2, shoulder, elbow, 0.07, 0.05),
            (f"{side}_lower_arm", 2 if shirt_sleeve else 0, elbow, wrist, 0.048, 0.035),
            (f"{side}_hand", 0, wrist, hand, 0.03, 0.045),
            (f"{side}_upper_leg", 3, hip, knee, 0.1, 0.07),
            (f"{side}_lower_leg", 3, knee, ankle, 0.068, 0.055),
            (f"{side}_foot", 4, ankle - [0, 0.04, 0.02], ankle + [0.04 * sign, -0.06, 0.16], 0.05, 0.045),
        ]
    vertices, faces, uvs, part, material = [], [], [], [], []
    for name, kind, start, end, radius, last in pieces:
        v, f, uv = capsule(start, end, radius, last)
        faces.append(f + sum(map(len, vertices)))
        vertices.append(v)
        uvs.append(uv + rng.uniform(0, 3, 2))
        part.append(np.full(len(f), PART[name], np.uint8))
        material.append(np.full(len(f), kind))
    v, f = np.concatenate(vertices), np.concatenate(faces)
    normals = np.zeros_like(v)
    for corner in range(3):
        np.add.at(normals, f[:, corner], np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]]))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return {
        "vertices": v,
        "faces": f,
        "normals": normals,
        "uv": np.concatenate(uvs),
        "face_part": np.concatenate(part),
        "face_material": np.concatenate(material),
    }


def render_view(model: dict[str, np.ndarray], view: str = "front", size: int = 256) -> tuple[Layers, Face | None]:
    """Layers of a view, and the face when it is to be seen."""
    turn = axes(VIEW_YAW_DEG[view])
    vertices, faces = model["vertices"] @ turn.T, model["faces"]
    low, pitch = np.array([-1.05, -1.12]), 2.1 / size
    seen = rasterise(vertices, faces, size=size, low=low, pitch=pitch)
    normals = seen.blend(model["normals"] @ turn.T, faces)
    normals = np.where(normals[..., 2:] < 0, -normals, normals)
    layers = Layers(
        seen.pick(model["face_part"]),
        seen.pick(model["face_material"], -1),
        seen.blend(model["uv"], faces),
        seen.depth,
        normals,
    )
    marks = np.array([[0.04, 0.735, 0.11], [-0.04, 0.735, 0.11], [0, 0.66, 0.1]]) @ turn.T
    pixels = np.stack([(marks[:, 0] - low[0]) / pitch, size - (marks[:, 1] - low[1]) / pitch], axis=1)
    if view == "back":
        return layers, None
    eyes = {"front": pixels[:2], "left": pixels[:1], "right": pixels[1:2]}[view]
    return layers, Face(eyes, pixels[2], {"front": 0.0, "left": -1.0, "right": 1.0}[view])
