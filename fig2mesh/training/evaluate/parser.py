"""Scores of the figure parser on a folder of annotated drawings without their transparency."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.errors import InputError
from fig2mesh.parse.infer import Inference, infer_figure
from fig2mesh.parse.keypoints import read_keypoints
from fig2mesh.parse.picture import read_mask, read_view
from fig2mesh.records import BoolArray, ByteArray
from fig2mesh.skeleton import JOINT, JOINT_MIRROR

BACKGROUNDS: Final = ("white", "hidden", "map")
"""Backgrounds of transparent pictures: white paper; the hidden colours of the file; a drawn map."""

PAIRS: Final = ("elbow", "wrist", "knee", "ankle")


@dataclass(frozen=True)
class Score:
    """Scores of one drawing.

    iou : of the silhouette; pck05, pck10 : share of visible joints within 0.05 and 0.1 of the figure's height
    sides : share of elbows, wrists, knees, ankles nearer to their own place than to their twin's
    visibility : share of joints whose visibility is right; doubts : of the parser itself
    """

    name: str
    iou: float
    pck05: float
    pck10: float
    sides: float
    visibility: float
    doubts: tuple[str, ...] = ()


def evaluate_parse(folder: Path, report: Callable[[str], None] = lambda line: None) -> str:
    """Return Markdown: a table of every drawing on white, and the means on each of `BACKGROUNDS`."""
    found = drawings(folder)
    by_background = {}
    for background in BACKGROUNDS:
        report(f"{len(found)} drawings on {background}")
        by_background[background] = [measure(each, background)[0] for each in found]
    lines = ["\n| transparent pictures on | silhouette IoU | PCK@0.05 | PCK@0.1 | sides |", "|---|---|---|---|---|"]
    for background, scores in by_background.items():
        mean = _mean(scores)
        lines.append(f"| {background} | {mean.iou:.3f} | {mean.pck05:.3f} | {mean.pck10:.3f} | {mean.sides:.3f} |")
    return table(by_background["white"]) + "\n".join(lines) + "\n"


def drawings(folder: Path) -> list[Path]:
    """The folders under `folder` that hold image.png, mask.png and keypoints.json."""
    found = [
        each
        for each in sorted(folder.iterdir())
        if each.is_dir() and all((each / name).is_file() for name in ("image.png", "mask.png", "keypoints.json"))
    ]
    if not found:
        raise InputError(
            folder, "no annotated drawings", "each needs a folder with image.png, mask.png, keypoints.json"
        )
    return found


def measure(folder: Path, background: str = "white") -> tuple[Score, Inference | None]:
    """Return the score of one drawing, and the inference."""
    view = read_view(folder / "image.png", None)
    rgba, mask = view.rgba, read_mask(folder / "mask.png", view)
    assert mask is not None  # a file was named
    truth = read_keypoints(folder / "keypoints.json")
    found = infer_figure(bare(rgba, background))
    if found is None:
        return Score(folder.name, 0.0, 0.0, 0.0, 0.0, 0.0, ("nothing found",)), None
    source = folder / "source.json"
    facts: dict[str, Any] = json.loads(source.read_text(encoding="utf-8")) if source.is_file() else {}
    ambiguous = bool(facts.get("lr_ambiguous"))
    return score(folder.name, found, mask, truth.points_px, truth.visible, ambiguous), found


def score(
    name: str, found: Inference, mask: BoolArray, joints: NDArray[np.floating], visible: BoolArray, either: bool
) -> Score:
    """Score an inference against ground truth; either : left and right may be swapped."""
    rows = np.flatnonzero(mask.any(axis=1))
    tall = float(rows[-1] - rows[0] + 1)
    both = float((mask & found.mask).sum()) / max(float((mask | found.mask).sum()), 1.0)
    place, seen = np.asarray(found.joints_px, float), found.visible
    off = np.linalg.norm(place - joints, axis=1) / tall
    if either:
        turned = np.linalg.norm(place[list(JOINT_MIRROR)] - joints, axis=1) / tall
        if turned[visible].mean() < off[visible].mean():
            off, place, seen = turned, place[list(JOINT_MIRROR)], seen[list(JOINT_MIRROR)]
    right = []
    for pair in PAIRS:
        here, there = JOINT[f"l_{pair}"], JOINT[f"r_{pair}"]
        if np.linalg.norm(joints[here] - joints[there]) > 0.04 * tall:
            same = np.linalg.norm(place[[here, there]] - joints[[here, there]], axis=1).sum()
            crossed = np.linalg.norm(place[[here, there]] - joints[[there, here]], axis=1).sum()
            right.append(same < crossed)
    return Score(
        name,
        both,
        float((off < 0.05)[visible].mean()),
        float((off < 0.1)[visible].mean()),
        float(np.mean(right)) if right else 1.0,
        float((seen == visible).mean()),
        found.doubts,
    )


def bare(rgba: ByteArray, background: str) -> ByteArray:
    """(H, W, 3) picture without transparency, on one of `BACKGROUNDS`."""
    if background == "hidden" or (rgba[..., 3] == 255).all():
        return np.ascontiguousarray(rgba[..., :3])
    alpha = rgba[..., 3:].astype(np.float32) / 255
    behind: Any = 255.0
    if background == "map":
        from PIL import Image

        from fig2mesh.training.drawing.background import draw_background

        height, width = rgba.shape[:2]
        made = np.clip(draw_background("coast", (256, 256), np.random.default_rng(3)), 0, 255).astype(np.uint8)
        behind = np.asarray(Image.fromarray(made).resize((max(height, width),) * 2))[:height, :width]
    return np.asarray(np.rint(rgba[..., :3] * alpha + behind * (1 - alpha)), np.uint8)


def table(scores: list[Score]) -> str:
    """Format scores as a Markdown table, the mean last."""
    lines = [
        "| figure | silhouette IoU | PCK@0.05 | PCK@0.1 | sides | visibility | the parser's own doubts |",
        "|---|---|---|---|---|---|---|",
    ]
    for each in (*scores, _mean(scores)):
        lines.append(
            f"| {each.name} | {each.iou:.3f} | {each.pck05:.2f} | {each.pck10:.2f} | {each.sides:.2f} "
            f"| {each.visibility:.2f} | {'; '.join(each.doubts)} |"
        )
    return "\n".join(lines) + "\n"


def _mean(scores: list[Score]) -> Score:
    def mean(name: str) -> float:
        return float(np.mean([getattr(each, name) for each in scores]))

    return Score("mean", mean("iou"), mean("pck05"), mean("pck10"), mean("sides"), mean("visibility"))
