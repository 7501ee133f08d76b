"""Character files: every skinned triangle at rest, its material and its bone weights."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from exporters.colour import srgb_from_linear
from fig2mesh.errors import InputError
from fig2mesh.skeleton import FIGURE_HEIGHT
from fig2mesh.training.bodies.gltf_scene import GltfScene, read_scene

# fmt: off
BONES: dict[str, str] = {
    "hips": "Hips", "spine1": "Abdomen", "spine2": "Torso", "spine3": "Chest", "neck": "Neck", "head": "Head",
    **{f"{side.lower()}_{key}": f"{bone}.{side}" for side in "LR" for key, bone in (
        ("clavicle", "Shoulder"), ("upper_arm", "UpperArm"), ("lower_arm", "LowerArm"), ("hand", "Hand"),
        ("upper_leg", "UpperLeg"), ("lower_leg", "LowerLeg"), ("foot", "Foot"))},
}
# fmt: on
"""Key → name of the bone in the files."""


DIGIT = re.compile(r"(Index|Middle|Ring|Pinky|Thumb)\d\.[LR]")


BROW_TRIANGLES = 40


EYE_TRIANGLES = (24, 64)
"""Numbers of triangles of the eyes, and of eyes with brows, which all these heads share."""


# fmt: off
DYED = frozenset({
    ("Punk", "Red"), ("Punk", "Red_Dark"), ("Punk", "Pink"), ("Formal", "Red"), ("Medieval", "White"),
    ("SciFi", "Blue"), ("Worker", "DarkBrown"),
})
# fmt: on
"""Piece and material of hair whose material is named after its colour."""


class Soup(NamedTuple):
    """Triangle soup of a character at rest, BODY.

    corners : (F, 3, 3) float64; weights : (F, 3, B) float32 of each corner, rows sum to 1
    material : (F,) index into materials; materials : kinds as `Rig` names them; colours : (M, 3) float32 sRGB
    names, parents, heads : of the B bones, parents first
    """

    corners: NDArray[np.float64]
    weights: NDArray[np.float32]
    material: NDArray[np.int64]
    materials: tuple[str, ...]
    colours: NDArray[np.float32]
    names: tuple[str, ...]
    parents: NDArray[np.int32]
    heads: NDArray[np.float64]


# ---------------------------------------------------------------- reading
def read_soup(path: Path) -> Soup:
    """Read every skinned triangle of a character file in rest pose, scaled to `FIGURE_HEIGHT`, with hat and hair."""
    scene = read_scene(path)
    names, parents, bone_of = _skeleton(scene, path)
    placed = scene.global_matrices()
    heads = placed[[scene.names.index(name) for name in names], :3, 3]
    corners, weights, material = [], [], []
    found: dict[tuple[str, str], NDArray[np.float64]] = {}
    for node in scene.document["nodes"]:
        if "mesh" not in node or "skin" not in node:
            continue
        skin = scene.document["skins"][node["skin"]]
        inverse = scene.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
        skinned = placed[skin["joints"]] @ inverse
        for primitive in scene.document["meshes"][node["mesh"]]["primitives"]:
            attributes = primitive["attributes"]
            x = scene.accessor(attributes["POSITION"])
            index = scene.accessor(primitive["indices"]).astype(int).reshape(-1, 3)
            joint = scene.accessor(attributes["JOINTS_0"]).astype(int)
            w = np.nan_to_num(scene.accessor(attributes["WEIGHTS_0"]))
            lost = w.sum(axis=1) < 1e-6
            # Where weights are missing, any joint places the vertex: at rest all of them agree.
            w[lost, 0] = 1.0
            w /= w.sum(axis=1, keepdims=True)
            blend = np.einsum("vk,vkij->vij", w, skinned[joint])
            x = np.einsum("vij,vj->vi", blend[:, :3, :3], x) + blend[:, :3, 3]
            full = np.zeros((len(x), len(names)), np.float32)
            for slot in range(4):
                np.add.at(full, (np.arange(len(x)), bone_of[np.asarray(skin["joints"])[joint[:, slot]]]), w[:, slot])
            if lost.any():
                full[lost] = _guessed_weights(x[lost], names, heads)
            paint = scene.document["materials"][primitive["material"]] if "material" in primitive else {}
            key = (_kind(node.get("name", ""), paint.get("name", ""), len(index)), paint.get("name", ""))
            factor = paint.get("pbrMetallicRoughness", {}).get("baseColorFactor", [0.8, 0.8, 0.8])
            found.setdefault(key, np.asarray(factor[:3], np.float64).clip(0, 1))
            corners.append(x[index])
            weights.append(full[index])
            material.append(np.full(len(index), list(found).index(key)))
    if not corners:
        raise InputError(path.name, "no skinned mesh in it", "give a character, not an animation file")
    shape = np.concatenate(corners)
    real = np.linalg.norm(np.cross(shape[:, 1] - shape[:, 0], shape[:, 2] - shape[:, 0]), axis=1) > 1e-12
    scale = FIGURE_HEIGHT / np.ptp(shape[..., 1])
    linear = np.array(list(found.values()))
    srgb = srgb_from_linear(linear)
    return Soup(
        shape[real] * scale,
        np.concatenate(weights)[real],
        np.concatenate(material)[real],
        tuple(kind for kind, _ in found),
        srgb.astype(np.float32),
        names,
        parents,
        heads * scale,
    )


def _skeleton(scene: GltfScene, path: Path) -> tuple[tuple[str, ...], NDArray[np.int32], NDArray[np.int64]]:
    """Names and parents of the bones that are kept, parents first, and (nodes,) bone that each node belongs to."""
    missing = sorted(set(BONES.values()) - set(scene.names))
    if missing:
        raise InputError(path.name, f"no bone {missing[0]!r}", "give a character with Quaternius' bone names")
    kept = {node for node in scene.order if scene.names[node] in BONES.values() or DIGIT.fullmatch(scene.names[node])}
    hips = scene.names.index("Hips")

    def holder(node: int) -> int:
        # In some files the thighs hang on the root, beside the hips; a pose must carry them along with these.
        while node >= 0 and node not in kept:
            node = scene.parents[node]
        return node if node >= 0 else hips

    above = {node: -1 if node == hips else holder(scene.parents[node]) for node in kept}
    order = [hips]
    for node in order:  # grows while it is walked
        order += [child for child in scene.order if above.get(child) == node]
    rank = {node: bone for bone, node in enumerate(order)}
    parents = np.array([rank.get(above[node], -1) for node in order], np.int32)
    bone_of = np.array([rank[holder(node)] for node in range(len(scene.names))])
    return tuple(scene.names[node] for node in order), parents, bone_of


def _kind(piece: str, label: str, triangles: int) -> str:
    """Kind of a material from its piece of the file, its name and, for hair and eyes with a cloth's name, its size."""
    on_head = piece.endswith("_Head")
    if label.startswith("Skin"):
        return "skin"
    if re.match("Hair|Moustache|Eyebrow", label) or (on_head and triangles == BROW_TRIANGLES):
        return "hair"
    if label == "Eye" or (on_head and triangles in EYE_TRIANGLES):
        return "eye"
    if on_head:
        return "hair" if (piece.removesuffix("_Head"), label) in DYED else "hat"
    return "shoe" if piece.endswith("_Feet") else f"cloth.{piece.rsplit('_', 1)[-1].lower()}.{label.lower()}"


def _guessed_weights(x: NDArray[np.float64], names: tuple[str, ...], heads: NDArray[np.float64]) -> NDArray[np.float32]:
    """(N, B) weights of vertices that have none in the file: by closeness to the bones of hips, back and legs."""
    ends = [("Hips", "Abdomen"), ("Abdomen", "Torso")]
    ends += [(f"{a}.{s}", f"{b}.{s}") for s in "LR" for a, b in (("UpperLeg", "LowerLeg"), ("LowerLeg", "Foot"))]
    full = np.zeros((len(x), len(names)), np.float32)
    for first, last in ends:
        a, b = heads[names.index(first)], heads[names.index(last)]
        along = ((x - a) @ (b - a) / ((b - a) @ (b - a))).clip(0, 1)[:, None]
        full[:, names.index(first)] = np.linalg.norm(x - a - along * (b - a), axis=1) ** -8.0
    return np.asarray(full / full.sum(axis=1, keepdims=True), np.float32)
