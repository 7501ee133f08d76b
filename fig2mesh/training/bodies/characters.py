"""Dressed cartoon characters as closed, skinned bodies.

A character file (glTF binary, Quaternius' modular people, CC0) holds several skinned pieces: body, legs, feet, head.
They overlap, are open where they meet, and some are mere sheets. One solid is made of them (`solidify`) and
simplified; every vertex of it takes the skin weights of the nearest visible triangle.

Measured on one core at voxels of 0.008 (0.012 loses fingertips and thin hoods): 2 to 4.5 s per character.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.errors import InputError
from fig2mesh.mesh.simplify import simplify
from fig2mesh.mesh.topology import check_solid, edge_pairs
from fig2mesh.records import Mesh
from fig2mesh.skeleton import JOINT_NAMES, PART, PART_NAMES
from fig2mesh.training.bodies.character_file import BONES, DIGIT, Soup, read_soup
from fig2mesh.training.bodies.rig import KEY, KEY_PARENT, KEYS, T_POSE, Rig
from fig2mesh.training.bodies.solidify import SoupSurface, solidify

ANKLE = 0.061
"""Height of the ankle above the start of the foot's bone, FIGURE units."""

THORAX = 0.1
"""Position of the thorax joint between the line of the shoulders (0) and that of the hips (1)."""

SMOOTHINGS = 2
"""Number of times that skin weights are averaged with their neighbours'."""


def read_character(path: Path, *, faces: int = 12000, voxel: float = 0.008) -> tuple[Rig, NDArray[np.float32]]:
    """Read a character file as one closed, skinned body of about `faces` triangles and the colours of its materials.

    voxel : pitch of the grid on which the solid is made, FIGURE units
    """
    soup = read_soup(path)
    mesh, visible = solidify(soup.corners, voxel)
    mesh = simplify(mesh, faces)
    if not check_solid(mesh).outward:
        raise InputError(str(path), "its pieces do not make a closed body", "leave this character out")
    return bind(path.stem, mesh, soup, visible), soup.colours


# ---------------------------------------------------------------- binding
def bind(name: str, mesh: Mesh, soup: Soup, visible: NDArray[np.bool_]) -> Rig:
    """Return the rig of a closed mesh, with skin and materials from the `visible` (F,) triangles of its soup."""
    surface, seen = SoupSurface(soup.corners[visible]), np.flatnonzero(visible)
    triangle, part = surface.nearest(mesh.vertices)
    weights = _smoothed(np.einsum("vc,vcb->vb", part, soup.weights[seen[triangle]]), mesh.faces)
    strongest = np.argsort(-weights, axis=1)[:, :4]
    kept = np.take_along_axis(weights, strongest, axis=1)
    key_bone = np.array([soup.names.index(BONES[key]) for key in KEYS])
    heads, bones = soup.heads, {key: soup.names.index(bone) for key, bone in BONES.items()}
    joints = _joints(soup, bones)
    face_material = soup.material[seen[surface.nearest(mesh.vertices[mesh.faces].mean(axis=1))[0]]]
    return Rig(
        name=name,
        vertices=mesh.vertices,
        faces=mesh.faces,
        face_part=_parts(weights, mesh.faces, soup, bones),
        face_material=face_material.astype(np.uint8),
        materials=soup.materials,
        bone_index=strongest.astype(np.int32),
        bone_weight=(kept / kept.sum(axis=1, keepdims=True)).astype(np.float32),
        parents=soup.parents,
        heads=heads.astype(np.float32),
        key_bone=key_bone.astype(np.int32),
        rest_direction=_directions(heads, bones).astype(np.float32),
        finger_axis=_finger_axes(soup, bones).astype(np.float32),
        joint_bone=np.array([bones[joints[joint][0]] for joint in JOINT_NAMES], np.int32),
        joint_rest=np.array([joints[joint][1] for joint in JOINT_NAMES], np.float32),
    )


def _smoothed(weights: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float32]:
    """(V, B) weights, averaged with their neighbours': the nearest triangle changes suddenly in clefts."""
    from scipy.sparse import coo_matrix

    rows, columns = faces.reshape(-1), np.roll(faces, 1, axis=1).reshape(-1)
    beside = coo_matrix((np.ones(len(rows), np.float32), (rows, columns)), shape=(len(weights),) * 2).tocsr()
    degree = np.asarray(beside.sum(axis=1))
    for _ in range(SMOOTHINGS):
        weights = 0.5 * weights + 0.5 * (beside @ weights) / degree
    return weights


def _parts(
    weights: NDArray[np.float32], faces: NDArray[np.int32], soup: Soup, bones: dict[str, int]
) -> NDArray[np.uint8]:
    """(F,) body part of each face, each part in one connected region."""
    part_of_key = {key: PART[key] if key in PART else PART["torso"] for key in KEYS} | {"neck": PART["head"]}
    part_of_bone = np.zeros(len(soup.names), int)
    keyed = {bone: part_of_key[key] for key, bone in bones.items()}
    for bone, parent in enumerate(soup.parents):
        part_of_bone[bone] = keyed.get(bone, part_of_bone[parent])
    votes = np.zeros((len(weights), len(PART_NAMES)), np.float32)
    for bone, part in enumerate(part_of_bone):
        votes[:, part] += weights[:, bone]
    label = votes[faces].sum(axis=1).argmax(axis=1)
    return one_region_each(label, faces).astype(np.uint8)


