"""The page of `fig2mesh annotate` in a real browser: what is dragged and painted there is what the main job reads."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fig2mesh.annotate.editing import begin
from fig2mesh.annotate.job import page, preview_page
from fig2mesh.annotate.server import annotation_server
from fig2mesh.parse.annotation import Annotation, write_annotation
from fig2mesh.parse.read import read_figure
from fig2mesh.skeleton import JOINT, PART
from tests.browser import chromium, pixels, serving
from tests.drawn import DrawnFiles, write_figure
from tests.node import ROOT, installed, runner

pytestmark = pytest.mark.slow


@pytest.fixture
def files(tmp_path: Path) -> DrawnFiles:
    return write_figure(tmp_path)


@pytest.fixture
def address(files: DrawnFiles, tmp_path: Path) -> Iterator[str]:
    """A served page whose annotations are saved in tmp_path / "saved"."""
    subject, start = begin(files.image, files.mask, files.keypoints, None, None)

    def save(annotation: Annotation) -> str:
        write_annotation(tmp_path / "saved", annotation, files.image.name, overwrite=True)
        return "saved in a folder"

    def preview(annotation: Annotation) -> str:
        return preview_page(subject, annotation, "outline")

    with serving(annotation_server(page(subject), subject, start, save, preview)) as url:
        yield url


def edit(url: str, *actions: dict[str, Any]) -> list[dict[str, Any]]:
    run = runner(installed(ROOT / "build" / "browser", "playwright-core"))
    done = run("annotate.mjs", stdin={"browser": chromium(), "url": url, "actions": actions})
    assert done["messages"] == []
    return list(done["results"])


def read_back(files: DrawnFiles, tmp_path: Path) -> Any:
    saved = tmp_path / "saved"
    return read_figure(
        files.image,
        mask=saved / "mask.png",
        keypoints=saved / "keypoints.json",
        part_labels=saved / "part_labels.png",
    )


def test_a_joint_dragged_and_strokes_painted_are_read_by_the_main_job(
    address: str, files: DrawnFiles, tmp_path: Path
) -> None:
    before = read_figure(files.image, mask=files.mask, keypoints=files.keypoints)
    elbow, head = before.joints_px[JOINT["l_elbow"]].tolist(), before.joints_px[JOINT["head"]].tolist()
    results = edit(
        address,
        {"drag": [elbow, [elbow[0] + 10, elbow[1] + 30]]},
        {"key": "v"},
        {"choose": ["#r_arm", "front"]},
        {"key": "2"},
        {"fill": ["#width", "20"]},
        {"drag": [[10, 10], [60, 10]]},
        {"choose": ["#part", str(PART["hair"])]},
        {"drag": [head, [head[0] + 5, head[1]]]},
        {"key": "Control+s"},
        {"saved": True},
    )
    assert results[5]["inside"] > results[4]["inside"] + 900
    after = read_back(files, tmp_path)
    moved = after.joints_px - before.joints_px
    # Pointers have whole pixels of the screen.
    assert moved[JOINT["l_elbow"]].tolist() == pytest.approx([10, 30], abs=1.0)
    others = [index for name, index in JOINT.items() if name != "l_elbow"]
    assert np.array_equal(after.joints_px[others], before.joints_px[others])
    assert not after.visible[JOINT["l_elbow"]]
    assert after.visible.sum() == before.visible.sum() - 1
    assert after.depth_order == {"r_arm": "front"}
    assert after.mask[4:16, 10:60].all()
    assert after.mask.sum() == pytest.approx(before.mask.sum() + 20 * 50 + 100 * np.pi, rel=0.02)
    assert after.part_labels[int(head[1]), int(head[0])] == PART["hair"]
    assert set(np.unique(after.part_labels)) == {0, PART["hair"]}


def test_undo_and_swap_and_keys(address: str, files: DrawnFiles) -> None:
    _, given = begin(files.image, files.mask, files.keypoints, None, None)
    start = dict(zip(JOINT, given.joints_px.tolist(), strict=True))
    results = edit(
        address,
        {"choose": ["#joint", "r_knee"]},
        {"key": "ArrowLeft"},
        {"key": "Shift+ArrowUp"},
        {"key": "s"},
        {"key": "Control+z"},
        {"key": "Control+z"},
        {"key": "2"},
        {"key": " "},
        {"key": "Control+z"},
        {"key": "Control+Shift+z"},
    )
    x, y = start["r_knee"]
    assert results[2]["joints"]["r_knee"][:2] == [x - 1, y - 10]
    assert results[3]["joints"]["l_knee"][:2] == [x - 1, y - 10]
    assert results[3]["joints"]["r_elbow"][:2] == start["l_elbow"]
    assert results[4]["joints"] == results[2]["joints"]
    assert results[5]["joints"]["r_knee"][:2] == [x, y]
    assert results[8]["inside"] == results[6]["inside"]
    assert results[9]["inside"] == results[7]["inside"]


def test_arrows_move_the_joint_that_was_chosen_in_the_list(address: str, files: DrawnFiles) -> None:
    _, given = begin(files.image, files.mask, files.keypoints, None, None)
    x, y = given.joints_px[JOINT["r_wrist"]].tolist()
    results = edit(
        address,
        {"choose": ["#joint", "r_wrist"]},
        {"press": ["#joint", "ArrowLeft"]},
        {"press": ["#save", "Shift+ArrowDown"]},
        {"press": ["#visible", "ArrowUp"]},
        {"choose": ["#part", str(PART["hair"])]},
    )
    assert results[1]["selected"] == "r_wrist"
    assert results[3]["joints"]["r_wrist"][:2] == [x - 1, y + 9]
    assert results[3]["present"] == ""
    assert results[4]["present"].strip() == "from the outline 100 %"


def test_the_preview_shows_the_solid(address: str) -> None:
    (shown,) = edit(address, {"preview": True})
    picture = pixels(shown["png"])[..., :3].astype(int)
    solid = picture[:, 420:820]
    red = (solid[..., 0] > 120) & (solid[..., 1] < 90) & (solid[..., 2] < 90)
    assert red.sum() > 500  # the shirt
