"""Detection of figures on a whole sheet, by sliding windows of many sizes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from fig2mesh.parse.infer import Inference, box_of, infer_figure, predict, square
from fig2mesh.parse.joints import decode
from fig2mesh.parse.picture import on_white, read_view
from fig2mesh.records import ByteArray

MAX_SIDE_PX: Final = 2400
"""Largest number of pixels along the longer side of a sheet that is searched; figures found are read in full."""

STEP: Final = 0.45
"""Stride of windows, share of their edge: a figure is whole in one of them."""

SCALE_STEP: Final = 0.62
"""Ratio of window edges, each to the next larger one: the network was trained on figures of this range of sizes."""

MIN_FIRST_CONFIDENCE: Final = 0.42
"""Confidence threshold, mean over the joints, for evaluating a window again with the figure in its middle."""

MIN_CONFIDENCE: Final = 0.6
"""Confidence threshold of a figure, mean over its joints. Plain map gives up to 0.55, whole figures 0.65 and more."""

MIN_OVERLAP: Final = 0.45
"""Overlap threshold, share of the smaller box, above which two boxes are of one figure."""

BATCH: Final = 8


@dataclass(frozen=True)
class SheetFigure:
    """Figure on a sheet.

    bbox : x0, y0, x1, y1, IMAGE of the sheet, with some room; confidence : mean of its joints', 0-1
    found : its annotation, in pixels of `bbox`
    """

    bbox: tuple[int, int, int, int]
    confidence: float
    found: Inference


def find_figures(sheet: Path | str, smallest_px: float | None = None) -> list[SheetFigure]:
    """Find the people drawn on a sheet, from the top down.

    sheet : picture of any size that memory holds; smallest_px : height of the smallest figure to find,
    pixels; default: a tenth of the longer side

    Raises FigureError where the picture cannot be read.
    """
    return figures_in(on_white(read_view(Path(sheet), None).rgba), smallest_px)


def figures_in(
    rgb: ByteArray, smallest_px: float | None = None, advance: Callable[[str], object] = lambda name: None
) -> list[SheetFigure]:
    """Find the figures in a picture, from the top down.

    rgb : (H, W, 3) uint8; smallest_px : height of the smallest figure to find; None: a tenth of the longer side
    advance : called with a description of each step
    """
    height, width = rgb.shape[:2]
    scale = min(1.0, MAX_SIDE_PX / max(height, width))
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    small = np.asarray(Image.fromarray(rgb).resize(size, Image.Resampling.BOX)) if scale < 1 else rgb
    smallest = (0.1 * max(height, width) if smallest_px is None else smallest_px) * scale
    candidates: list[tuple[float, NDArray[np.float64]]] = []
    for edge in _edges(max(small.shape[:2]), smallest):
        advance(f"windows of {round(edge / scale)} px")
        for centre in _promising(small, edge):
            candidates += _centred(small, centre, edge)
    kept: list[tuple[float, NDArray[np.float64]]] = []
    for score, box in sorted(candidates, key=lambda each: -each[0]):
        if all(_shared(box, other) < MIN_OVERLAP for _, other in kept):
            kept.append((score, box))
    figures: list[SheetFigure] = []
    for _, box in kept:
        advance("figure")
        figure = _whole(rgb, box / scale)
        # Two boxes may have led to one figure.
        if figure is not None and not any(_shared(_array(figure), _array(other)) > MIN_OVERLAP for other in figures):
            figures.append(figure)
    return sorted(figures, key=lambda each: (each.bbox[1], each.bbox[0]))


def _edges(longest: float, smallest: float) -> list[float]:
    edges = [float(longest)]
    while edges[-1] * SCALE_STEP >= 1.15 * smallest:
        edges.append(edges[-1] * SCALE_STEP)
    return edges


def _centres(shape: tuple[int, ...], edge: float) -> NDArray[np.float64]:
    """(N, 2) x, y of windows that cover the sheet."""
    axes = []
    for length in (shape[1], shape[0]):
        count = max(int(np.ceil((length - edge) / (STEP * edge))), 0) + 1
        low, high = min(edge / 2, length / 2), max(length - edge / 2, length / 2)
        axes.append(np.linspace(low, high, count))
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)


def _promising(rgb: ByteArray, edge: float) -> Iterator[NDArray[np.float64]]:
    """Centres of windows that may hold a figure, by one prediction each without its mirror image."""
    import torch

    from fig2mesh.nets import figure_parser

    net = figure_parser.PARSER_WEIGHTS.shipped(figure_parser.SHIPPED)
    centres = _centres(rgb.shape, edge)
    for start in range(0, len(centres), BATCH):
        part = centres[start : start + BATCH]
        pictures = np.stack([square(rgb, centre - edge / 2, edge, figure_parser.INPUT) for centre in part])
        batch = torch.from_numpy(pictures.astype(np.float32).transpose(0, 3, 1, 2) / 255)
        with torch.inference_mode():
            heat = net(batch.contiguous(memory_format=torch.channels_last)).heat
        shares = heat.flatten(2).softmax(dim=2).reshape(heat.shape).numpy()
        for centre, share in zip(part, shares, strict=True):
            if float(decode(share, 0.8)[1].mean()) > MIN_FIRST_CONFIDENCE:
                yield centre


def _centred(rgb: ByteArray, centre: NDArray[np.float64], edge: float) -> list[tuple[float, NDArray[np.float64]]]:
    """Confidence and bounding box of the figure in a window, after a prediction with it in the middle; or nothing."""
    box = box_of(predict(rgb, centre, edge), rgb.shape[:2])
    if box is None:
        return []
    prediction = predict(rgb, (box[:2] + box[2:]) / 2, 1.24 * float((box[2:] - box[:2]).max()))
    box = box_of(prediction, rgb.shape[:2])
    score = float(decode(prediction.heat, 0.8)[1].mean())
    return [] if box is None or score < MIN_CONFIDENCE else [(score, box)]


def _whole(rgb: ByteArray, box: NDArray[np.float64]) -> SheetFigure | None:
    height, width = rgb.shape[:2]
    room = 0.08 * float((box[2:] - box[:2]).max())
    low = np.maximum(np.floor(box[:2] - room), 0).astype(int)
    high = np.minimum(np.ceil(box[2:] + room), [width, height]).astype(int)
    found = infer_figure(rgb[low[1] : high[1], low[0] : high[0]])
    if found is None or float(found.confidence.mean()) < MIN_CONFIDENCE:
        return None
    return _tight(found, (int(low[0]), int(low[1])))


def _tight(found: Inference, corner: tuple[int, int]) -> SheetFigure:
    """Crop a figure to the bounding box of its silhouette and joints, with a margin of some pixels."""
    rows, columns = np.flatnonzero(found.mask.any(axis=1)), np.flatnonzero(found.mask.any(axis=0))
    height, width = found.mask.shape
    room = max(2, round(0.02 * (rows[-1] - rows[0] + 1)))
    low, high = found.joints_px.min(axis=0), found.joints_px.max(axis=0)
    x0, y0 = (max(int(min(a, b)) - room, 0) for a, b in ((columns[0], low[0]), (rows[0], low[1])))
    x1 = min(int(max(columns[-1] + 1, np.ceil(high[0]))) + room, width)
    y1 = min(int(max(rows[-1] + 1, np.ceil(high[1]))) + room, height)
    inner = replace(
        found,
        mask=found.mask[y0:y1, x0:x1],
        part_labels=found.part_labels[y0:y1, x0:x1],
        joints_px=found.joints_px - np.array([x0, y0], np.float32),
    )
    x, y = corner
    return SheetFigure((x + x0, y + y0, x + x1, y + y1), float(found.confidence.mean()), inner)


def _array(figure: SheetFigure) -> NDArray[np.float64]:
    return np.array(figure.bbox, np.float64)


def _shared(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Overlap of two boxes, share of the smaller one."""
    low, high = np.maximum(one[:2], other[:2]), np.minimum(one[2:], other[2:])
    common = float(np.prod(np.maximum(high - low, 0)))
    areas = [max(float(np.prod(box[2:] - box[:2])), 1e-9) for box in (one, other)]
    return common / min(areas)
