from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fig2mesh.errors import InputError
from fig2mesh.field.camera import axes
from fig2mesh.nets.disn import PART_WEIGHTS, Disn, DisnShape
from fig2mesh.skeleton import KINDS
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.networks.train_parts import PartSampling, draw, evaluate_parts, train_parts
from fig2mesh.training.samples.part_data import load_parts, mirrored_masks, swapped, turned, turned_grid
from tests.fig2mesh.training.synthetic import capsule, write_shard

FEW = PartSampling(points=64, validation_bodies=1)


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("shards")
    write_shard(folder / "train-00000.npz", 2, 0)
    write_shard(folder / "train-00001.npz", 1, 1)
    write_shard(folder / "valid-clips-00000.npz", 1, 2, grids=True)
    return folder


def test_left_and_mirrored_right_parts_are_read(data):
    parts = load_parts(data, "hand", "train")
    assert len(parts) == 6
    assert len(load_parts(data, "torso", "train")) == 3
    assert len(load_parts(data, "hand", "train", max_bodies=1)) == 2
    # Right hands point to the figure's right, and in the mirror to the left like the others.
    assert (parts.anchors[:, 1, 0] > parts.anchors[:, 0, 0]).all()
    with pytest.raises(InputError, match="holds no test data"):
        load_parts(data, "hand", "test")


@pytest.mark.parametrize("kind", KINDS)
def test_points_masks_anchors_and_views_agree(data, kind):
    """Inside points fall on the mask in every view, mirrored or not: one wrong sign anywhere would show."""
    parts = load_parts(data, kind, "train")
    for view in range(4):
        views, items = np.full(len(parts), view), np.arange(len(parts))
        seen = turned(parts.points, views)
        assert np.allclose(seen, parts.points.astype(np.float64) @ axes(90 * view).T)
        mask = parts.mask(items, views, "amodal")
        column = np.clip((seen[..., 0] + 1) * 32, 0, 63).astype(int)
        row = np.clip((1 - seen[..., 1]) * 32, 0, 63).astype(int)
        deep = parts.distance < -0.06
        assert deep.any()
        assert mask[items[:, None], row, column][deep].all()
        anchors = turned(parts.anchors, views)
        if kind != "torso" and kind != "head":
            for item in range(len(parts)):
                found = capsule(seen[item].astype(np.float64), anchors[item, 0], anchors[item, 1], 0)
                radius = found - parts.distance[item]
                assert np.ptp(radius) < 0.01  # half precision of points and distances


@pytest.mark.parametrize("view", range(4))
def test_grids_turn_like_points(view):
    axis = np.linspace(-1, 1, 5)
    nodes = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1)
    value = nodes @ np.array([1.0, 10.0, 100.0])
    back = nodes @ axes(90 * view)  # p = axes.T @ p_view
    assert np.allclose(turned_grid(value, view), back @ np.array([1.0, 10.0, 100.0]))


def test_the_mirror_is_its_own_inverse(data):
    parts = load_parts(data, "torso", "train")
    assert np.array_equal(mirrored_masks(mirrored_masks(parts.masks)), parts.masks)
    assert np.array_equal(swapped(swapped(parts.anchors, "torso"), "torso"), parts.anchors)
    assert (swapped(parts.anchors, "torso")[:, 0, 0] > 0).all()  # the left shoulder stays on the left


def test_a_batch_is_half_inside(data):
    parts = load_parts(data, "hand", "train")
    mask, anchors, points, target = draw(parts, np.random.default_rng(0), 8, 100, (0, 0, 1), 0.0)
    assert mask.shape == (8, 1, 64, 64)
    assert anchors.shape == (8, 2, 3)
    assert points.shape == (8, 100, 3)
    assert ((target < 0).sum(1) == 50).all()
    assert not mask.any()
    again = draw(parts, np.random.default_rng(0), 8, 100, (0, 0, 1), 0.0)
    assert torch.equal(points, again[2])


@pytest.mark.parametrize("variant", ["one-stream", "two-stream-pose"])
@pytest.mark.slow
def test_training_is_deterministic_and_leaves_weights(data, tmp_path, variant):
    shape = DisnShape.of("hand", variant)
    scores = [
        train_parts(data, "hand", shape, tmp_path / name, Schedule(seed=5, batch=4), FEW, epochs=1) for name in "ab"
    ]
    files = [PART_WEIGHTS.path(shape, tmp_path / name).read_bytes() for name in "ab"]
    assert files[0] == files[1]
    assert scores[0]["iou_visible"] == scores[1]["iou_visible"]
    net, facts = PART_WEIGHTS.read(PART_WEIGHTS.path(shape, tmp_path / "a"))
    assert facts["steps"] == 6
    assert facts["scores"]["n_amodal"] == 2
    assert net.shape == shape
    assert (tmp_path / "a" / "log.csv").read_text().startswith("step,")


@pytest.mark.slow
def test_going_on_equals_an_undisturbed_run(data, tmp_path, monkeypatch):
    shape = DisnShape("foot")
    train_parts(data, "foot", shape, tmp_path / "whole", Schedule(batch=4), FEW, epochs=1)

    class Interrupt(Exception):
        pass

    calls = 0
    from fig2mesh.training.networks import loop
    from fig2mesh.training.networks import train_parts as module

    def interrupted(*args):
        nonlocal calls
        calls += 1
        if calls == 4:
            raise Interrupt
        return draw(*args)

    original = loop.run_loop

    def at_every_step(task, folder, schedule, regime):
        return original(task, folder, schedule, replace(regime, checkpoint_s=0))

    monkeypatch.setattr(module, "run_loop", at_every_step)
    monkeypatch.setattr(module, "draw", interrupted)
    with pytest.raises(Interrupt):
        train_parts(data, "foot", shape, tmp_path / "parts", Schedule(batch=4), FEW, epochs=1)
    monkeypatch.setattr(module, "draw", draw)
    train_parts(data, "foot", shape, tmp_path / "parts", Schedule(batch=4), FEW, epochs=1)
    name = PART_WEIGHTS.path(shape).name
    assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


@pytest.mark.slow
def test_a_network_learns_capsules_of_bodies_that_it_has_not_seen(tmp_path):
    write_shard(tmp_path / "train-00000.npz", 12, 0)
    write_shard(tmp_path / "valid-clips-00000.npz", 1, 2, grids=True)
    shape = DisnShape("lower_arm")
    given = Schedule(batch=8), PartSampling(points=128)
    result = train_parts(tmp_path, "lower_arm", shape, tmp_path / "out", *given, epochs=20, ema=0.9)
    assert result["iou_amodal"] > 0.7  # the mean of all fields, the best that knows nothing of its input: 0.31


def test_scores_of_all_views(data):
    torch.manual_seed(0)
    net = Disn(DisnShape("torso"))
    assert evaluate_parts(net, data, "valid", "amodal", 1, dense=False)["n"] == 4


def test_a_network_for_another_part_is_refused(data, tmp_path):
    with pytest.raises(ValueError, match="network is for"):
        train_parts(data, "hand", DisnShape("foot"), tmp_path, epochs=1)
