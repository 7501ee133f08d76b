"""Motion files, retargeting and the choice of training poses, on clips made here."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from exporters.errors import ExportError
from exporters.gltf.reader import local_matrix
from fig2mesh.errors import FigureError
from fig2mesh.training.bodies import clips as clips_module
from fig2mesh.training.bodies.bullet_clips import read_motion
from fig2mesh.training.bodies.bvh import read_bvh
from fig2mesh.training.bodies.clips import Clip, canonical_joints, collect_poses, farthest_points, held_out, read_clips
from fig2mesh.training.bodies.gltf_scene import read_scene
from fig2mesh.training.bodies.retarget import (
    LIMB_END,
    TWIST_LIMIT_DEG,
    about,
    angle_between,
    face_front,
    limit_head_turn,
    limit_twist,
    mirrored,
    normalise_poses,
    plausible,
    retarget,
    swings,
    twists,
)
from fig2mesh.training.bodies.rig import KEY, KEY_PARENT, KEYS, T_POSE
from fig2mesh.training.bodies.stances import stances

# fmt: off
LIMB_OFFSETS = {  # z up, facing -y, arms half way down: nothing that the canonical T-pose has
    "Arm": (1.5, 0, 0), "ForeArm": (2, 0, -2), "Hand": (1.5, -0.5, -2), "Shoulder": (0.5, 0, 2),
    "UpLeg": (1, 0, -0.5), "Leg": (0.3, 0, -4), "Foot": (0.2, 0.2, -4), "Toe": (0, -1, -0.3),
}
# fmt: on
TRUNK = ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head")


def bvh_text(frames: int, seed: int, reach_deg: float = 30) -> str:
    """A small Mixamo-like skeleton; its frames turn every joint by random angles."""
    columns = 0

    def joint(name: str, offset: tuple[float, ...], *children: str) -> str:
        nonlocal columns
        columns += 3
        inside = f"OFFSET {offset[0]} {offset[1]} {offset[2]}\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
        return f"JOINT {name} {{\n{inside}{''.join(children) or 'End Site { OFFSET 0 0 1 }'}\n}}\n"

    def chain(side: str, *names: str) -> str:
        sign = 1 if side == "Left" else -1
        text = ""
        for name in reversed(names):
            x, y, z = LIMB_OFFSETS[name]
            text = joint(side + name, (sign * x, y, z), text)
        return text

    arms = [chain(side, "Shoulder", "Arm", "ForeArm", "Hand") for side in ("Left", "Right")]
    head = joint("Neck", (0, 0, 2), joint("Head", (0, 0, 1)))
    spine = joint("Spine", (0, 0, 1), joint("Spine1", (0, 0, 1), joint("Spine2", (0, 0, 1), *arms, head)))
    legs = [chain(side, "UpLeg", "Leg", "Foot", "Toe") for side in ("Left", "Right")]
    channels = "Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    root = f"ROOT Hips {{ OFFSET 0 0 0 CHANNELS 6 {channels}\n{spine}{''.join(legs)}}}\n"
    values = np.random.default_rng(seed).uniform(-reach_deg, reach_deg, (frames, columns + 6))
    rows = "\n".join(" ".join(f"{v:.5f}" for v in row) for row in values)
    return f"HIERARCHY\n{root}MOTION\nFrames: {frames}\nFrame Time: 0.04\n{rows}\n"


def write_glb(path: Path, *, clip: str = "Armature|Turn") -> None:
    """Three nodes in a row; the clip turns the first from 0 to 90 degrees about z, scale 2 sits on the second."""
    half = np.sqrt(0.5)
    keys = np.array([[0, 0, 0, 1], [0, 0, half, half]], "<f4")
    binary = np.array([0, 2], "<f4").tobytes() + keys.tobytes() + np.array([0, 255, 127, 0], np.uint8).tobytes()
    document = {
        "asset": {"version": "2.0"},
        "nodes": [
            {"name": "end", "translation": [1, 0, 0]},
            {"name": "root", "children": [2]},
            {"name": "middle", "translation": [1, 0, 0], "scale": [2, 2, 2], "children": [0]},
        ],
        "buffers": [{"byteLength": len(binary)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 8},
            {"buffer": 0, "byteOffset": 8, "byteLength": 32},
            {"buffer": 0, "byteOffset": 40, "byteLength": 4},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC4"},
            {"bufferView": 2, "componentType": 5121, "count": 1, "type": "VEC4", "normalized": True},
        ],
        "animations": [
            {
                "name": clip,
                "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}],
                "samplers": [{"input": 0, "output": 1}],
            }
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


@pytest.fixture
def assets(tmp_path: Path) -> Path:
    folder = tmp_path / "assets" / "made_bvh"
    folder.mkdir(parents=True)
    for index in range(14):
        (folder / f"motion{index}.bvh").write_text(bvh_text(30, index))
    write_glb(folder / "other.glb")  # a skeleton nobody knows is passed over
    return folder.parent


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    return normalise_poses(stances(120, np.random.default_rng(5))[1])


def test_bvh_rest_frames_and_end_sites(tmp_path: Path) -> None:
    path = tmp_path / "one.bvh"
    path.write_text(bvh_text(3, 0))
    motion = read_bvh(path)
    assert motion.motion.shape == (3, 6 + 3 * 21)
    assert motion.frame_s == pytest.approx(0.04)
    rotations, positions = motion.poses()
    assert np.allclose(rotations, np.eye(3))
    hand = motion.names.index("LeftHand")
    assert np.allclose(positions[0, hand], [0.5 + 1.5 + 2 + 1.5, -0.5, 3 + 2 - 2 - 2])
    assert motion.names[motion.names.index("LeftToe") + 1] == "LeftToe:end"
    rotations, positions = motion.poses(np.array([2]))
    spine = motion.names.index("Spine")  # bones keep their lengths, whatever the rotations
    assert np.allclose(rotations @ np.swapaxes(rotations, -1, -2), np.eye(3))
    assert np.linalg.norm(positions[0, spine] - positions[0, 0]) == pytest.approx(1)


def test_bvh_channel_order(tmp_path: Path) -> None:
    """Channels apply from the outside in: Z, then X, makes Rz @ Rx."""
    path = tmp_path / "order.bvh"
    joint = "ROOT a { OFFSET 0 0 0 CHANNELS 3 Zrotation Xrotation Yrotation End Site { OFFSET 0 1 0 } }"
    path.write_text(f"HIERARCHY {joint}\nMOTION\nFrames: 1\nFrame Time: 1\n90 90 0\n")
    rotations, _ = read_bvh(path).poses(np.array([0]))
    assert np.allclose(rotations[0, 0] @ [0, 1, 0], [0, 0, 1], atol=1e-6)  # Rx: y to z, which Rz leaves


@pytest.mark.parametrize("text", ["", "hello", "HIERARCHY ROOT a { OFFSET 0 0", bvh_text(3, 0).rsplit("\n", 2)[0]])
def test_broken_bvh_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "broken.bvh"
    path.write_text(text)
    with pytest.raises(FigureError, match=r"broken\.bvh"):
        read_bvh(path)


def test_gltf_tree_accessors_and_clip(tmp_path: Path) -> None:
    write_glb(tmp_path / "scene.glb")
    scene = read_scene(tmp_path / "scene.glb")
    assert scene.names == ("end", "root", "middle")
    assert scene.parents == (2, -1, 1)
    assert scene.order == (1, 2, 0)
    assert list(scene.clips) == ["Turn"]
    assert scene.duration_s("Turn") == 2
    assert np.allclose(scene.accessor(2), [[0, 1, 127 / 255, 0]])
    assert np.allclose(scene.global_matrices()[0, :3, 3], [3, 0, 0])
    assert np.allclose(scene.global_matrices("Turn", 1.0)[0, :3, 3], [0, 3, 0], atol=1e-6)
    half = scene.global_matrices("Turn", 0.5)[0, :3, 3]
    assert np.allclose(half, [3 * np.sqrt(0.5), 3 * np.sqrt(0.5), 0], atol=1e-6)


def test_no_gltf_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.glb").write_bytes(b"PK\x03\x04 a zip file, not a scene")
    with pytest.raises(ExportError, match=r"x\.glb"):
        read_scene(tmp_path / "x.glb")


def test_quaternion_matrix_agrees_with_about() -> None:
    axis, angle = np.array([1.0, -2.0, 0.5]), 1.1
    quaternion = np.append(axis / np.linalg.norm(axis) * np.sin(angle / 2), np.cos(angle / 2))
    assert np.allclose(local_matrix({"rotation": quaternion})[:3, :3], about(axis, angle))


def test_limbs_point_as_in_the_clip(tmp_path: Path) -> None:
    """The law of the whole module: rotation of key k times T_POSE[k] is where the clip's own limb points."""
    path = tmp_path / "clip.bvh"
    path.write_text(bvh_text(20, 7, reach_deg=80))
    motion = read_bvh(path)
    limbs = [(a + b) for b in ("Shoulder", "Arm", "ForeArm", "Hand", "UpLeg", "Leg", "Foot") for a in ("Left", "Right")]
    bones = [motion.names.index(name) for name in (*TRUNK, *limbs)]
    rest, rest_positions = motion.poses()
    rotations, positions = motion.poses(np.arange(20))
    result = retarget(rest[0, bones], rest_positions[0, bones], rotations[:, bones])
    body = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    for name, end in LIMB_END.items():
        limb = (positions[:, bones[KEY[end]]] - positions[:, bones[KEY[name]]]) @ body.T
        assert angle_between(result[:, KEY[name]] @ T_POSE[KEY[name]], limb).max() < 1e-5, name
    upright = retarget(rest[0, bones], rest_positions[0, bones], rest[:, bones])[0]
    assert np.allclose(upright[[KEY["hips"], KEY["head"], KEY["l_foot"]]], np.eye(3))


