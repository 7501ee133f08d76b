"""The network that parses figures: sizes, round trip of its weights, what ships."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from fig2mesh.errors import InputError
from fig2mesh.nets.figure_parser import HEAT, INPUT, JOINTS, LABELS, MASK, PARSER_WEIGHTS, SHIPPED, FigureParser
from fig2mesh.nets.part_size import PartSizeNet, SizeShape


def test_sizes() -> None:
    found = FigureParser()(torch.zeros(2, 3, INPUT, INPUT))
    assert found.silhouette.shape == (2, MASK, MASK)
    assert found.labels.shape == (2, LABELS, MASK, MASK)
    assert found.heat.shape == (2, JOINTS, HEAT, HEAT)
    assert found.visible.shape == (2, JOINTS)


def test_an_untrained_network_says_nothing_of_masks() -> None:
    found = FigureParser()(torch.rand(1, 3, INPUT, INPUT))
    assert (found.silhouette == 0).all()
    assert (found.visible == 0).all()


def test_weights_read_back(tmp_path: Path) -> None:
    net = FigureParser().eval()
    path = PARSER_WEIGHTS.path(SHIPPED, tmp_path)
    PARSER_WEIGHTS.save(path, net, {"seed": 3})
    again, facts = PARSER_WEIGHTS.read(path)
    assert facts["seed"] == 3
    picture = torch.rand(1, 3, INPUT, INPUT)
    with torch.no_grad():
        assert torch.allclose(again(picture).heat, net(picture).heat, atol=0.05)


@pytest.mark.filterwarnings("ignore:Initializing zero-element tensors")
def test_other_weights_are_refused(tmp_path: Path) -> None:
    from fig2mesh.nets import weights

    path = PARSER_WEIGHTS.path(SHIPPED, tmp_path)
    weights.save(path, PartSizeNet(SizeShape("head")).state_dict(), {"shape": {"width": [1, 1, 1, 1]}})
    with pytest.raises(InputError, match="not the weights of a figure parser"):
        PARSER_WEIGHTS.read(path)


def test_what_ships_is_small() -> None:
    assert PARSER_WEIGHTS.path(SHIPPED).stat().st_size < 15e6
    assert sum(parameter.numel() for parameter in PARSER_WEIGHTS.shipped(SHIPPED).parameters()) < 4e6
