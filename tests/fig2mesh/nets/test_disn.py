from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.ndimage import distance_transform_edt

from fig2mesh.nets.bones import bone_frames, feature_count, mask_distance, point_features
from fig2mesh.nets.disn import VARIANTS, Disn, DisnShape, mask_channels
from fig2mesh.parts.kinds import KINDS

ANCHORS = torch.tensor([[[0.3, 0.2, 0.1], [-0.3, -0.2, -0.1]], [[0.0, 0.4, 0.0], [0.1, -0.4, 0.2]]])


def made(kind: str, variant: str, seed: int = 0) -> Disn:
    torch.manual_seed(seed)
    return Disn(DisnShape.of(kind, variant))


def disc(radius: float = 0.5) -> np.ndarray:
    axis = (np.arange(64) + 0.5) / 32 - 1
    return axis[None] ** 2 + axis[:, None] ** 2 < radius**2


def inputs(net: Disn, points: int = 50) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    rng = np.random.default_rng(1)
    masks = np.stack([disc(), rng.random((64, 64)) < 0.5])
    anchors = torch.from_numpy(rng.uniform(-0.5, 0.5, (2, net.shape.anchors, 3)).astype(np.float32))
    places = torch.from_numpy(rng.uniform(-1, 1, (2, points, 3)).astype(np.float32))
    return mask_channels(masks, net.shape), anchors, places


def count(module: torch.nn.Module) -> int:
    return sum(value.numel() for value in module.parameters())


def test_layers_are_those_of_appendix_a():
    net = made("hand", "two-stream-pose")
    before = 1
    for level, filters in zip(net.levels, (8, 16, 32, 64, 128), strict=True):
        assert count(level) == (9 * before * filters + filters) + (9 * filters * filters + filters)
        before = filters
    assert count(net.overall) == 128 * 2 * 2 * 256 + 256
    encoder = (3 * 16 + 16) + (16 * 64 + 64) + (64 * 128 + 128)
    assert count(net.point) == count(net.pose) == encoder
    rest = (512 * 256 + 256) + (256 + 1)
    assert count(net.streams[0]) == (128 + 256 + 2 * 128) * 512 + 512 + rest
    assert count(net.streams[1]) == (128 + 248 + 2 * 128) * 512 + 512 + rest


@pytest.mark.parametrize(
    ("variant", "widths"),
    [
        ("one-stream", [128 + 256 + 248]),
        ("one-stream-pose", [128 + 256 + 248 + 4 * 128]),
        ("two-stream", [128 + 256, 128 + 248]),
        ("two-stream-pose", [128 + 256 + 4 * 128, 128 + 248 + 4 * 128]),
    ],
)
def test_streams_take_what_table_2_compares(variant, widths):
    net = made("torso", variant)
    assert [stream.first.in_features for stream in net.streams] == widths
    assert hasattr(net, "pose") == variant.endswith("pose")


@pytest.mark.parametrize("variant", VARIANTS)
def test_variant_names_go_both_ways(variant):
    assert DisnShape.of("foot", variant).variant == variant


def test_shapes_that_do_not_exist_are_refused():
    with pytest.raises(ValueError, match="kind"):
        DisnShape("tail")
    with pytest.raises(ValueError, match="no such variant"):
        DisnShape("hand", streams=3)
    with pytest.raises(ValueError, match="variant"):
        DisnShape.of("hand", "three-stream")


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("kind", ["torso", "hand"])
def test_split_first_layer_is_the_concatenation(kind, variant):
    net = made(kind, variant)
    mask, anchors, points = inputs(net)
    features = net.encode(mask, anchors)
    plain = net.query_plain(features, points)
    assert plain.shape == (2, 50)
    # Sums of some 900 products in another order, single precision.
    assert torch.allclose(net(mask, anchors, points), plain, atol=1e-5)
    assert torch.allclose(net.query(features, points, net.local_share(features, points)), plain, atol=1e-5)


@pytest.mark.parametrize("variant", ["two-stream-pose", "bone"])
def test_split_first_layer_has_the_gradients_of_the_concatenation(variant):
    net = made("hand", variant)
    mask, anchors, points = inputs(net)
    gradients = []
    for query in (net.query, net.query_plain):
        net.zero_grad()
        query(net.encode(mask, anchors), points).square().sum().backward()
        gradients.append([value.grad.clone() for value in net.parameters()])
    for fast, plain in zip(*gradients, strict=True):
        assert torch.allclose(fast, plain, rtol=1e-3, atol=1e-4 * float(plain.abs().max() + 1e-6))