def test_swings_and_twists() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 50, 3))
    turned = np.einsum("nij,nj->ni", swings(a, b), a)
    assert angle_between(turned, b).max() < 1e-7
    axis = np.array([1.0, 0, 0])
    angles = rng.uniform(-3, 3, 50)
    spun = about(np.broadcast_to(axis, (50, 3)), angles)
    across = about(np.cross(axis, b), rng.uniform(0, 2, 50))
    assert np.allclose(twists(across @ spun, axis), angles)


def test_skeleton_is_one_high_and_mirrors() -> None:
    stand = np.tile(np.eye(3), (1, len(KEYS), 1, 1))
    joints = canonical_joints(stand)[0]
    assert joints.shape == (20, 3)
    assert joints[KEY["head"], 1] - joints[KEY["l_foot"], 1] == pytest.approx(1, abs=0.02)
    assert joints[KEY["l_hand"], 0] == -joints[KEY["r_hand"], 0] > 0.4  # as wide as high
    assert joints[KEY["l_foot"], 2] > 0


def test_mirror(poses: np.ndarray) -> None:
    twin = mirrored(poses)
    assert np.allclose(mirrored(twin), poses)
    there, here = canonical_joints(twin), canonical_joints(poses)
    assert np.allclose(there[:, KEY["l_hand"]], here[:, KEY["r_hand"]] * [-1, 1, 1])
    assert np.array_equal(plausible(twin), plausible(poses))


