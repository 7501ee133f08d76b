"""The networks of textures: what goes in, what comes out, and what they give before they have learned."""

from __future__ import annotations

import colorsys
from pathlib import Path

import numpy as np
import pytest
import torch

from fig2mesh.errors import InputError
from fig2mesh.nets.head_hsv import HEAD_WEIGHTS, HeadHsv, HeadShape, disc_value, enhance, rgb_of
from fig2mesh.nets.hourglass import Hourglass
from fig2mesh.nets.texture_fill import FILL_WEIGHTS, FillShape, TextureFill, fill_inputs, sample
from fig2mesh.nets.uv_unet import PARTS, UV_WEIGHTS, UvUnet, UvUnetShape, infer_uv, uv_inputs
from fig2mesh.nets.view_refine import REFINE_WEIGHTS, RefineShape, ViewRefine, refine
from fig2mesh.skeleton import PART
from fig2mesh.training.networks.loop import seeded


def test_a_picture_comes_out_as_large_as_it_went_in() -> None:
    net = seeded(0, lambda: Hourglass(3, 2, 4)).eval()
    assert net(torch.rand(2, 3, 32, 48)).shape == (2, 2, 32, 48)
    net.start_at_zero()
    assert not net(torch.rand(2, 3, 32, 48)).any()


def test_depth_goes_into_the_channel_of_its_part() -> None:
    labels = torch.zeros(1, 4, 4, dtype=torch.uint8)
    labels[0, 0] = PART["torso"]
    labels[0, 1] = PART["r_foot"]
    labels[0, 2] = PART["garment"]
    depth = torch.full((1, 4, 4), 0.3)
    depth[0, 3] = -torch.inf
    inputs = uv_inputs(depth, labels)
    assert inputs.shape == (1, PARTS, 4, 4)
    assert torch.isfinite(inputs).all()
    assert (inputs[0, 0, 0] > 0).all()
    assert (inputs[0, PART["r_foot"] - 1, 1] > 0).all()
    assert not inputs[0, :, 2:].any()
    assert (uv_inputs(depth, labels, masks=False)[0, 0, :3] > 0).all()


def test_how_far_away_a_figure_stands_does_not_matter() -> None:
    labels = torch.ones(1, 8, 8, dtype=torch.uint8)
    depth = torch.rand(1, 8, 8)
    torch.testing.assert_close(uv_inputs(depth, labels), uv_inputs(depth + 7, labels), atol=1e-5, rtol=0)


def test_nothing_seen_is_no_error() -> None:
    nothing = torch.zeros(1, 16, 16, dtype=torch.uint8)
    assert not uv_inputs(torch.full((1, 16, 16), -torch.inf), nothing).any()


def test_texture_coordinates_are_within_the_texture() -> None:
    net = seeded(0, lambda: UvUnet(UvUnetShape(filters=4))).eval()
    found = infer_uv(net, torch.rand(2, 32, 32), torch.ones(2, 32, 32, dtype=torch.uint8))
    assert found.shape == (2, 2, 32, 32)
    assert found.min() >= 0
    assert found.max() <= 1


def test_without_learning_the_back_is_the_front() -> None:
    net = seeded(0, lambda: TextureFill(FillShape(16, 4))).eval()
    place = torch.rand(1, 2, 16, 16) * 2 - 1
    there = torch.ones(1, 16, 16, dtype=torch.bool)
    inputs = fill_inputs(place, there, there, there, torch.rand(1, 3, 16, 16))
    assert not net(inputs).any()


def test_pictures_are_sampled_at_places() -> None:
    columns = torch.arange(8.0).expand(1, 1, 8, 8)
    centres = (torch.arange(8) + 0.5) / 4 - 1
    place = torch.stack(torch.meshgrid(centres, centres, indexing="xy"))[None]
    torch.testing.assert_close(sample(columns, place), columns)
    assert sample(columns, place + 2).min() == 7, "beyond the border it goes on"


