from __future__ import annotations

import numpy as np
import pytest
import torch

from fig2mesh.nets.disn import VARIANTS, Disn, DisnShape, as_input


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
    return as_input(masks), anchors, places


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


@pytest.mark.parametrize("variant", ["one-stream-pose", "two-stream-pose"])
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


@pytest.mark.parametrize("variant", ["one-stream-pose", "two-stream-pose"])
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
    dot = np.zeros((1, 64, 64), bool)
    dot[0, 4, 8] = True
    features = net.encode(as_input(dot), torch.zeros(1, 2, 3))
    empty = net.encode(as_input(dot & False), torch.zeros(1, 2, 3))
    x, y = 8.5 / 32 - 1, 1 - 4.5 / 32
    there = torch.tensor([[[x, y, 0.0], [-x, y, 0.0], [x, -y, 0.0], [-x, -y, 0.0]]])
    change = (net.local_share(features, there) - net.local_share(empty, there)).norm(dim=-1)[0]
    assert change[0] > 3 * change[1:].max()
