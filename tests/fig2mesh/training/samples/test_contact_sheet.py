"""The contact sheet of training data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.errors import InputError
from fig2mesh.field.camera import VIEW_YAW_DEG, axes
from fig2mesh.skeleton import BODY_PARTS, PART
from fig2mesh.training.drawing.raster import coverage, rasterise
from fig2mesh.training.samples.contact_sheet import REACH, SHOWN, TILE, compose, make_sheet
from tests.fig2mesh.training.demo_body import MATERIALS, body, render_view


def shard(count: int, pictures: bool) -> dict[str, np.ndarray]:
    """The arrays of a shard that a sheet shows, measured on demonstration bodies."""
    from fig2mesh.training.drawing.draw import draw

    out: dict[str, list[np.ndarray]] = {}
    for seed in range(count):
        rng = np.random.default_rng(seed)
        model = body(rng)
        v, f, part = model["vertices"], model["faces"], model["face_part"]
        boxes = [v[np.unique(f[part == p])] for p in BODY_PARTS]
        centre = np.array([(b.max(axis=0) + b.min(axis=0)) / 2 for b in boxes])
        edge = np.array([1.2 * np.ptp(b, axis=0).max() for b in boxes])
        masks = np.zeros((2, 4, 14, 64, 64), bool)
        for row, yaw in enumerate(VIEW_YAW_DEG.values()):
            turned = v @ axes(yaw).T
            for i, (middle, e) in enumerate(zip(centre @ axes(yaw).T, edge, strict=True)):
                frame = {"size": 64, "low": middle[:2] - e / 2, "pitch": e / 64}
                masks[0, row, i] = coverage(turned, f[part == i + 1], **frame)
                masks[1, row, i] = rasterise(turned, f, **frame).pick(part) == i + 1
        row = {
            "joints": rng.uniform(-0.5, 0.5, (21, 3)),
            "centre": centre,
            "edge": edge,
            "mask_amodal": np.packbits(masks[0], axis=-1),
            "mask_visible": np.packbits(masks[1], axis=-1),
        }
        if pictures:
            seen = [render_view(model, view) for view in VIEW_YAW_DEG]
            row["picture"] = np.stack([draw(layers, MATERIALS, rng, face=face) for layers, face in seen])
            row["labels"] = np.stack([layers.labels for layers, _ in seen])
            row["depth"] = np.stack([layers.depth for layers, _ in seen]).astype(np.float16)
        for name, value in row.items():
            out.setdefault(name, []).append(value)
    return {name: np.stack(values) for name, values in out.items()}


@pytest.mark.parametrize("pictures", [True, False])
def test_a_row_for_each_body(tmp_path: Path, pictures: bool) -> None:
    np.savez(tmp_path / "train-00000.npz", **shard(2, pictures))
    np.savez(tmp_path / "train-00001.npz", **shard(1, pictures))
    columns = 4 + 2 + len(SHOWN) + 1
    for count, rows in ((2, 2), (9, 3)):
        out = make_sheet(tmp_path, tmp_path / "sheets" / f"{count}.png", count)
        with Image.open(out) as picture:
            assert picture.size == (columns * TILE, rows * TILE)
            assert np.asarray(picture).std() > 10


def test_visible_masks_make_the_picture_of_the_labels() -> None:
    arrays = {name: value[0] for name, value in shard(1, False).items()}
    model = body(np.random.default_rng(0))
    for row, (view, yaw) in enumerate(VIEW_YAW_DEG.items()):
        seen = rasterise(
            model["vertices"] @ axes(yaw).T, model["faces"], size=TILE, low=(-REACH, -REACH), pitch=2 * REACH / TILE
        ).pick(model["face_part"])
        labels = compose(arrays["centre"], arrays["edge"], arrays["mask_visible"][row], view)
        # Two grids of different pitch differ along the parts' edges.
        assert (labels == seen).mean() > 0.985
        assert (labels == PART["head"]).any()


def test_what_is_no_shard_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no bodies"):
        make_sheet(tmp_path, tmp_path / "a.png")
    (tmp_path / "train-00000.npz").write_bytes(b"no archive")
    with pytest.raises(
        InputError, match=r"train-00000.npz: not a readable shard of training data.*fig2mesh data build"
    ):
        make_sheet(tmp_path, tmp_path / "a.png")
    np.savez(tmp_path / "train-00000.npz", joints=np.zeros((1, 21, 3)))
    with pytest.raises(InputError, match=r"no centre, edge.* in it"):
        make_sheet(tmp_path, tmp_path / "a.png")
