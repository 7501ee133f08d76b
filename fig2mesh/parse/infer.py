"""Silhouette, part labels and joints of one figure from the bare picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parse.joints import decode, doubts, visible_inside
from fig2mesh.parse.silhouette import refine
from fig2mesh.records import BoolArray, ByteArray, FloatArray
from fig2mesh.skeleton import JOINT_MIRROR, PART_MIRROR, PART_NAMES

MARGIN: Final = 0.12
"""Margin round the figure in the second pass, share of its size."""

DARK_THRESHOLD: Final = 70
RIM_TOLERANCE: Final = 12
PLAIN_RIM: Final = 0.7
"""A background is plain and dark where this share of the picture's rim is within `RIM_TOLERANCE` of a colour darker
than `DARK_THRESHOLD`."""

MAX_LABEL_CELLS: Final = 320
"""Cells per side of the raster of part labels; the network's own raster is a third as fine."""


@dataclass(frozen=True)
class Inference:
    """Inferred annotation, IMAGE.

    mask : (H, W) bool; part_labels : (H, W) uint8, `PART_NAMES`, 0 outside the mask
    joints_px : (21, 2) float32; visible : (21,) bool; confidence : (21,) float32, 0-1
    doubts : unlikely findings, as text
    """

    mask: BoolArray
    part_labels: ByteArray
    joints_px: FloatArray
    visible: BoolArray
    confidence: FloatArray
    doubts: tuple[str, ...]

    @property
    def score(self) -> float:
        """Mean confidence of the joints, 0-1, see `fig2mesh.parse.checks.person`."""
        return round(float(self.confidence.mean()), 3)


class Prediction(NamedTuple):
    """Prediction of the network for a square of the picture.

    likely : (n, n) probability of the figure, 0-1; labels : (18, n, n) 0-1; heat : (21, m, m), summing to 1
    visible : (21,) 0-1
    low, edge : upper left corner (x, y) and edge of the square, pixels
    """

    likely: FloatArray
    labels: FloatArray
    heat: FloatArray
    visible: FloatArray
    low: NDArray[np.float64]
    edge: float


def infer_figure(rgb: ByteArray, mask: BoolArray | None = None) -> Inference | None:
    """Infer the figure in a picture; None where the network finds none.

    rgb : (H, W, 3) uint8, a crop with one figure; mask : its silhouette, where it is known
    """
    height, width = rgb.shape[:2]
    shown = on_light(rgb)
    if mask is None:
        first = predict(shown, np.array([width, height]) / 2, 1.04 * max(height, width))
        box = box_of(first, (height, width))
        if box is None:
            return None
    else:
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        box = np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], float)
    second = predict(shown, (box[:2] + box[2:]) / 2, (1 + 2 * MARGIN) * float((box[2:] - box[:2]).max()))
    likely = spread(second.likely, second, (height, width))
    found = refine(rgb, likely) if mask is None else mask
    if not found.any():
        return None
    rows = np.flatnonzero(found.any(axis=1))
    columns = np.flatnonzero(found.any(axis=0))
    tall_px = float(max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1)
    places, sure = decode(second.heat, tall_px / second.edge)
    joints = visible_inside(second.low + places * second.edge, found, tall_px)
    joints = np.clip(joints, 0, [width, height])
    visible = second.visible > 0.5
    reasons = doubts(joints, sure, visible, found)
    outside = float((found & (likely < 0.5)).sum() + (~found & (likely > 0.5)).sum()) / float(found.sum())
    if mask is None and outside > 0.35:
        reasons.append("the silhouette is unsure")
    return Inference(
        mask=found,
        part_labels=part_labels(second, found),
        joints_px=joints.astype(np.float32),
        visible=visible,
        confidence=sure.astype(np.float32),
        doubts=tuple(reasons),
    )


def on_light(rgb: ByteArray) -> ByteArray:
    """Replace a plain dark background by white: the network was trained on light ones."""
    rim = np.concatenate([rgb[0], rgb[-1], rgb[:, 0], rgb[:, -1]]).astype(np.int16)
    colour = np.median(rim, axis=0)
    if colour.mean() > DARK_THRESHOLD or (np.abs(rim - colour).max(axis=1) <= RIM_TOLERANCE).mean() < PLAIN_RIM:
        return rgb
    background = (np.abs(rgb.astype(np.int16) - colour) <= RIM_TOLERANCE).all(axis=2)
    regions, _ = ndimage.label(background)
    ends = np.unique(np.concatenate([regions[0], regions[-1], regions[:, 0], regions[:, -1]]))
    outside = np.isin(regions, ends[ends > 0])
    return np.where(outside[..., None], np.uint8(255), rgb)


