"""Skeletons made on the fly are those of the rigs; the network trains on them and repeats itself."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fig2mesh.nets.pose_lift import POSE_WEIGHTS, PoseLiftShape, lift_joints
from fig2mesh.skeleton import FIGURE_HEIGHT, JOINT, JOINT_NAMES
from fig2mesh.training.bodies.rig import KEY, KEY_PARENT, KEYS, T_POSE, PoseSet, Rig, axis_angle, pose
from fig2mesh.training.bodies.skeletons import AROUND, DRAWN, SIDES, Sampler, Skeletons
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.networks.train_pose import pose_scores, train_pose

# fmt: off
PLACES = {
    "hips": (0, 0.95, 0), "spine1": (0, 1.05, 0), "spine2": (0, 1.15, 0), "spine3": (0, 1.25, 0), "neck": (0, 1.5, 0),
    "head": (0, 1.58, 0.02), "clavicle": (0.03, 1.42, 0), "upper_arm": (0.18, 1.42, 0), "lower_arm": (0.4, 1.25, 0),
    "hand": (0.6, 1.1, 0.03), "upper_leg": (0.09, 0.92, 0), "lower_leg": (0.11, 0.5, 0.01), "foot": (0.12, 0.09, -0.02),
}
# fmt: on
# fmt: off
RIDES = {
    "head": ("head", (0, 0.1, 0)), "eyes": ("head", (0, 0.08, 0.1)), "neck": ("neck", (0, 0, 0)),
    "thorax": ("spine3", (0, 0.1, 0)), "pelvis": ("hips", (0, 0, 0)), "shoulder": ("upper_arm", (0, 0, 0)),
    "elbow": ("lower_arm", (0, 0, 0)), "wrist": ("hand", (0, 0, 0)), "hand": ("hand", (0.08, -0.05, 0)),
    "hip": ("upper_leg", (0, 0, 0)), "knee": ("lower_leg", (0, 0, 0)), "ankle": ("foot", (0, 0, 0)),
    "foot": ("foot", (0, -0.07, 0.14)),
}
# fmt: on


def rig(scale: float = 1.0, root: bool = True) -> Rig:
    """A body of one bone a key in an A-pose, below a root bone and with a bone between that no key turns."""

    def place(key: str) -> np.ndarray:
        side = -1.0 if key.startswith("r_") else 1.0
        return scale * np.array(PLACES[key[2:] if key[:2] in ("l_", "r_") else key]) * [side, 1, 1]

    names = ["root", *(key for key in KEYS if not key.endswith("foot")), "l_between", "r_between", "l_foot", "r_foot"]
    parents, heads = [-1], [np.zeros(3)]
    for name in names[1:]:
        parent = {"l_between": "l_lower_leg", "l_foot": "l_between"}.get(name.replace("r_", "l_"))
        parent = parent.replace("l_", name[:2], 1) if parent else KEY_PARENT.get(name, "root")
        parents.append(names.index(parent))
        between = (place(f"{name[:2]}lower_leg") + place(f"{name[:2]}foot")) / 2 if name.endswith("between") else None
        heads.append(place(name) if between is None else between)
    ends = {"upper_arm": "lower_arm", "lower_arm": "hand", "upper_leg": "lower_leg", "lower_leg": "foot"}
    direction = T_POSE.copy()
    for index, key in enumerate(KEYS):
        if key[2:] in ends:
            along = place(key[:2] + ends[key[2:]]) - place(key)
            direction[index] = along / np.linalg.norm(along)
    joint_bone, joint_rest = [], []
    for joint in JOINT_NAMES:
        key, offset = RIDES[joint[2:] if joint[:2] in ("l_", "r_") else joint]
        key = joint[:2] + key if joint[:2] in ("l_", "r_") else key
        joint_bone.append(names.index(key))
        joint_rest.append(place(key) + scale * np.array(offset) * [-1 if joint.startswith("r_") else 1, 1, 1])
    return Rig(
        name="sticks",
        vertices=scale * np.array([[0, 0, 0], [0, 1.75, 0], [0.1, 0, 0]], np.float32),
        faces=np.array([[0, 1, 2]], np.int32),
        face_part=np.array([1], np.uint8),
        face_material=np.zeros(1, np.uint8),
        materials=("skin",),
        bone_index=np.zeros((3, 4), np.int32),
        bone_weight=np.full((3, 4), 0.25, np.float32),
        parents=np.array(parents, np.int32),
        heads=np.array(heads, np.float32),
        key_bone=np.array([names.index(key) for key in KEYS], np.int32),
        rest_direction=direction.astype(np.float32),
        finger_axis=np.zeros((len(names), 3), np.float32),
        joint_bone=np.array(joint_bone, np.int32),
        joint_rest=np.array(joint_rest, np.float32),
    )


def poses(count: int, seed: int = 0, amount: float = 0.7) -> PoseSet:
    """Each key turned from its parent by a random rotation."""
    rng = np.random.default_rng(seed)
    rotations = np.tile(np.eye(3), (count, len(KEYS), 1, 1))
    for row in range(count):
        for key in KEYS[1:]:
            own = axis_angle(rng.normal(size=3), amount * rng.normal() * (0.2 if "spine" in key else 1.0))
            rotations[row, KEY[key]] = rotations[row, KEY[KEY_PARENT[key]]] @ own
    return PoseSet(np.array(["made"] * count), rotations.astype(np.float32), np.zeros((count, 2), np.float32))


@pytest.fixture(scope="module")
def skeletons() -> Skeletons:
    return Skeletons.from_rigs([rig(), rig(0.9)], poses(64))


def test_joints_are_those_of_the_rig() -> None:
    rigs, some = [rig(), rig(0.7)], poses(6, amount=1.5)
    skeletons = Skeletons.from_rigs(rigs, some)
    for body, own in enumerate(rigs):
        found = skeletons.joints(np.arange(6), np.full(6, body))
        for row in range(6):
            np.testing.assert_allclose(found[row], pose(own, some.rotations[row], some.curl[row])[1], atol=1e-5)


@pytest.mark.parametrize("view", [AROUND, SIDES, DRAWN, replace(AROUND, perspective=True)])
def test_samples(skeletons: Skeletons, view: object) -> None:
    sampler = Sampler(skeletons)
    draw = [sampler.draw(200, view, torch.Generator().manual_seed(seed)) for seed in (1, 1, 2)]  # type: ignore[arg-type]
    assert all(torch.equal(a, b) for a, b in zip(draw[0], draw[1], strict=True))
    assert not torch.equal(draw[0].joints, draw[2].joints)
    assert torch.isfinite(draw[0].drawn).all()
    assert (draw[0].joints[:, JOINT["pelvis"]] == 0).all()
    assert draw[0].visible.all() == (view is not DRAWN)


def test_plain_samples_are_rigid_and_to_scale(skeletons: Skeletons) -> None:
    sample = Sampler(skeletons).draw(500, AROUND, torch.Generator().manual_seed(0))
    shin = (sample.joints[:, JOINT["l_knee"]] - sample.joints[:, JOINT["l_ankle"]]).norm(dim=1)
    own = np.linalg.norm(np.subtract(PLACES["lower_leg"], PLACES["foot"])) * FIGURE_HEIGHT / 1.75
    np.testing.assert_allclose(shin, own, rtol=1e-5)
    torch.testing.assert_close(sample.drawn, sample.joints[..., :2])


def test_disproportion_keeps_bones_rigid_and_the_height(skeletons: Skeletons) -> None:
    still = Skeletons.from_rigs([rig()], poses(4, amount=0.0))
    view = replace(AROUND, disproportion=1.0)
    sample = Sampler(still).draw(400, view, torch.Generator().manual_seed(0))
    low = sample.joints[..., 1].min(dim=1).values
    tall = sample.joints[:, JOINT["head"], 1] - low
    plain = Sampler(still).draw(1, AROUND, torch.Generator().manual_seed(0)).joints[0]
    expected = plain[JOINT["head"], 1] - plain[:, 1].min()
    # The T-pose turns the whole arm and leg of this rig's A-pose straight, so that only the foot's tip may differ.
    np.testing.assert_allclose(tall, expected, rtol=1e-4)
    left = (sample.joints[:, JOINT["l_elbow"]] - sample.joints[:, JOINT["l_shoulder"]]).norm(dim=1)
    right = (sample.joints[:, JOINT["r_elbow"]] - sample.joints[:, JOINT["r_shoulder"]]).norm(dim=1)
    assert float(left.std() / left.mean()) > 0.1
    assert float((left / right - 1).abs().mean()) < 0.15


def test_perspective_enlarges_what_is_near(skeletons: Skeletons) -> None:
    sample = Sampler(skeletons).draw(300, replace(AROUND, perspective=True), torch.Generator().manual_seed(0))
    far = sample.joints[..., :2].norm(dim=2) > 0.1
    grown = sample.drawn.norm(dim=2) > sample.joints[..., :2].norm(dim=2)
    assert (grown == (sample.joints[..., 2] > 0))[far].all()


@pytest.mark.parametrize(
    "shape",
    [
        PoseLiftShape(width=64),
        PoseLiftShape(joints=16, perspective=True, metric=True, width=64),
        PoseLiftShape(visibility=True, width=64),
    ],
)
def test_training_learns_and_is_stored(skeletons: Skeletons, tmp_path: Path, shape: PoseLiftShape) -> None:
    held = Skeletons.from_rigs([rig(0.95)], poses(16, seed=1))
    _, before = train_pose(skeletons, held, tmp_path / "a", Schedule(steps=1, batch=64, seed=3), shape=shape)
    net, after = train_pose(skeletons, held, tmp_path / "b", Schedule(steps=300, batch=64, seed=3), shape=shape)
    assert after["sides_rmse_mm"] < 0.8 * before["sides_rmse_mm"]
    assert after["sides_pck150"] > before["sides_pck150"]
    assert json.loads((tmp_path / "b" / "scores.json").read_text()) == after
    stored, facts = POSE_WEIGHTS.read(POSE_WEIGHTS.path(shape, tmp_path / "b"))
    assert facts["scores"] == after
    view = replace(AROUND, perspective=shape.perspective)
    sample = Sampler(held).draw(256, view, torch.Generator().manual_seed(9))
    one, other = pose_scores(net, sample), pose_scores(stored, sample)
    assert abs(one["rmse_mm"] - other["rmse_mm"]) < 1.0


def test_scores_of_the_truth_and_of_a_flat_figure(skeletons: Skeletons, tmp_path: Path) -> None:
    net, _ = train_pose(skeletons, skeletons, tmp_path, Schedule(steps=1, batch=8), shape=PoseLiftShape(width=64))
    torch.nn.init.zeros_(net.last.weight)
    torch.nn.init.zeros_(net.last.bias)
    sample = Sampler(skeletons).draw(128, AROUND, torch.Generator().manual_seed(0))
    depth = sample.joints[..., 2].numpy()
    scores = pose_scores(net, sample)
    assert scores["rmse_mm"] == pytest.approx(1000 * np.sqrt(np.mean(depth**2)), rel=1e-4)
    assert scores["pck150"] == pytest.approx(100 * np.mean(np.abs(depth) <= 0.15), rel=1e-4)
    assert scores["rmse_without_pelvis_mm"] == pytest.approx(scores["rmse_mm"] * np.sqrt(21 / 20), rel=1e-4)
    assert scores["mean_pelvis_mm"] == 0
    assert (lift_joints(net, sample.drawn[0].numpy())[:, 2] == 0).all()


def test_same_seed_same_network(skeletons: Skeletons, tmp_path: Path) -> None:
    shape = PoseLiftShape(width=32)
    nets = [
        train_pose(skeletons, skeletons, tmp_path / name, Schedule(steps=20, batch=16), shape=shape)[0] for name in "ab"
    ]
    for one, other in zip(nets[0].state_dict().values(), nets[1].state_dict().values(), strict=True):
        assert torch.equal(one, other)
    files = [POSE_WEIGHTS.path(shape, tmp_path / name).read_bytes() for name in "ab"]
    assert files[0] == files[1]