def test_settled_poses_face_look_and_do_not_wring() -> None:
    rng = np.random.default_rng(2)
    wild = about(rng.normal(size=(200, 20, 3)), rng.uniform(0, 1.2, (200, 20)))
    calm = normalise_poses(wild)
    joints = canonical_joints(calm)
    shoulders = joints[:, KEY["l_clavicle"]] - joints[:, KEY["r_clavicle"]]
    left = calm[:, KEY["hips"], :, 0] + shoulders / np.linalg.norm(shoulders, axis=1, keepdims=True)
    assert np.abs(left[:, 2]).max() < 1e-6
    assert (left[:, 0] > 0).all()
    assert angle_between(calm[:, KEY["head"], :, 2], np.array([0, 0, 1.0])).max() < np.radians(35.01)
    for name, (above, most) in TWIST_LIMIT_DEG.items():
        key = KEY["l_" + name]
        parent = calm[:, KEY[above if above == "hips" else "l_" + above]]
        assert np.abs(twists(np.swapaxes(parent, -1, -2) @ calm[:, key], T_POSE[key])).max() < np.radians(most + 0.01)
    limbs = [KEY[name] for name in LIMB_END]
    before, after = face_front(wild), limit_twist(limit_head_turn(face_front(wild)))
    assert np.allclose(
        np.einsum("nkij,kj->nki", before[:, limbs], T_POSE[limbs]),
        np.einsum("nkij,kj->nki", after[:, limbs], T_POSE[limbs]),
    )