def predict(rgb: ByteArray, centre: NDArray[np.floating], edge: float) -> Prediction:
    """Prediction for a square of the picture: the mean over the square and its mirror image."""
    import torch

    from fig2mesh.nets import figure_parser

    low = np.asarray(centre, float) - edge / 2
    picture = square(rgb, low, edge, figure_parser.INPUT).astype(np.float32) / 255
    batch = torch.from_numpy(np.stack([picture, picture[:, ::-1]]).transpose(0, 3, 1, 2).copy())
    net = figure_parser.PARSER_WEIGHTS.shipped(figure_parser.SHIPPED)
    with torch.inference_mode():
        found = net(batch.contiguous(memory_format=torch.channels_last))
    likely = found.silhouette.sigmoid().numpy()
    labels = found.labels.softmax(dim=1).numpy()
    heat = found.heat.flatten(2).softmax(dim=2).reshape(found.heat.shape).numpy()
    visible = found.visible.sigmoid().numpy()
    return Prediction(
        likely=(likely[0] + likely[1][:, ::-1]) / 2,
        labels=(labels[0] + labels[1][list(PART_MIRROR)][:, :, ::-1]) / 2,
        heat=(heat[0] + heat[1][list(JOINT_MIRROR)][:, :, ::-1]) / 2,
        visible=(visible[0] + visible[1][list(JOINT_MIRROR)]) / 2,
        low=low,
        edge=edge,
    )


def square(rgb: ByteArray, low: NDArray[np.floating], edge: float, size: int) -> ByteArray:
    """(size, size, 3) crop and resample a square of the picture; the median colour of its rim beyond the picture."""
    from PIL import Image

    height, width = rgb.shape[:2]
    rim = np.concatenate([rgb[0], rgb[-1], rgb[:, 0], rgb[:, -1]])
    left, top = int(np.floor(low[0])), int(np.floor(low[1]))
    right, bottom = int(np.ceil(low[0] + edge)), int(np.ceil(low[1] + edge))
    canvas = np.empty((bottom - top, right - left, 3), np.uint8)
    canvas[:] = np.median(rim, axis=0)
    y0, y1, x0, x1 = max(top, 0), min(bottom, height), max(left, 0), min(right, width)
    if y0 < y1 and x0 < x1:
        canvas[y0 - top : y1 - top, x0 - left : x1 - left] = rgb[y0:y1, x0:x1]
    box = (low[0] - left, low[1] - top, low[0] - left + edge, low[1] - top + edge)
    return np.asarray(
        Image.fromarray(canvas).resize(
            (size, size), Image.Resampling.BOX if edge > 2 * size else Image.Resampling.BILINEAR, box=box
        )
    )


def spread(values: FloatArray, prediction: Prediction, shape: tuple[int, int]) -> FloatArray:
    """(H, W) values of a prediction's cells (n, n), interpolated at the picture's pixels; 0 outside the square."""
    size = values.shape[-1]
    grid = [
        ((np.arange(length) + 0.5 - low) / prediction.edge * size) - 0.5
        for length, low in zip(shape, prediction.low[::-1], strict=True)
    ]
    rows, columns = np.meshgrid(*grid, indexing="ij")
    out = ndimage.map_coordinates(values, [rows, columns], order=1, mode="constant", cval=0.0)
    # The rim's half cells count as their cell.
    edge = ((rows > -1) & (rows < size) & (columns > -1) & (columns < size)) & ~(
        (rows >= 0) & (rows <= size - 1) & (columns >= 0) & (columns <= size - 1)
    )
    if edge.any():
        near = ndimage.map_coordinates(values, [rows[edge], columns[edge]], order=1, mode="nearest")
        out[edge] = near
    return np.asarray(out, np.float32)


def part_labels(prediction: Prediction, mask: BoolArray) -> ByteArray:
    """(H, W) uint8, the likeliest part of each pixel of the mask."""
    height, width = mask.shape
    step = max(1, round(prediction.edge / MAX_LABEL_CELLS))
    shape = (-(-height // step), -(-width // step))
    coarse = prediction._replace(low=prediction.low / step, edge=prediction.edge / step)
    best, label = np.full(shape, -1.0, np.float32), np.zeros(shape, np.uint8)
    for part in range(1, len(PART_NAMES)):
        if prediction.labels[part].max() < 0.1:
            continue
        likely = spread(prediction.labels[part], coarse, shape)
        better = likely > best
        best[better], label[better] = likely[better], part
    out = label[np.arange(height)[:, None] // step, np.arange(width) // step]
    return np.where(mask, out, 0).astype(np.uint8)


def box_of(prediction: Prediction, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    """(4,) bounding box x0, y0, x1, y1 of the figure in the picture: its largest piece, what is near, its joints."""
    guess = prediction.likely > 0.5
    regions, count = ndimage.label(ndimage.binary_dilation(guess, iterations=2))
    if not count:
        return None
    index = np.arange(1, count + 1)
    mass = ndimage.sum_labels(prediction.likely, regions, index)
    kept = np.isin(regions, index[mass > 0.15 * mass.max()]) & guess
    rows, columns = np.nonzero(kept)
    size = guess.shape[0]
    low = np.array([columns.min(), rows.min()]) / size
    high = np.array([columns.max() + 1, rows.max() + 1]) / size
    places, sure = decode(prediction.heat, float((high - low).max()))
    good = places[sure > 0.4]
    if len(good):
        low, high = np.minimum(low, good.min(axis=0) - 0.02), np.maximum(high, good.max(axis=0) + 0.02)
    bounds = np.array([*(prediction.low + low * prediction.edge), *(prediction.low + high * prediction.edge)])
    limits = np.array([shape[1], shape[0]] * 2, float)
    return np.asarray(np.clip(bounds, 0, limits))
