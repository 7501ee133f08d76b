"""A pack of capsule people: analytic bodies with all 14 parts, clothes, poses, and both sides of every held-out line.

Frame BODY, metres. The people stand 1.79 m high, arms out or lowered, legs down.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT_NAMES, PART
from fig2mesh.training.bodies.anny_body import AnnyBodies, face_parts, rest_directions
from fig2mesh.training.bodies.garments import Garment
from fig2mesh.training.bodies.pack import Character, Pack
from fig2mesh.training.bodies.rig import KEY_PARENT, KEYS, PoseSet, Rig
from fig2mesh.training.bodies.stances import stances

HEIGHT = 1.79
PITCH = 0.035
SHOULDER = np.array([0.18, 1.40, 0.0])

# fmt: off
BONES: dict[str, tuple[tuple[float, float, float], tuple[float, float, float], float]] = {
    "hips": ((0, 0.95, 0), (0, 1.05, 0), 0.16), "spine1": ((0, 1.05, 0), (0, 1.15, 0), 0.15),
    "spine2": ((0, 1.15, 0), (0, 1.25, 0), 0.15), "spine3": ((0, 1.25, 0), (0, 1.36, 0), 0.16),
    "neck": ((0, 1.48, 0), (0, 1.56, 0), 0.07), "head": ((0, 1.60, 0), (0, 1.665, 0.01), 0.125),
    "clavicle": ((0.05, 1.40, 0), (0.14, 1.40, 0), 0.08), "upper_arm": ((0.18, 1.40, 0), (0.45, 1.40, 0), 0.065),
    "lower_arm": ((0.45, 1.40, 0), (0.70, 1.40, 0), 0.058), "hand": ((0.70, 1.40, 0), (0.77, 1.40, 0), 0.055),
    "finger": ((0.78, 1.40, 0), (0.85, 1.40, 0), 0.05), "upper_leg": ((0.14, 0.88, 0), (0.145, 0.50, 0), 0.085),
    "lower_leg": ((0.145, 0.50, 0), (0.15, 0.08, 0), 0.07), "foot": ((0.15, 0.075, 0), (0.16, 0.06, 0.15), 0.06),
}
# fmt: on
"""Left or middle bone → where it starts and ends, and the radius of its capsule; "finger" hangs on the hand."""

NAMES = (*KEYS, "l_finger", "r_finger")
# fmt: off
PLACES = {
    "head": ("head", (0, 1.65, 0.01)), "eyes": ("head", (0, 1.67, 0.11)), "neck": ("neck", (0, 1.52, 0)),
    "thorax": ("spine3", (0, 1.36, 0)), "pelvis": ("hips", (0, 0.95, 0)), "shoulder": ("upper_arm", SHOULDER),
    "elbow": ("lower_arm", (0.45, 1.40, 0)), "wrist": ("hand", (0.70, 1.40, 0)), "hand": ("hand", (0.78, 1.40, 0)),
    "hip": ("upper_leg", (0.14, 0.88, 0)), "knee": ("lower_leg", (0.145, 0.50, 0)), "ankle": ("foot", (0.15, 0.08, 0)),
    "foot": ("foot", (0.16, 0.06, 0.12)),
}
# fmt: on
"""Left or middle joint → bone and place."""


def _side(name: str) -> tuple[str, float]:
    """Name without its side, and the sign of x."""
    return (name[2:], -1.0 if name[0] == "r" else 1.0) if name[:2] in ("l_", "r_") else (name, 1.0)


def _placed(name: str, point: object, drop: float, bone: str = "") -> NDArray[np.float64]:
    """A point of a bone, on its side, its arm lowered by `drop` radians about the shoulder."""
    stem, sign = _side(name)
    x = np.array(point, np.float64)
    if (bone or stem) in ("upper_arm", "lower_arm", "hand", "finger"):
        turn = np.array([[np.cos(drop), np.sin(drop), 0], [-np.sin(drop), np.cos(drop), 0], [0, 0, 1]])
        x = SHOULDER + turn @ (x - SHOULDER)
    return x * [sign, 1, 1]


def capsule_distances(points: NDArray[np.float64], drop: float = 0.0) -> NDArray[np.float64]:
    """(N, B) signed distance of points (N, 3) to the capsule of each of `NAMES`."""
    result = []
    for name in NAMES:
        first, last, radius = BONES[_side(name)[0]]
        a, b = _placed(name, first, drop), _placed(name, last, drop)
        along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        result.append(np.linalg.norm(points - a - along[:, None] * (b - a), axis=1) - radius)
    return np.stack(result, axis=1)


@cache
def capsule_man(name: str = "man", drop_deg: float = 0.0, materials: tuple[str, ...] = ("skin",)) -> Rig:
    """The isosurface of a union of capsules; rest stance with the arms `drop_deg` below the horizontal."""
    from skimage.measure import marching_cubes

    drop = np.radians(drop_deg)
    half = np.array([1.0, 1.0, 0.3])
    # An odd number of cells and half a cell of shift: no node lies on the plane of symmetry.
    counts = (2 * np.ceil(half / PITCH) + 2).astype(int)
    low = np.array([0, HEIGHT / 2, 0.05]) - PITCH * (counts - 1) / 2
    nodes = low + PITCH * np.moveaxis(np.indices(counts.tolist()), 0, -1).reshape(-1, 3)
    field = capsule_distances(nodes, drop).min(axis=1).reshape(counts)
    vertices, faces, _, _ = marching_cubes(field, 0.0, gradient_direction="descent")
    vertices = low + PITCH * vertices
    parents = np.array(
        [NAMES.index(KEY_PARENT[n]) if n in KEY_PARENT else -1 for n in KEYS]
        + [NAMES.index("l_hand"), NAMES.index("r_hand")]
    )
    heads = np.array([_placed(n, BONES[_side(n)[0]][0], drop) for n in NAMES])
    near = capsule_distances(vertices, drop)
    # Of two capsules that reach a joint, the nearer one counts most; away from joints one bone has it all.
    order = np.argsort(near, axis=1)[:, :4]
    gap = np.take_along_axis(near, order, axis=1) - near.min(axis=1, keepdims=True)
    weight = np.clip(1.0 - gap / 0.03, 0.0, None)
    weight /= weight.sum(axis=1, keepdims=True)
    key_bone = np.arange(len(KEYS), dtype=np.int32)
    axis = np.zeros((len(NAMES), 3))
    # Palms look down, so the fingers' curl turns ±x to -y.
    for side, sign in (("l", 1.0), ("r", -1.0)):
        axis[NAMES.index(f"{side}_finger")] = [0, 0, -sign]
    joints = [(n, *PLACES[_side(n)[0]]) for n in JOINT_NAMES]
    index = order.astype(np.int32)
    return Rig(
        name=name,
        vertices=vertices,
        faces=faces,
        face_part=face_parts(faces, index, weight, parents, key_bone),
        face_material=(vertices[faces][:, :, 1].mean(axis=1) < 1.3) % len(materials),
        materials=materials,
        bone_index=index,
        bone_weight=weight,
        parents=parents,
        heads=heads,
        key_bone=key_bone,
        rest_direction=rest_directions(heads, key_bone),
        finger_axis=axis.astype(np.float32),
        joint_bone=np.array([NAMES.index(n[:2] + bone if n[:2] in ("l_", "r_") else bone) for n, bone, _ in joints]),
        joint_rest=np.array([_placed(n, x, drop, bone) for n, bone, x in joints]),
    )


@cache
def bodies() -> AnnyBodies:
    """The man as a family: wider or narrower, with longer or shorter legs; and his skirt, an open tube."""
    rig = capsule_man("anny", 20.0)
    turn, height = np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(1.0, 0.5, 7)
    radius = 0.2 + 0.2 * (1.0 - height)
    skirt = np.stack([radius[:, None] * np.sin(turn), height[:, None] + 0 * turn, radius[:, None] * np.cos(turn)], -1)
    skirt = skirt.reshape(-1, 3)
    i, j = np.meshgrid(np.arange(6), np.arange(24), indexing="ij")
    a, b = 24 * i + j, 24 * i + (j + 1) % 24
    skirt_faces = np.concatenate([np.stack([a, a + 24, b], -1), np.stack([b, a + 24, b + 24], -1)]).reshape(-1, 3)
    share = np.clip((1.0 - skirt[:, 1]) * 2, 0, 1)[:, None] * np.stack([skirt[:, 0] > 0, skirt[:, 0] <= 0], axis=1)
    hung = [NAMES.index(n) for n in ("hips", "l_upper_leg", "r_upper_leg", "hips")]

    def moved(points: NDArray[np.floating]) -> NDArray[np.float32]:
        """(2, N, 3): both shapes are linear in the place, so bones, joints and skin stay together."""
        zero = 0.0 * points[:, 0]
        return np.stack(
            [np.stack([0.06 * points[:, 0], zero, zero], 1), np.stack([zero, 0.03 * points[:, 1], zero], 1)]
        ).astype(np.float32)

    corner = rig.vertices[rig.faces]
    return AnnyBodies(
        rig=rig,
        shapes=moved(np.concatenate([rig.vertices, rig.heads, rig.joint_rest])),
        skirt=skirt.astype(np.float32),
        skirt_faces=skirt_faces,
        skirt_shapes=moved(skirt),
        skirt_index=np.tile(hung, (len(skirt), 1)),
        skirt_weight=np.column_stack([1 - share.sum(axis=1), share, np.zeros(len(skirt))]),
        uv=np.stack([0.5 + 0.5 * corner[..., 0], 1 - corner[..., 1] / HEIGHT], axis=-1),
        full=rig.vertices,
    )


def vertex_part(rig: Rig) -> NDArray[np.uint8]:
    """(V,) part label of a face at each vertex."""
    part = np.zeros(len(rig.vertices), np.uint8)
    part[rig.faces.ravel()] = np.repeat(rig.face_part, 3)
    return part


@cache
def wardrobe() -> tuple[Garment, ...]:
    """Clothes and shoes for training ("coat", "shoes") and for unseen people ("suit", "boots"); hair for all."""
    rig = bodies().rig
    part = vertex_part(rig)

    def made(name: str, kind: str, parts: tuple[str, ...], offset: NDArray[np.float64]) -> Garment:
        covered = np.isin(part, [PART[p] for p in parts])
        return Garment(name, kind, np.where(covered[:, None], offset, 0.0), covered)

    along = np.array([0.015, 0, 0])
    arms = ("torso", "l_upper_arm", "r_upper_arm")
    return (
        made("coat", "cloth", arms, along),
        made("suit", "cloth", (*arms, "l_upper_leg", "r_upper_leg"), along),
        made("shoes", "shoe", ("l_foot", "r_foot"), np.array([0, 0, 0.01])),
        made("boots", "shoe", ("l_foot", "r_foot"), np.array([0, 0, 0.02])),
        made("made-hair", "hair", ("head",), np.array([0, 0.02, 0])),
    )


@cache
def poses(clip: str, count: int, seed: int) -> PoseSet:
    """Random stances, each a clip of its own."""
    rng = np.random.default_rng(seed)
    _, rotations = stances(count, rng)
    curl = rng.uniform(0, 1, (count, 2)).astype(np.float32)
    return PoseSet(np.array([f"{clip}/{k}" for k in range(count)]), rotations.astype(np.float32), curl)


@cache
def capsule_pack() -> Pack:
    """With "Ann", a character for training, and "Ida", one that training never sees."""
    colours = np.array([[0.9, 0.7, 0.6], [0.8, 0.1, 0.1]], np.float32)
    stances = {"Ann": 0.0, "Ida": 50.0}
    people = (capsule_man(name, drop_deg, ("skin", "cloth.body.red")) for name, drop_deg in stances.items())
    characters = tuple(Character(rig, colours) for rig in people)
    return Pack(bodies(), wardrobe(), characters, poses("seen", 8, 1), poses("unseen", 4, 2))