COLOURS = torch.rand(1, 3, 40, 40, generator=torch.Generator().manual_seed(0))


def test_colours_survive_the_disc() -> None:
    torch.testing.assert_close(rgb_of(disc_value(COLOURS)), COLOURS, atol=1e-5, rtol=0)
    found = disc_value(COLOURS)[0].reshape(3, -1).T.numpy()
    for colour, (x, y, value) in zip(COLOURS[0].reshape(3, -1).T.tolist()[:200], found[:200], strict=True):
        hue, saturation, brightness = colorsys.rgb_to_hsv(*colour)
        angle = 2 * np.pi * hue
        np.testing.assert_allclose(
            (x, y, value), (saturation * np.cos(angle), saturation * np.sin(angle), brightness), atol=1e-5
        )


def test_greys_have_no_hue() -> None:
    grey = torch.full((1, 3, 2, 2), 0.4)
    assert not disc_value(grey)[:, :2].any()
    torch.testing.assert_close(rgb_of(disc_value(grey)), grey)


def test_only_heads_are_made_anew() -> None:
    net = seeded(0, lambda: HeadHsv(HeadShape(4, 8))).eval()
    rgb = torch.rand(2, 3, 96, 96)
    head = torch.zeros(2, 96, 96, dtype=torch.bool)
    head[0, 10:40, 30:62] = True
    found = enhance(net, rgb, torch.rand(2, 2, 96, 96), head)
    assert torch.equal(found[1], rgb[1])
    assert torch.equal(found[0][:, ~head[0]], rgb[0][:, ~head[0]])


def test_an_untrained_head_network_gives_heads_as_they_are() -> None:
    """Up to the resampling there and back, of a head that has about as many pixels as the network."""
    net = seeded(0, lambda: HeadHsv(HeadShape(4, 8))).eval()
    ramp = torch.linspace(0.2, 0.8, 96)
    rgb = torch.stack([ramp.expand(96, 96), ramp[:, None].expand(96, 96), 0 * ramp.expand(96, 96) + 0.5])[None]
    head = torch.zeros(1, 96, 96, dtype=torch.bool)
    head[0, 18:74, 20:76] = True
    found = enhance(net, rgb, torch.zeros(1, 2, 96, 96), head)
    inner = torch.zeros_like(head)
    inner[0, 21:71, 23:73] = True
    torch.testing.assert_close(found[0][:, inner[0]], rgb[0][:, inner[0]], atol=0.02, rtol=0)


def test_an_untrained_refining_network_changes_nothing() -> None:
    net = seeded(0, lambda: ViewRefine(RefineShape(4))).eval()
    painted, uv = torch.rand(1, 3, 32, 32), torch.rand(1, 2, 32, 32)
    labels = torch.ones(1, 32, 32, dtype=torch.uint8)
    assert torch.equal(refine(net, painted, uv, torch.rand(1, 32, 32), labels), painted)


def test_weights_are_read_as_they_were_written(tmp_path: Path) -> None:
    for name, net, save, read in (
        ("uv", UvUnet(UvUnetShape(False, 4)), UV_WEIGHTS.save, UV_WEIGHTS.read),
        ("fill", TextureFill(FillShape(16, 4)), FILL_WEIGHTS.save, FILL_WEIGHTS.read),
        ("refine", ViewRefine(RefineShape(4)), REFINE_WEIGHTS.save, REFINE_WEIGHTS.read),
        ("head", HeadHsv(HeadShape(4, 8)), HEAD_WEIGHTS.save, HEAD_WEIGHTS.read),
    ):
        path = tmp_path / f"{name}.safetensors"
        save(path, net, {"seed": 3})
        found, facts = read(path)
        assert facts["seed"] == 3
        for key, value in net.state_dict().items():
            torch.testing.assert_close(found.state_dict()[key].float(), value.float(), atol=1e-3, rtol=1e-3)
        with pytest.raises(InputError, match="not the weights"):
            (FILL_WEIGHTS.read if name == "uv" else UV_WEIGHTS.read)(path)
