"""The size networks, and the data they learn from: boxes and masks from four sides."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from fig2mesh.nets.part_size import SIZE_WEIGHTS, PartSizeNet, SizeShape, part_size
from fig2mesh.skeleton import JOINT_MIRROR, KINDS, PART, PART_NAMES, part_centre
from fig2mesh.training.networks.loop import seeded
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.networks.train_size import mask_extent, read_sizes, train_size


def joints(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(21, 3))


def network(kind: str) -> PartSizeNet:
    return seeded(1, lambda: PartSizeNet(SizeShape(kind)))


def write_shards(folder: Path, bodies: int = 24) -> None:
    """Boxes round bones whose thickness is a third of the bone's length, with full masks."""
    for split in ("train", "valid-clips", "valid-characters"):
        rng = np.random.default_rng(len(split))
        placed = rng.normal(size=(bodies, 21, 3)).astype(np.float32)
        centre, size = np.zeros((bodies, 14, 3), np.float32), np.zeros((bodies, 14, 3), np.float32)
        for part in range(1, 15):
            centre[:, part - 1] = part_centre(part, placed)
            row = PART_NAMES[part]
            first, second = (7, 9) if row == "l_lower_arm" else (8, 10)
            bone = placed[:, first] - placed[:, second]
            size[:, part - 1] = np.abs(bone) + np.linalg.norm(bone, axis=1, keepdims=True) / 3
        edge = 1.1 * size.max(axis=2)
        filled = np.zeros((bodies, 4, 14, 64, 64), bool)
        filled[..., 10:40, 20:60] = True
        hidden = filled.copy()
        hidden[:, 1:] = False
        np.savez(
            folder / f"{split}-00000.npz",
            joints=placed,
            centre=centre,
            size=size,
            edge=edge,
            mask_amodal=np.packbits(filled, axis=-1),
            mask_visible=np.packbits(hidden, axis=-1),
        )


@pytest.mark.parametrize("kind", KINDS)
def test_twice_as_large_is_twice_as_large(kind: str) -> None:
    part = next(PART[name] for name in PART_NAMES if name.removeprefix("l_") == kind)
    net = network(kind)
    for mask in (None, (0.3, 0.7)):
        one, edge = part_size(net, part, joints(), mask)
        other, other_edge = part_size(net, part, 8 * joints() + 3, mask and (8 * mask[0], 8 * mask[1]))
        np.testing.assert_allclose(other, 8 * one, rtol=1e-4)
        assert other_edge == pytest.approx(8 * edge, rel=1e-4)
        assert (one > 0).all()


def test_a_right_part_is_a_mirrored_left_one() -> None:
    mirrored = joints()[list(JOINT_MIRROR)] * [-1, 1, 1]
    net = network("foot")
    left, right = part_size(net, PART["l_foot"], joints()), part_size(net, PART["r_foot"], mirrored)
    np.testing.assert_allclose(left[0], right[0], rtol=1e-5)
    with pytest.raises(ValueError, match="not a foot"):
        part_size(net, PART["l_hand"], joints())


def test_a_bone_that_points_at_the_viewer_or_has_no_length_gives_a_size() -> None:
    assert np.isfinite(part_size(network("hand"), PART["l_hand"], np.zeros((21, 3)), (0.1, 0.1))[0]).all()


def test_the_papers_layers() -> None:
    linear = [module for module in network("hand").modules() if isinstance(module, torch.nn.Linear)]
    assert [layer.out_features for layer in linear] == [20, 40, 20, 4]


def test_extent_of_masks() -> None:
    masks = np.zeros((3, 64, 64), bool)
    masks[0, 3:19, 32:64] = True
    masks[1, 63, 0] = True
    found = mask_extent(np.packbits(masks, axis=-1))
    np.testing.assert_array_equal(found, [[0.5, 0.25], [1 / 64, 1 / 64], [0, 0]])


def test_four_views_of_both_sides(tmp_path: Path) -> None:
    write_shards(tmp_path, bodies=3)
    sizes = read_sizes(tmp_path, "train", "lower_arm")
    assert len(sizes.size) == 3 * 4 * 2
    front, left = sizes.size[:3], sizes.size[3:6]
    np.testing.assert_allclose(left, front[:, [2, 1, 0, 3]])
    np.testing.assert_allclose(np.abs(sizes.anchors[3:6]), np.abs(sizes.anchors[:3])[..., [2, 1, 0]], rtol=1e-5)
    np.testing.assert_allclose(sizes.whole[:3], front[:, 3:] * [40 / 64, 30 / 64], rtol=1e-5)
    assert (sizes.seen[3:6] == 0).all()


def test_training_learns_a_rule_and_repeats_itself(tmp_path: Path) -> None:
    write_shards(tmp_path, bodies=60)
    _, before = train_size(tmp_path, "lower_arm", tmp_path / "a", Schedule(steps=1))
    net, after = train_size(tmp_path, "lower_arm", tmp_path / "b", Schedule(steps=400))
    assert after["valid-characters_none_depth_percent"] < 0.6 * before["valid-characters_none_depth_percent"]
    again, _ = train_size(tmp_path, "lower_arm", tmp_path / "c", Schedule(steps=400))
    for one, other in zip(net.parameters(), again.parameters(), strict=True):
        assert torch.equal(one, other)
    stored, facts = SIZE_WEIGHTS.read(SIZE_WEIGHTS.path(SizeShape("lower_arm"), tmp_path / "b"))
    assert facts["steps"] == 400
    np.testing.assert_allclose(
        part_size(stored, PART["l_lower_arm"], joints())[0], part_size(net, PART["l_lower_arm"], joints())[0], rtol=1e-2
    )


def test_weights_round_trip(tmp_path: Path) -> None:
    SIZE_WEIGHTS.save(tmp_path / "x.safetensors", network("head"), {"seed": 4})
    net, facts = SIZE_WEIGHTS.read(tmp_path / "x.safetensors")
    assert net.shape == SizeShape("head")
    assert facts["seed"] == 4
