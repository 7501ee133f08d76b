from __future__ import annotations

import numpy as np
import pytest
import torch

from fig2mesh.errors import InputError
from fig2mesh.nets import weights
from fig2mesh.nets.decode import decode, decode_counted, decode_dense, decode_many
from fig2mesh.nets.disn import PART_WEIGHTS, Disn, DisnShape, as_input
from fig2mesh.skeleton import ANCHORS

from .test_disn import disc, made

ANCHOR = np.array([[0.3, 0.1, 0.0], [-0.3, -0.1, 0.1]], np.float32)


@pytest.fixture(scope="module", params=["one-stream-pose", "two-stream-pose"])
def capsule(request: pytest.FixtureRequest) -> Disn:
    """A network that has learned a capsule of radius 0.3, so that its field has a slope of about 1."""
    net = made("hand", request.param)
    optimizer = torch.optim.Adam(net.parameters(), lr=1e-3)
    mask = as_input(disc()[None])
    start, end = torch.from_numpy(ANCHOR)
    generator = torch.Generator().manual_seed(0)
    for _ in range(80):
        points = torch.rand(1, 256, 3, generator=generator) * 2 - 1
        share = ((points - start) @ (end - start) / (end - start).dot(end - start)).clamp(0, 1)
        target = (points - start - share[..., None] * (end - start)).norm(dim=-1) - 0.3
        loss = (net(mask, torch.from_numpy(ANCHOR)[None], points) - target).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return net.eval()


def beside_the_surface(grid):
    """Nodes of all cells that have corners on both sides."""
    inside = grid < 0
    ends = (slice(None, -1), slice(1, None))
    corners = [inside[a, b, c] for a in ends for b in ends for c in ends]
    crossed = np.logical_or.reduce(corners) & ~np.logical_and.reduce(corners)
    nodes = np.zeros(grid.shape, bool)
    for a in ends:
        for b in ends:
            for c in ends:
                nodes[a, b, c] |= crossed
    return nodes


def test_fast_equals_dense(capsule):
    dense = decode_dense(capsule, disc(), ANCHOR, plain=True)
    fast, evaluated = decode_counted(capsule, disc(), ANCHOR)
    assert fast.shape == (64, 64, 64)
    assert fast.dtype == np.float32
    assert (dense < 0).any()
    assert ((fast < 0) == (dense < 0)).all()
    near = beside_the_surface(dense)  # what an isosurface or a column's extent is made of is never interpolated
    assert np.abs(fast - dense)[near].max() < 1e-4
    wide, _ = decode_counted(capsule, disc(), ANCHOR, band=1.0)
    assert np.abs(wide - dense)[np.abs(dense) < 2 / 63].max() < 1e-4
    assert np.abs(fast - dense).max() < 0.06  # interpolation over four spacings, across the field's ridge
    assert evaluated < 0.4 * 64**3


def test_short_cuts_of_the_dense_way_change_nothing(capsule):
    plain = decode_dense(capsule, disc(), ANCHOR, 16, plain=True)
    assert np.allclose(decode_dense(capsule, disc(), ANCHOR, 16), plain, atol=1e-5)


@pytest.mark.parametrize("nodes", [2, 5, 17, 33])
def test_other_sizes(capsule, nodes):
    dense, fast = decode_dense(capsule, disc(), ANCHOR, nodes), decode(capsule, disc(), ANCHOR, nodes)
    assert ((fast < 0) == (dense < 0)).all()


def test_grid_is_indexed_x_y_z(capsule):
    grid = decode_dense(capsule, disc(), ANCHOR, 9)
    axis = np.linspace(-1, 1, 9, dtype=np.float32)
    point = torch.from_numpy(axis[[7, 1, 4]].copy())[None, None]
    with torch.no_grad():
        value = capsule(as_input(disc()[None]), torch.from_numpy(ANCHOR)[None], point)
    assert grid[7, 1, 4] == pytest.approx(float(value), abs=1e-5)


def test_right_parts_are_the_mirror_image_of_left_ones(capsule):
    mask = disc()
    mask[:, 40:] = False
    found = decode_many({"hand": capsule}, {7: (mask, ANCHOR), 8: (mask[:, ::-1], ANCHOR * (-1, 1, 1))}, 17)
    assert np.array_equal(found[7], found[8][::-1])


@pytest.mark.parametrize("kind", ANCHORS)
@pytest.mark.parametrize("shown", [False, True])
def test_untrained_and_degenerate_input_stays_finite(kind, shown):
    net = made(kind, "two-stream-pose")
    grid = decode(net, np.full((64, 64), shown), np.zeros((net.shape.anchors, 3)), 16)
    assert np.isfinite(grid).all()


def test_weights_come_back_in_half_precision(tmp_path, capsule):
    net = capsule
    path = PART_WEIGHTS.path(net.shape, tmp_path)
    PART_WEIGHTS.save(path, net, {"seed": 3, "scores": {"iou": 0.5}})
    first = path.read_bytes()
    PART_WEIGHTS.save(path, net, {"seed": 3, "scores": {"iou": 0.5}})
    assert path.read_bytes() == first
    found, facts = PART_WEIGHTS.read(path)
    assert found.shape == net.shape
    assert (facts["seed"], facts["scores"]["iou"]) == (3, 0.5)
    for name, value in net.state_dict().items():
        assert torch.equal(found.state_dict()[name], value.half().float())
    assert not any(value.requires_grad for value in found.parameters())


def test_missing_and_broken_weights_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr(weights, "FOLDER", tmp_path)
    with pytest.raises(InputError, match="no such file"):
        PART_WEIGHTS.shipped(DisnShape.of("hand", "two-stream"))
    path = PART_WEIGHTS.path(DisnShape.of("hand", "two-stream"), tmp_path)
    path.write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="not a readable weights file"):
        PART_WEIGHTS.shipped(DisnShape.of("hand", "two-stream"))
    weights.save(path, {"x": torch.zeros(2)}, {"shape": {"kind": "hand", "variant": "two-stream"}})
    with pytest.raises(InputError, match="not the weights"):
        PART_WEIGHTS.shipped(DisnShape.of("hand", "two-stream"))
    weights.save(path, {"x": torch.tensor([np.nan])}, {})
    with pytest.raises(InputError, match="not finite"):
        PART_WEIGHTS.shipped(DisnShape.of("hand", "two-stream"))


def test_weights_are_read_once(tmp_path, monkeypatch):
    shape = DisnShape("foot")
    PART_WEIGHTS.save(tmp_path / PART_WEIGHTS.path(shape).name, made("foot", "two-stream-pose"), {})
    monkeypatch.setattr(weights, "FOLDER", tmp_path)
    weights.read_shipped.cache_clear()
    assert PART_WEIGHTS.shipped(shape) is PART_WEIGHTS.shipped(shape)
    weights.read_shipped.cache_clear()
