"""Training the figure parser: its targets, its losses, one short run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from fig2mesh.errors import FigureError
from fig2mesh.nets.figure_parser import HEAT, LABELS, MASK, PARSER_WEIGHTS, SHIPPED, Parsed
from fig2mesh.training.drawing.doodles import doodle, stance
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.networks.train_parse import collate, heat_targets, losses, peaks, sides_right, train_parse
from fig2mesh.training.samples.crop_data import FIELDS, RECIPE, load_crops
from fig2mesh.training.samples.crop_views import CropView


def test_targets_are_bells_round_the_joints() -> None:
    joints = torch.rand(3, 21, 2) * 0.8 + 0.1
    wanted = heat_targets(joints)
    assert torch.allclose(wanted.sum(dim=2), torch.ones(3, 21), atol=1e-4)
    places, sure = peaks(wanted.clamp_min(1e-12).log().reshape(3, 21, HEAT, HEAT))
    assert np.abs(places - joints.numpy()).max() * HEAT < 0.1
    assert (sure > 0.9).all()


def perfect(target: dict[str, torch.Tensor]) -> Parsed:
    mask = (target["labels"] > 0).float()
    labels = torch.nn.functional.one_hot(target["labels"], LABELS).permute(0, 3, 1, 2).float()
    heat = heat_targets(target["joints"]).clamp_min(1e-12).log().reshape(-1, 21, HEAT, HEAT)
    return Parsed(mask * 40 - 20, labels * 40, heat, target["visible"].float() * 40 - 20)


def target() -> dict[str, torch.Tensor]:
    rng = np.random.default_rng(0)
    labels = rng.integers(0, LABELS, (2 * MASK, 2 * MASK)).astype(np.uint8)
    seen = np.arange(21) % 3 > 0
    view = CropView(np.zeros((2 * MASK,) * 2 + (3,), np.uint8), labels, rng.random((21, 2), np.float32), seen, seen)
    return collate([view, view])


def test_the_truth_has_the_least_loss() -> None:
    wanted = target()
    best = losses(perfect(wanted), wanted)
    assert best["silhouette"] < 1e-3
    assert best["labels"] < 1e-3
    assert best["visible"] < 1e-3
    found = perfect(wanted)
    for worse in (
        found._replace(silhouette=-found.silhouette),
        found._replace(labels=-found.labels),
        found._replace(heat=found.heat.flip(-1)),
        found._replace(visible=-found.visible),
    ):
        assert losses(worse, wanted)["loss"] > best["loss"] + 0.1


def test_sides_are_counted_by_limbs() -> None:
    joints = np.random.default_rng(1).random((4, 21, 2)).astype(np.float32)
    from fig2mesh.skeleton import JOINT_MIRROR

    assert sides_right(joints, joints) == 1.0
    assert sides_right(joints[:, list(JOINT_MIRROR)], joints) == 0.0


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A few doodles as if they were all kinds of crops."""
    rng = np.random.default_rng(0)
    made = [crop for crop in (doodle(stance(rng), rng) for _ in range(6)) if crop is not None]
    for name in ("bodies-train", "doodles-train", "bodies-valid-clips", "bodies-valid-characters"):
        columns = {field: np.stack([getattr(crop, field) for crop in made]) for field in FIELDS}
        np.savez_compressed(tmp_path / f"{name}-00000.npz", **columns)
    (tmp_path / RECIPE).write_text("{}")
    return tmp_path


def test_no_crops_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(FigureError, match="make them with: fig2mesh data crops"):
        load_crops(tmp_path, "train")


@pytest.mark.slow
def test_a_short_run_writes_weights_and_scores(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # As many as there are doodles: none is scored twice.
    monkeypatch.setattr("fig2mesh.training.networks.train_parse.VIEWS", 6)
    scores = train_parse(data, data / "run", Schedule(steps=2, batch=2))
    _, facts = PARSER_WEIGHTS.read(PARSER_WEIGHTS.path(SHIPPED, data / "run"))
    assert facts["steps"] == 2
    assert facts["crops"] == len(load_crops(data, "train"))
    assert set(scores) == {"iou", "part_iou", "pck05", "pck10", "sides", "seen"}
    assert json.loads((data / "run" / "scores.json").read_text()) == scores