def one_region_each(label: NDArray[Any], faces: NDArray[np.int32]) -> NDArray[np.int64]:
    """(F,) labels of which each keeps its largest connected region; the other regions take a label around them."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    first, second = (side // 3 for side in edge_pairs(faces))
    same = label[first] == label[second]
    links = coo_matrix((np.ones(same.sum()), (first[same], second[same])), shape=(len(faces),) * 2)
    count, region = connected_components(links, directed=False)
    size = np.bincount(region, minlength=count)
    keep = np.zeros(len(faces), bool)
    for value in np.unique(label):
        mine = np.unique(region[label == value])
        keep |= region == mine[size[mine].argmax()]
    result = np.where(keep, label, 0).astype(np.int64)
    while (result == 0).any():
        votes = np.zeros((len(faces), len(PART_NAMES)), int)
        np.add.at(votes, (first, result[second]), 1)
        np.add.at(votes, (second, result[first]), 1)
        votes[:, 0] = 0
        fresh = (result == 0) & votes.any(axis=1)
        if not fresh.any():
            break
        result[fresh] = votes[fresh].argmax(axis=1)
    return result


def _directions(heads: NDArray[np.float64], bones: dict[str, int]) -> NDArray[np.float64]:
    """(20, 3) unit direction of each limb at rest; a hand has that of its lower arm."""
    result = np.zeros((len(KEYS), 3))
    for key in KEYS:
        if T_POSE[KEY[key]].any():
            limb = KEY_PARENT[key] if key.endswith("hand") else key
            end = next(child for child, parent in KEY_PARENT.items() if parent == limb)
            way = heads[bones[end]] - heads[bones[limb]]
            result[KEY[key]] = way / np.linalg.norm(way)
    return result


def _finger_axes(soup: Soup, bones: dict[str, int]) -> NDArray[np.float64]:
    """(B, 3) unit axis that bends each finger bone towards the palm; thumbs stay as they are."""
    result = np.zeros((len(soup.names), 3))
    for side in "lr":
        hand = bones[f"{side}_hand"]
        fingers = [b for b, name in enumerate(soup.names) if DIGIT.fullmatch(name) and name.endswith(side.upper())]
        fingers = [bone for bone in fingers if not soup.names[bone].startswith("Thumb")]
        roots = [bone for bone in fingers if soup.parents[bone] == hand]
        way = {soup.names[bone].rstrip(".LR0123456789"): soup.heads[bone] - soup.heads[hand] for bone in roots}
        palm = np.cross(way["Index"], way["Pinky"])
        # At rest the arms are out at the sides and the palms look down.
        palm *= -1.0 if palm[1] > 0 else 1.0
        axis = np.cross(way["Middle"], palm)
        result[fingers] = axis / np.linalg.norm(axis)
    return result


def _joints(soup: Soup, bones: dict[str, int]) -> dict[str, tuple[str, NDArray[np.float64]]]:
    """Joint → key whose bone it belongs to, and its position at rest."""
    at = {key: soup.heads[bone] for key, bone in bones.items()}
    joints = {"neck": ("neck", (at["neck"] + at["head"]) / 2)}
    kind = np.array(soup.materials)[soup.material]
    on_head = soup.weights[:, :, bones["head"]].min(axis=1) > 0.6
    head = soup.corners[on_head].reshape(-1, 3)
    skin = soup.corners[on_head & (kind == "skin")].reshape(-1, 3)
    hairy = soup.corners[on_head & ((kind == "skin") | (kind == "hair"))].reshape(-1, 3)
    if not len(skin):
        skin = hairy = head
    # Hair counts above the face and behind it only: braids and beards hang below the skull.
    low = np.array([skin[:, 0].min(), skin[:, 1].min(), hairy[:, 2].min()])
    high = np.array([skin[:, 0].max(), hairy[:, 1].max(), skin[:, 2].max()])
    joints["head"] = ("head", (low + high) / 2)
    eyes = soup.corners[on_head & (kind == "eye")].reshape(-1, 3)
    forward = np.array([0, 0, 0.3 * (high[1] - low[1])])
    joints["eyes"] = ("head", (eyes.min(axis=0) + eyes.max(axis=0)) / 2 if len(eyes) else joints["head"][1] + forward)
    for side in "lr":
        for joint, key in (
            ("shoulder", "upper_arm"),
            ("elbow", "lower_arm"),
            ("wrist", "hand"),
            ("hip", "upper_leg"),
            ("knee", "lower_leg"),
        ):
            joints[f"{side}_{joint}"] = (f"{side}_{key}", at[f"{side}_{key}"])
        middle = next(b for b, n in enumerate(soup.names) if re.fullmatch(rf"Middle\d\.{side.upper()}", n))
        joints[f"{side}_hand"] = (f"{side}_hand", 0.4 * at[f"{side}_hand"] + 0.6 * soup.heads[middle])
        # The rig's foot bone starts at the sole.
        shin = at[f"{side}_lower_leg"] - at[f"{side}_foot"]
        ankle = at[f"{side}_foot"] + ANKLE * shin / np.linalg.norm(shin)
        joints[f"{side}_ankle"] = (f"{side}_lower_leg", ankle)
        foot = soup.corners[soup.weights[:, :, bones[f"{side}_foot"]] > 0.6]
        if not len(foot):
            foot = ankle + np.array([[0, -ANKLE / 2, 0], [0, -ANKLE / 2, 2 * ANKLE]])
        front = foot[foot[:, 2] > foot[:, 2].min() + 0.6 * np.ptp(foot[:, 2])]
        joints[f"{side}_foot"] = (f"{side}_foot", (front.min(axis=0) + front.max(axis=0)) / 2)
    shoulders, hips = ((joints[f"l_{joint}"][1] + joints[f"r_{joint}"][1]) / 2 for joint in ("shoulder", "hip"))
    joints["thorax"] = ("spine3", shoulders + THORAX * (hips - shoulders))
    joints["pelvis"] = ("hips", hips)
    return joints
