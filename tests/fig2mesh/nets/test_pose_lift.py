"""The pose network: what it keeps, what it is indifferent to, and that half precision does it no harm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fig2mesh.errors import InputError
from fig2mesh.nets.pose_lift import POSE_WEIGHTS, PoseLift, PoseLiftShape, lift, lift_joints
from fig2mesh.skeleton import JOINT, JOINT_MIRROR
from fig2mesh.training.networks.loop import seeded

SMALL = PoseLiftShape(width=64)


def network(shape: PoseLiftShape = SMALL) -> PoseLift:
    """An untrained network whose batch statistics are those of some figures."""
    net = seeded(1, lambda: PoseLift(shape))
    figures = torch.randn(256, shape.joints, 2, generator=torch.Generator().manual_seed(2))
    for _ in range(40):
        net(figures)
    return net.eval()


def figure(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(21, 2)).astype(np.float32)


def test_drawn_places_are_kept_to_the_bit_and_the_pelvis_is_the_origin_of_depth() -> None:
    drawn = figure() + np.float32(3.7)
    found = lift_joints(network(), drawn)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found[:, :2], drawn)
    assert found[JOINT["pelvis"], 2] == 0
    assert np.ptp(found[:, 2]) > 0.01


@pytest.mark.parametrize("factor", [1e-3, 0.4, 25.0])
def test_twice_as_large_is_twice_as_deep_wherever_it_is(factor: float) -> None:
    net = network()
    one, other = lift_joints(net, figure()), lift_joints(net, figure() * np.float32(factor) + np.float32(factor))
    np.testing.assert_allclose(other[:, 2], factor * one[:, 2], rtol=1e-3, atol=1e-4 * factor)


def test_metric_networks_trust_the_units() -> None:
    net = network(replace(SMALL, metric=True))
    one, other = lift_joints(net, figure()), lift_joints(net, figure() * np.float32(2))
    assert np.abs(other[:, 2] - 2 * one[:, 2]).max() > 0.01


def test_the_mirror_image_has_the_mirror_images_depths() -> None:
    net = network()
    mirror = list(JOINT_MIRROR)
    one, other = lift_joints(net, figure()), lift_joints(net, figure()[mirror] * [-1, 1])
    np.testing.assert_allclose(other[mirror, 2], one[:, 2], atol=1e-5)


def test_hidden_joints_matter_only_to_networks_that_ask() -> None:
    seen = np.ones(21, bool)
    seen[JOINT["l_wrist"]] = False
    for visibility in (False, True):
        net = network(replace(SMALL, visibility=visibility))
        same = np.array_equal(lift_joints(net, figure(), seen), lift_joints(net, figure()))
        assert same != visibility


@pytest.mark.parametrize("joints", [16, 21])
@pytest.mark.parametrize("perspective", [False, True])
def test_shapes(joints: int, perspective: bool) -> None:
    net = network(PoseLiftShape(joints=joints, perspective=perspective, width=64))
    assert lift(net, torch.rand(5, joints, 2)).shape == (5, joints, 3)
    assert len(net.shape.indices) == joints


def test_the_papers_layers() -> None:
    linear = [module for module in PoseLift(PoseLiftShape()).modules() if isinstance(module, torch.nn.Linear)]
    assert [(layer.in_features, layer.out_features) for layer in linear] == [
        (42, 1024),
        *[(1024, 1024)] * 4,
        (1024, 21),
    ]


def test_coincident_joints_give_finite_depths() -> None:
    assert np.isfinite(lift_joints(network(), np.zeros((21, 2), np.float32))).all()


def test_only_the_network_for_drawings_lifts_them() -> None:
    with pytest.raises(ValueError, match="orthographic network of 21"):
        lift_joints(network(PoseLiftShape(joints=16, width=64)), figure())
    with pytest.raises(ValueError, match="16 or 21"):
        PoseLiftShape(joints=17)


def test_half_precision_moves_no_joint(tmp_path: Path) -> None:
    net = network(PoseLiftShape())
    path = POSE_WEIGHTS.path(net.shape, tmp_path)
    POSE_WEIGHTS.save(path, net, {"seed": 1})
    again, facts = POSE_WEIGHTS.read(path)
    assert facts["seed"] == 1
    assert again.shape == net.shape
    drawn = figure()
    one, other = lift_joints(net, drawn)[:, 2], lift_joints(again, drawn)[:, 2]
    assert np.abs(one - other).max() < 2e-3 * np.abs(one).max()


def test_other_weights_are_refused(tmp_path: Path) -> None:
    from fig2mesh.nets import weights

    weights.save(tmp_path / "a.safetensors", {"x": torch.zeros(3)}, {"shape": {"joints": 21}})
    with pytest.raises(InputError, match="not the weights of a pose network"):
        POSE_WEIGHTS.read(tmp_path / "a.safetensors")