def test_stances_bend_the_right_way(poses: np.ndarray) -> None:
    """Knees ahead, shins back, heads up; and both legs of one who stands reach the ground."""
    for side in "lr":
        thigh, shin = poses[:, KEY[f"{side}_upper_leg"]], poses[:, KEY[f"{side}_lower_leg"]]
        shin_in_thigh = np.einsum("nji,nj->ni", thigh, shin @ [0, -1.0, 0])
        turned = twists(np.swapaxes(thigh, -1, -2) @ shin, np.array([0, -1.0, 0]))
        assert (shin_in_thigh[np.abs(turned) < 0.01, 2] < 1e-6).all()
    joints = canonical_joints(poses)
    assert (joints[:, KEY["head"], 1] > joints[:, KEY["spine3"], 1]).all()
    assert (poses[:, KEY["head"], 2, 2] > 0.8).all()


def test_named_stances() -> None:
    names, rotations = stances(400, np.random.default_rng(0))
    joints = canonical_joints(rotations)
    hands = joints[:, KEY["l_hand"]]
    kinds = np.array([name.removeprefix("made/").split("-") for name in names])
    upright = np.isin(kinds[:, 0], ["stand", "straddle"])
    crown = joints[:, KEY["head"], 1]
    assert (hands[:, 1] > crown)[upright & (kinds[:, 1] == "raise")].mean() > 0.9
    assert (hands[:, 1] < 0.1)[upright & (kinds[:, 1] == "hang")].all()
    assert (joints[:, KEY["l_upper_arm"], 0] > hands[:, 0])[upright & (kinds[:, 1] == "akimbo")].all()
    assert (joints[kinds[:, 0] == "chair", KEY["l_upper_leg"], 2] > 0.15).all()
    kneeling = kinds[:, 0] == "kneel"
    assert (joints[kneeling, KEY["l_lower_leg"], 2] < joints[kneeling, KEY["l_upper_leg"], 2]).all()


def test_plausible_rejects_hands_in_the_trunk_and_lying_figures() -> None:
    stand = np.tile(np.eye(3), (3, len(KEYS), 1, 1))
    stand[1] = about(np.array([1.0, 0, 0]), 1.5) @ stand[1]
    stand[2, KEY["l_lower_arm"]] = about(np.array([0, 0, 1.0]), np.pi)  # folded back through the shoulder
    stand[2, KEY["l_upper_arm"]] = about(np.array([0, 0, 1.0]), -1.2)
    stand[2, KEY["l_lower_arm"]] = about(np.array([0, 0, 1.0]), -2.9)
    assert plausible(stand).tolist() == [True, False, False]


def test_farthest_spreads() -> None:
    points = np.concatenate([np.zeros((50, 2)), [[9, 0], [0, 9], [-9, 0], [0, -9]]])
    assert set(farthest_points(points, 5)[1:]) == {50, 51, 52, 53}
    assert len(set(farthest_points(np.random.default_rng(0).normal(size=(20, 3)), 99))) == 20
    assert farthest_points(np.empty((0, 3)), 5).shape == (0,)


def test_shaken_knees_do_not_bend_backwards() -> None:
    stand = np.tile(np.eye(3), (200, len(KEYS), 1, 1))
    shaken = clips_module._perturbed(stand, np.random.default_rng(0))
    for key, forward in (("l_lower_leg", -1), ("r_lower_leg", -1), ("l_lower_arm", 1), ("r_lower_arm", 1)):
        parent = shaken[:, KEY[KEY_PARENT[key]]]
        local = np.swapaxes(parent, -1, -2) @ shaken[:, KEY[key]] @ T_POSE[KEY[key]]
        assert (forward * local[:, 2] > -1e-9).all(), key
    moved = angle_between(shaken[:, KEY["l_upper_arm"]] @ T_POSE[KEY["l_upper_arm"]], T_POSE[KEY["l_upper_arm"]])
    assert 0.02 < np.median(moved) < 0.3