@pytest.mark.parametrize("variant", ["two-stream-pose", "bone"])
def test_one_sample_is_learned(variant):
    net = made("hand", variant)
    mask, anchors, points = inputs(net, 128)
    mask, anchors, points = mask[:1], anchors[:1] * 0, points[:1]
    target = points.norm(dim=-1) - 0.5
    optimizer = torch.optim.Adam(net.parameters(), lr=1e-3)
    for _ in range(100):
        optimizer.zero_grad()
        loss = (net(mask, anchors, points) - target).abs().mean()
        loss.backward()
        optimizer.step()
    assert float(loss.detach()) < 0.03


def test_local_features_follow_the_picture():
    """Row 0 of a mask is at y = +1, column 0 at x = -1: a lone pixel is felt there, not at its mirror images."""
    net = made("hand", "two-stream")
    spot = np.zeros((1, 64, 64), bool)
    spot[0, 4, 8] = True
    features = net.encode(mask_channels(spot, net.shape), torch.zeros(1, 2, 3))
    empty = net.encode(mask_channels(spot & False, net.shape), torch.zeros(1, 2, 3))
    x, y = 8.5 / 32 - 1, 1 - 4.5 / 32
    there = torch.tensor([[[x, y, 0.0], [-x, y, 0.0], [x, -y, 0.0], [-x, -y, 0.0]]])
    change = (net.local_share(features, there) - net.local_share(empty, there)).norm(dim=-1)[0]
    assert change[0] > 3 * change[1:].max()


def test_mask_distance_is_scipys():
    masks = np.random.default_rng(0).random((4, 64, 64)) > np.array([0.5, 0.9, 0.99, 0.05])[:, None, None]
    expected = [np.where(m, 0.5 - distance_transform_edt(m), distance_transform_edt(~m) - 0.5) / 32 for m in masks]
    assert np.allclose(mask_distance(masks), np.clip(expected, -1, 1), atol=1e-6)


def test_mask_distance_without_an_outline_is_constant():
    masks = np.stack([np.zeros((64, 64), bool), np.ones((64, 64), bool)])
    assert (mask_distance(masks) == np.array([1, -1])[:, None, None]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_features_are_finite_for_coincident_and_turned_joints(kind):
    shape = DisnShape.of(kind, "bone")
    up = torch.zeros(shape.anchors, 3)
    up[1, 1] = 1.0
    anchors = torch.stack([torch.zeros(shape.anchors, 3), up, -up])
    points = torch.rand(3, 20, 3) * 2 - 1
    found, nearest = point_features(bone_frames(kind, anchors), points, torch.zeros(3, 20))
    assert found.shape == (3, 20, feature_count(kind))
    assert torch.isfinite(found).all()
    assert torch.isfinite(nearest).all()
    assert float(found.abs().max()) < 10


@pytest.mark.parametrize("kind", ["torso", "lower_arm", "head"])
def test_bone_frames_are_orthonormal(kind):
    anchors = torch.randn(30, DisnShape(kind).anchors, 3, generator=torch.Generator().manual_seed(0))
    frames = bone_frames(kind, anchors)
    basis = torch.cat([frames.axis[:, :, None], frames.across], 2)
    assert torch.allclose(basis @ basis.transpose(-1, -2), torch.eye(3).expand_as(basis), atol=1e-4)


def test_points_along_a_bone_are_measured_along_it():
    frames = bone_frames("lower_arm", ANCHORS)
    share = torch.tensor([0.0, 0.5, 1.0, 2.0])
    points = ANCHORS[:, :1] + share[:, None] * (ANCHORS[:, 1:] - ANCHORS[:, :1])
    found, nearest = point_features(frames, points, torch.zeros(2, 4))
    assert torch.allclose(found[..., 15], share.expand(2, -1), atol=1e-5)
    assert torch.allclose(found[..., 16:19], torch.zeros(2, 4, 3), atol=1e-5)
    assert torch.allclose(nearest[:, 3], frames.length[:, 0], atol=1e-5)
