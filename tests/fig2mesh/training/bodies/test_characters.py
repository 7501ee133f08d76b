"""Characters: open, overlapping pieces become one closed, skinned body."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fig2mesh.errors import InputError
from fig2mesh.mesh.topology import check_solid, face_components
from fig2mesh.records import Mesh
from fig2mesh.skeleton import BODY_PARTS, FIGURE_HEIGHT, JOINT, PART
from fig2mesh.training.bodies.character_file import BONES
from fig2mesh.training.bodies.characters import one_region_each, read_character
from fig2mesh.training.bodies.rig import KEY, KEYS, T_POSE, Rig, bone_rotations, pose
from fig2mesh.training.bodies.solidify import Winding, solidify

DATA = Path(__file__).resolve().parents[5] / "shared" / "data" / "quaternius_modular_cc0"


def _tube(first: Any, last: Any, radius: float, steps: int = 8) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """An open tube of `steps` rings between two points, its triangles counter-clockwise from outside."""
    first, last = np.asarray(first, float), np.asarray(last, float)
    way = (last - first) / np.linalg.norm(last - first)
    side = np.cross(way, np.eye(3)[int(np.abs(way).argmin())])
    side /= np.linalg.norm(side)
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)[:, None]
    ring = radius * (np.cos(turn) * side + np.sin(turn) * np.cross(way, side))
    x = (first + np.linspace(0, 1, steps)[:, None] * (last - first))[:, None] + ring
    i, j = np.meshgrid(np.arange(steps - 1), np.arange(12), indexing="ij")
    a, b, c, d = (12 * (i + p) + (j + q) % 12 for p, q in ((0, 0), (0, 1), (1, 0), (1, 1)))
    faces = np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    return x.reshape(-1, 3), faces


def _ball(centre: Any, radius: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return np.asarray(ball.vertices) + centre, np.asarray(ball.faces)


def _limbs() -> dict[str, tuple[list[float], list[float], float]]:
    """Bone → where it starts and ends, and how thick it is, of a stick man 2 m wide."""
    limbs: dict[str, tuple[list[float], list[float], float]] = {
        "Hips": ([0, 1.0, 0], [0, 1.1, 0], 0.14),
        "Abdomen": ([0, 1.1, 0], [0, 1.2, 0], 0.14),
        "Torso": ([0, 1.2, 0], [0, 1.3, 0], 0.14),
        "Chest": ([0, 1.3, 0], [0, 1.5, 0], 0.14),
        "Neck": ([0, 1.5, 0], [0, 1.6, 0], 0.06),
        "Head": ([0, 1.6, 0], [0, 1.8, 0], 0.12),
    }
    for side, s in (("L", 1), ("R", -1)):
        for bone, first, last, radius in (
            ("Shoulder", [0.02, 1.42, 0], [0.15, 1.42, 0], 0.05),
            ("UpperArm", [0.15, 1.42, 0], [0.4, 1.42, 0], 0.05),
            ("LowerArm", [0.4, 1.42, 0], [0.65, 1.42, 0], 0.045),
            ("Hand", [0.65, 1.42, 0], [0.75, 1.42, 0], 0.04),
            ("Index1", [0.75, 1.42, 0.04], [0.82, 1.42, 0.04], 0.014),
            ("Middle1", [0.75, 1.42, 0.0], [0.82, 1.42, 0], 0.014),
            ("Pinky1", [0.75, 1.42, -0.04], [0.82, 1.42, -0.04], 0.014),
            ("UpperLeg", [0.1, 1.0, 0], [0.1, 0.5, 0], 0.08),
            ("LowerLeg", [0.1, 0.5, 0], [0.1, 0.04, 0], 0.06),
            ("Foot", [0.1, 0.04, 0], [0.1, 0.04, 0.16], 0.05),
        ):
            limbs[f"{bone}.{side}"] = ([s * first[0], *first[1:]], [s * last[0], *last[1:]], radius)
    return limbs


def _parent(bone: str) -> str:
    stem, dot, side = bone.partition(".")
    above = {
        "Abdomen": "Hips",
        "Torso": "Abdomen",
        "Chest": "Torso",
        "Neck": "Chest",
        "Head": "Neck",
        "Shoulder": "Chest",
        "UpperArm": "Shoulder",
        "LowerArm": "UpperArm",
        "Hand": "LowerArm",
        "UpperLeg": "Root",
        "LowerLeg": "UpperLeg",
        "Foot": "LowerLeg",
        "Hips": "Root",
    }.get(stem, "Hand")
    return above + dot + side if above not in ("Chest", "Hips", "Root", "Abdomen", "Torso", "Neck") else above


def _write_stick_man(path: Path) -> None:
    """A GLB of open tubes, one a bone, in two pieces; the thighs hang on the root as in some files of the set."""
    limbs = _limbs()
    names = ["Root", *limbs]
    heads = {"Root": np.zeros(3), **{bone: np.array(first, float) for bone, (first, _, _) in limbs.items()}}
    nodes: list[dict[str, Any]] = [{"name": name} for name in names]
    for bone in limbs:
        parent = _parent(bone)
        nodes[names.index(parent)].setdefault("children", []).append(names.index(bone))
        nodes[names.index(bone)]["translation"] = (heads[bone] - heads[parent]).tolist()
    binary, views, accessors = b"", [], []

    def put(array: NDArray[Any], kind: str, component: int) -> int:
        nonlocal binary
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(array), "type": kind})
        binary += array.tobytes() + b"\0" * (-array.nbytes % 4)
        return len(accessors) - 1

    inverse = np.tile(np.eye(4), (len(names), 1, 1))
    inverse[:, :3, 3] = [-heads[name] for name in names]
    skin = {
        "joints": list(range(len(names))),
        "inverseBindMatrices": put(inverse.transpose(0, 2, 1).reshape(-1, 16).astype("<f4"), "MAT4", 5126),
    }
    meshes = []
    for piece, of_head in (("Stick_Body", False), ("Stick_Head", True)):
        primitives = []
        for bone, (first, last, radius) in limbs.items():
            if of_head != (bone == "Head"):
                continue
            reach = np.array(last, float) - first
            x, faces = (
                _ball(np.array(first) + [0, 0.1, 0], 0.12) if of_head else _tube(first - 0.04 * reach, last, radius)
            )
            joint = np.zeros((len(x), 4), "<u2")
            joint[:, 0] = names.index(bone)
            weight = np.zeros((len(x), 4), "<f4")
            # The hips come without weights, as the legs of one file do.
            weight[:, 0] = np.nan if bone == "Hips" else 1.0
            primitives.append(
                {
                    "attributes": {
                        "POSITION": put(x.astype("<f4"), "VEC3", 5126),
                        "JOINTS_0": put(joint, "VEC4", 5123),
                        "WEIGHTS_0": put(weight, "VEC4", 5126),
                    },
                    "indices": put(faces.reshape(-1, 1).astype("<u4"), "SCALAR", 5125),
                    "material": int(of_head),
                }
            )
        meshes.append({"primitives": primitives})
        nodes.append({"name": piece, "mesh": len(meshes) - 1, "skin": 0})
    document = {
        "asset": {"version": "2.0"},
        "nodes": nodes,
        "skins": [skin],
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
        "materials": [
            {"name": "Red", "pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.0, 0.214, 1.0]}},
            {"name": "Skin"},
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


@pytest.fixture(scope="module")
def stick_man(tmp_path_factory: pytest.TempPathFactory) -> tuple[Rig, NDArray[np.float32]]:
    path = tmp_path_factory.mktemp("characters") / "stick.glb"
    _write_stick_man(path)
    return read_character(path, faces=4000, voxel=0.012)


def _check_rig(rig: Rig) -> None:
    report = check_solid(Mesh(rig.vertices, rig.faces))
    assert report.outward
    assert report.components == 1
    assert np.ptp(rig.vertices[:, 1]) == pytest.approx(FIGURE_HEIGHT, abs=0.03)
    np.testing.assert_allclose(rig.bone_weight.sum(axis=1), 1, atol=1e-5)
    assert rig.face_material.max() < len(rig.materials)
    for part in BODY_PARTS:
        assert face_components(rig.faces[rig.face_part == part]).max() == 0
    limb = T_POSE.any(axis=1)
    np.testing.assert_allclose(np.linalg.norm(rig.rest_direction, axis=1), limb, atol=1e-5)


def test_open_pieces_become_one_closed_body(stick_man: tuple[Rig, NDArray[np.float32]]) -> None:
    rig, colours = stick_man
    _check_rig(rig)
    assert rig.materials == ("cloth.body.red", "skin")
    np.testing.assert_allclose(colours[0], [1, 0, 0.5], atol=0.01)
    assert set(rig.face_material[rig.face_part == PART["l_foot"]]) == {0}
    assert rig.parents[rig.key_bone[KEY["l_upper_leg"]]] == rig.key_bone[KEY["hips"]]


def test_identity_pose_is_the_t_pose_and_a_bent_elbow_moves_the_wrist(
    stick_man: tuple[Rig, NDArray[np.float32]],
) -> None:
    rig, _ = stick_man
    rotations = np.tile(np.eye(3), (len(KEYS), 1, 1))
    _, joints = pose(rig, rotations, np.zeros(2))
    upper = joints[JOINT["l_elbow"]] - joints[JOINT["l_shoulder"]]
    np.testing.assert_allclose(upper / np.linalg.norm(upper), [1, 0, 0], atol=1e-5)
    up = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    for key in ("l_lower_arm", "l_hand"):
        rotations[KEY[key]] = up
    vertices, bent = pose(rig, rotations, np.zeros(2))
    lower = bent[JOINT["l_wrist"]] - bent[JOINT["l_elbow"]]
    np.testing.assert_allclose(lower / np.linalg.norm(lower), [0, 1, 0], atol=1e-5)
    np.testing.assert_allclose(bent[JOINT["r_wrist"]], joints[JOINT["r_wrist"]], atol=1e-6)
    hand = vertices[np.unique(rig.faces[rig.face_part == PART["l_hand"]])]
    assert np.linalg.norm(hand.mean(axis=0) - bent[JOINT["l_hand"]]) < 0.05


@pytest.mark.parametrize("side", ["l", "r"])
def test_positive_curl_bends_fingers_to_the_palm(stick_man: tuple[Rig, NDArray[np.float32]], side: str) -> None:
    rig, _ = stick_man
    turned = bone_rotations(rig, np.tile(np.eye(3), (len(KEYS), 1, 1)), np.full(2, 1.0))
    fingers = [
        b for b in np.flatnonzero(rig.finger_axis.any(axis=1)) if rig.parents[b] == rig.key_bone[KEY[f"{side}_hand"]]
    ]
    assert len(fingers) == 3
    for bone in fingers:
        assert (turned[bone] @ T_POSE[KEY[f"{side}_hand"]])[1] < -0.7


def test_winding_number_agrees_with_geometry() -> None:
    x, faces = _ball(np.zeros(3), 0.5)
    winding = Winding(x[faces])
    points = np.random.default_rng(0).uniform(-0.8, 0.8, (500, 3))
    radius = np.linalg.norm(points, axis=1)
    clear = np.abs(radius - 0.5) > 0.02
    # Far clusters count as dipoles, hence the tolerance.
    np.testing.assert_allclose(winding(points[clear]), radius[clear] < 0.5, atol=0.02)


def test_loose_pieces_and_sheets_join_the_body() -> None:
    ball, faces = _ball(np.zeros(3), 0.2)
    other, _ = _ball(np.array([0.5, 0, 0]), 0.1)
    sheet = np.array([[[-0.1, 0.15, 0], [0.1, 0.15, 0], [0, 0.5, 0]]])
    mesh, visible = solidify(np.concatenate([ball[faces], other[faces], sheet]), 0.015)
    report = check_solid(mesh)
    assert report.outward
    assert report.components == 1
    assert report.genus == 0
    assert mesh.vertices[:, 0].max() == pytest.approx(0.6, abs=0.015)
    assert mesh.vertices[:, 1].max() == pytest.approx(0.5, abs=0.03)
    assert visible[-1]


def test_islands_take_the_label_round_them() -> None:
    x, faces = _ball(np.zeros(3), 1.0)
    middle = x[faces].mean(axis=1)
    label = np.where(middle[:, 1] > 0, 1, 2)
    speckled = label.copy()
    speckled[middle[:, 1].argmax()] = 2
    np.testing.assert_array_equal(one_region_each(speckled, faces.astype(np.int32)), label)


def test_a_file_without_the_bones_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.glb"
    _write_stick_man(path)
    path.write_bytes(path.read_bytes().replace(b"Abdomen", b"Abdomxn"))
    with pytest.raises(InputError, match="Abdomen"):
        read_character(path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["modular_men_King", "modular_women_Adventurer", "modular_women_Witch"])
def test_real_characters(name: str) -> None:
    path = DATA / f"{name}.glb"
    if not path.exists():
        pytest.skip("the characters are not here")
    rig, colours = read_character(path)
    _check_rig(rig)
    assert colours.shape == (len(rig.materials), 3)
    assert set(BONES) == set(KEYS)
    arm = rig.vertices[np.unique(rig.faces[rig.face_part == PART["l_lower_arm"]])]
    assert arm[:, 0].min() > 0.25