def test_held_out_clips_are_chosen_by_name_and_seed() -> None:
    names = [f"source/clip{i}" for i in range(200)]
    held = held_out(names)
    assert len(held) == 30
    assert held == held_out(reversed(names))
    assert held != held_out(names, 1)
    assert len(held & held_out([*names, "source/new"])) >= 29  # another clip changes next to nothing
    assert len(held_out(["a", "b"])) == 1
    assert not held_out(["a"])


def test_collect_from_files(assets: Path) -> None:
    assert [clip.name for clip in read_clips(assets)] == sorted(f"made_bvh/motion{i}" for i in range(14))
    train, held = collect_poses(assets, count=120, seed=3)
    again, _ = collect_poses(assets, count=120, seed=3)
    assert np.array_equal(train.rotations, again.rotations)
    assert np.array_equal(train.curl, again.curl)
    assert len(train.clip) == 120
    parents = {name for clip in train.clip for name in clip.split("+")}
    hidden = {name for clip in held.clip for name in clip.split("+")}
    assert hidden
    assert not parents & hidden
    assert hidden <= held_out((f"made_bvh/motion{i}" for i in range(14)), 3)
    assert any("+" in clip for clip in train.clip)
    assert any(clip.startswith("made/") for clip in train.clip)
    for chosen in (train, held):
        assert plausible(chosen.rotations).mean() > 0.99  # float32 may tip one that stands on the limit
        assert np.allclose(np.linalg.det(chosen.rotations), 1, atol=1e-5)
        assert chosen.curl.min() >= 0
        assert chosen.curl.max() <= 1.3001


def test_mixed_poses_join_two_clips() -> None:
    rng = np.random.default_rng(1)
    made = normalise_poses(stances(60, rng)[1])
    sources = [Clip("s/a", made[:30]), Clip("s/b", made[30:])]
    names, rotations = clips_module._mixed(sources, 200, rng)
    assert plausible(rotations).all()
    assert {"s/a+s/b", "s/b+s/a"} <= set(names)


def test_collect_without_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clips_module, "motion_folder", lambda: None)
    train, held = collect_poses(None, count=100)
    assert len(train.clip) == 100
    assert len(held.clip) > 20
    assert all(clip.startswith("made/") for clip in train.clip)
    shared = {pose.tobytes() for pose in train.rotations} & {pose.tobytes() for pose in held.rotations}
    assert not shared


def test_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match="nowhere"):
        read_clips(tmp_path / "nowhere")


def test_bullet_motion(tmp_path: Path) -> None:
    """A figure at rest hangs its arms; hinges bend knees back and elbows ahead; other creatures give nothing."""
    still = [
        0.03,
        0,
        0.9,
        0,
        *([1.0, 0, 0, 0] * 3),
        *[1, 0, 0, 0],
        0,
        *[1, 0, 0, 0],
        *[1, 0, 0, 0],
        0,
        *[1, 0, 0, 0],
        0,
        *[1, 0, 0, 0],
        *[1, 0, 0, 0],
        0,
    ]
    bent = list(still)
    bent[4 + 16] = -1.0  # right knee
    bent[-1] = 1.0  # left elbow
    path = tmp_path / "figure.txt"
    path.write_text(json.dumps({"Loop": "wrap", "Frames": [still, bent]}))
    first, second = read_motion(path, 40)
    assert np.allclose(first[KEY["l_lower_arm"]] @ T_POSE[KEY["l_lower_arm"]], [0, -1, 0])
    assert (second[KEY["l_lower_arm"]] @ T_POSE[KEY["l_lower_arm"]])[2] == pytest.approx(np.sin(1))
    assert (second[KEY["r_lower_leg"]] @ T_POSE[KEY["r_lower_leg"]])[2] == pytest.approx(-np.sin(1))
    path.write_text(json.dumps({"Frames": [[0.0] * 20]}))
    assert read_motion(path, 40).shape == (0, 20, 3, 3)
