"""Inputs and results of training the texture networks, on ellipsoids whose surface is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fig2mesh.errors import FigureError
from fig2mesh.nets.head_hsv import HEAD_WEIGHTS, HeadShape
from fig2mesh.nets.texture_fill import FILL_WEIGHTS, FillShape
from fig2mesh.nets.uv_unet import UV_WEIGHTS, UvUnetShape
from fig2mesh.nets.view_refine import REFINE_WEIGHTS, RefineShape
from fig2mesh.skeleton import PART
from fig2mesh.texture.space import spread
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.networks.train_fill import train_fill
from fig2mesh.training.networks.train_refine import train_head, train_refine
from fig2mesh.training.networks.train_uv import train_uv
from fig2mesh.training.samples.texture_data import load_drawings
from fig2mesh.training.samples.unfold import places, unfold
from tests.fig2mesh.training.ellipsoids import BACK, FRONT, QUARTERS, SIZE, drawings, ellipsoid, write_shards

RADII = (0.5, 0.8, 0.3)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ellipsoids") / "data"
    write_shards(folder)
    return folder


@pytest.mark.parametrize("radii", [RADII, (1.2, 0.8, 0.3), (0.4, 0.8, 1.1)], ids=["slim", "wide", "deep"])
def test_every_side_tells_where_its_points_lie_behind_the_front_picture(radii: tuple[float, float, float]) -> None:
    """Also where sides are drawn at other scales, because a figure is wider than high from some of them."""
    body = ellipsoid(radii)
    found = places(body["labels"], body["depth"])
    pitch = 2 * max(radii[:2]) / (0.9 * SIZE)
    points = body["points"]
    truth = np.stack([points[..., 0], -points[..., 1]], axis=-1) / (pitch * SIZE / 2)
    seen = body["labels"] > 0
    # Boxes are known to a pixel, which is 2 / 64 of a picture's edge.
    assert np.abs(found - truth)[seen].max() < 2.5 / SIZE * 2


def test_spread_is_a_weighted_mean() -> None:
    uv = np.array([[0.1, 0.6], [0.12, 0.62], [0.9, 0.1]])
    means, total = spread(uv, np.array([[1.0], [3.0], [7.0]]), np.array([1.0, 3.0, 2.0]), size=4)
    assert means[2, 0, 0] == pytest.approx(2.5)
    assert total[2, 0] == 4.0
    assert means[0, 3, 0] == 7.0
    assert (total > 0).sum() == 2


def test_texture_space_knows_front_and_back_apart() -> None:
    bodies = unfold(drawings(1))
    from_front = np.abs((np.arange(bodies.part.shape[1]) + 0.5) / bodies.part.shape[1] - 0.5)
    for columns, colour in ((from_front < 0.2, FRONT), (from_front > 0.3, BACK)):
        there = bodies.there & columns
        assert there.any()
        assert np.abs(bodies.truth[there].astype(int) - colour).max() < 8
    assert not bodies.observed[..., from_front > 0.3].any()
    assert bodies.same[bodies.there].mean() > 0.9
    assert set(np.unique(bodies.part)) == {0, *(PART[name] for names in QUARTERS for name in names)}


def test_bodies_without_texture_coordinates_are_left_out(tmp_path: Path) -> None:
    made = drawings(3)
    made.uv[1] = 0
    np.savez(tmp_path / "train-00000.npz", picture=made.picture, labels=made.labels, depth=made.depth, uv=made.uv)
    assert len(load_drawings(tmp_path, ("train",), pictures=False)) == 2
    assert len(load_drawings(tmp_path, ("train",), pictures=True, limit=1)) == 1


def test_data_without_pictures_is_one_line(tmp_path: Path) -> None:
    np.savez(tmp_path / "train-00000.npz", joints=np.zeros(3))
    with pytest.raises(FigureError, match="not a readable shard"):
        load_drawings(tmp_path, ("train",), pictures=True)


@pytest.mark.slow
def test_texture_coordinates_are_learned_from_parts_and_less_well_without(data: Path, tmp_path: Path) -> None:
    """From depth alone an ellipsoid looks the same from two sides; its parts distinguish them."""
    errors = {}
    for masks in (True, False):
        shape = UvUnetShape(masks, filters=8)
        found = train_uv(data, tmp_path / str(masks), Schedule(steps=140, rate=5e-3), shape)
        errors[masks] = found["valid-clips_mae"]
        net, facts = UV_WEIGHTS.read(UV_WEIGHTS.path(shape, tmp_path / str(masks)))
        assert net.shape == shape
        assert facts["scores"] == found
    # The mean of all is off by a quarter.
    assert errors[True] < 0.12
    assert errors[True] < 0.7 * errors[False]


@pytest.mark.slow
def test_networks_of_unseen_sides_learn_one_after_the_other(data: Path, tmp_path: Path) -> None:
    """Coordinates cannot find the colour of the back in the front; the refining networks can learn it."""
    found = train_fill(data, tmp_path, Schedule(steps=20))
    assert found["valid-clips_psnr"] > found["valid-clips_front_psnr"] - 0.1
    net, facts = FILL_WEIGHTS.read(FILL_WEIGHTS.path(FillShape(), tmp_path))
    assert net.shape.size == 128
    assert facts["bodies"] == 12
    found = train_refine(data, tmp_path, tmp_path / "refine", Schedule(steps=150), filters=8)
    assert found["valid-clips_mae"] < 0.9 * found["valid-clips_painted_mae"]
    assert REFINE_WEIGHTS.read(REFINE_WEIGHTS.path(RefineShape(), tmp_path / "refine"))[1]["scores"] == found
    found = train_head(data, tmp_path, tmp_path / "head", Schedule(steps=10, batch=4), shape=HeadShape(4, 8))
    assert 0 < found["valid-clips_mae"] < 1
    assert HEAD_WEIGHTS.read(HEAD_WEIGHTS.path(HeadShape(), tmp_path / "head"))[1]["scores"] == found
