"""The figure parser on held-out crops, beside GrabCut and BlazePose on the same pictures.

GrabCut (Rother et al. 2004) is given the figure's true box; BlazePose the square round it. The parser is given the
picture alone.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fig2mesh.errors import InputError
from fig2mesh.parse.infer import Inference, infer_figure, square
from fig2mesh.records import BoolArray, ByteArray
from fig2mesh.skeleton import JOINT_NAMES, PART_NAMES
from fig2mesh.training.evaluate.parser import score
from fig2mesh.training.samples.crop_data import load_crops
from fig2mesh.training.samples.crop_views import CropView, CropViewer

SIZE: Final = 256
"""Edge of the pictures, pixels."""

SETS: Final = (
    ("bodies, unseen clips", "valid-clips", "bodies"),
    ("bodies, unseen people and clothes", "valid-characters", "bodies"),
    ("doodles, unseen clips", "valid-clips", "doodles"),
)

CropScores = dict[str, float]


def evaluate_crops(data: Path, count: int, blazepose: Path | None, report: Callable[[str], None]) -> str:
    """Return the scores as a Markdown table.

    blazepose : TFLite file of BlazePose "heavy"; needs the package ai-edge-litert
    """
    import cv2

    cv2.setNumThreads(1)
    other = None if blazepose is None else _blazepose(blazepose)
    lines = [
        "| held-out drawings | by | silhouette IoU | parts IoU | PCK@0.05 | PCK@0.1 | sides |",
        "|---|---|---|---|---|---|---|",
    ]
    for title, split, kind in SETS:
        viewer = CropViewer(load_crops(data, split, kind, limit=1), 1, backgrounds=60, size=SIZE)
        rng = np.random.default_rng(17)
        rows = np.linspace(0, len(viewer.crops) - 1, min(count, len(viewer.crops))).astype(int)
        found: dict[str, list[CropScores]] = {
            "fig2mesh": [],
            "GrabCut, box given": [],
            "BlazePose heavy, box given": [],
        }
        for row in rows:
            view = viewer.view(int(row), rng)
            mask = view.labels > 0
            if mask.sum() < 200:
                continue
            found["fig2mesh"].append(_scores(view, mask, infer_figure(view.picture)))
            found["GrabCut, box given"].append({"iou": _iou(_grabcut(view.picture, mask), mask)})
            if other is not None:
                found["BlazePose heavy, box given"].append(_scores(view, mask, other(view.picture, mask)))
        report(f"{title}: {len(found['fig2mesh'])} crops")
        for name, scores in found.items():
            if scores:
                cells = [
                    np.mean([s[key] for s in scores if key in s]) if any(key in s for s in scores) else None
                    for key in ("iou", "parts", "pck05", "pck10", "sides")
                ]
                shown = " | ".join("" if value is None else f"{value:.3f}" for value in cells)
                lines.append(f"| {title} | {name} | {shown} |")
    return "\n".join(lines) + "\n\n"


def _scores(view: CropView, mask: BoolArray, found: Inference | None) -> CropScores:
    joints = view.joints.astype(float) * SIZE
    if found is None:
        return {"iou": 0.0, "pck05": 0.0, "pck10": 0.0, "sides": 0.0}
    own = score("", found, mask, joints, view.visible, False) if view.visible.any() else None
    row = {"iou": _iou(found.mask, mask)}
    if own is not None:
        row |= {"pck05": own.pck05, "pck10": own.pck10, "sides": own.sides}
    if found.part_labels.any():
        each = [
            _iou(found.part_labels == part, view.labels == part)
            for part in range(1, len(PART_NAMES))
            if (view.labels == part).sum() > 20
        ]
        row["parts"] = float(np.mean(each))
    return row


def _iou(mask: BoolArray, truth: BoolArray) -> float:
    return float((mask & truth).sum()) / max(float((mask | truth).sum()), 1.0)


def _box(mask: BoolArray) -> tuple[int, int, int, int]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _grabcut(picture: ByteArray, truth: BoolArray) -> BoolArray:
    import cv2

    x0, y0, x1, y1 = _box(truth)
    rect = (max(x0 - 2, 1), max(y0 - 2, 1), min(x1 - x0 + 4, SIZE - 2), min(y1 - y0 + 4, SIZE - 2))
    labels = np.zeros(picture.shape[:2], np.uint8)
    models = np.zeros((1, 65)), np.zeros((1, 65))
    try:
        cv2.grabCut(np.ascontiguousarray(picture[..., ::-1]), labels, rect, *models, 5, cv2.GC_INIT_WITH_RECT)
    except cv2.error:
        return np.zeros_like(truth)
    return np.asarray((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD))


def _blazepose(path: Path) -> Callable[[ByteArray, BoolArray], Inference]:
    try:
        from ai_edge_litert.interpreter import Interpreter
    except ImportError:
        raise InputError("--blazepose", "ai-edge-litert is not installed", "pip install ai-edge-litert") from None
    from fig2mesh.training.networks.blazepose import LANDMARKS

    net: Any = Interpreter(model_path=str(path))
    net.allocate_tensors()
    inputs, outputs = net.get_input_details()[0]["index"], net.get_output_details()

    def run(picture: ByteArray, truth: BoolArray) -> Inference:
        x0, y0, x1, y1 = _box(truth)
        edge = 1.25 * max(x1 - x0, y1 - y0)
        low = np.array([x0 + x1, y0 + y1]) / 2 - edge / 2
        net.set_tensor(inputs, square(picture, low, edge, 256)[None].astype(np.float32) / 255)
        net.invoke()
        by_shape: dict[tuple[int, ...], NDArray[np.float32]] = {
            tuple(out["shape"]): net.get_tensor(out["index"]) for out in outputs
        }
        marks = by_shape[1, 195].reshape(39, 5)
        joints = np.stack([marks[list(rows), :2].mean(axis=0) for rows in LANDMARKS.values()])
        order = [list(LANDMARKS).index(name) for name in JOINT_NAMES]
        mask = by_shape[1, 256, 256, 1][0, :, :, 0] > 0
        scale = edge / 256
        y, x = np.mgrid[:SIZE, :SIZE] + 0.5
        column, row = ((x - low[0]) / scale).astype(int), ((y - low[1]) / scale).astype(int)
        inside = (column >= 0) & (column < 256) & (row >= 0) & (row < 256)
        whole = np.where(inside, mask[np.clip(row, 0, 255), np.clip(column, 0, 255)], False)
        places = (low + joints[order] * scale).astype(np.float32)
        seen = np.ones(len(places), np.bool_)
        return Inference(whole, np.zeros((SIZE, SIZE), np.uint8), places, seen, np.ones(len(places), np.float32), ())

    return run
