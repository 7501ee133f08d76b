"""Augmentation for the figure parser: crops turned, placed on backgrounds, coloured, aged and scanned at random."""

from __future__ import annotations

from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from fig2mesh.nets.figure_parser import INPUT
from fig2mesh.skeleton import JOINT_MIRROR, PART_MIRROR
from fig2mesh.training.drawing.background import draw_background
from fig2mesh.training.samples.crop_data import Crops

OTHER_SIDE: Final = np.array(PART_MIRROR, np.uint8)
"""`PART_MIRROR` as a lookup table for label pictures."""

MAPS: Final = ("coast", "realms", "fields", "town", "paper", "coast", "town", "paper")


class CropView(NamedTuple):
    """View of a crop.

    picture : (size, size, 3) uint8; labels : (size, size) uint8; joints : (21, 2) float32, shares of the picture
    visible, inside : (21,) bool
    """

    picture: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    joints: NDArray[np.float32]
    visible: NDArray[np.bool_]
    inside: NDArray[np.bool_]


class CropViewer:
    """Generator of views of crops.

    size : edge of a view, pixels; backgrounds : number of maps and papers that are drawn to choose from
    """

    def __init__(self, crops: Crops, seed: int = 0, backgrounds: int = 160, size: int = INPUT) -> None:
        self.crops, self.size = crops, size
        rng = np.random.default_rng([23, seed])
        self.backgrounds = np.stack(
            [
                np.clip(draw_background(MAPS[index % len(MAPS)], (256, 256), rng), 0, 255).astype(np.uint8)
                for index in range(backgrounds)
            ]
        )

    def view(self, index: int, rng: np.random.Generator) -> CropView:
        """Augment crop `index`."""
        crops = self.crops
        rgba, labels = crops.rgba[index], crops.labels[index]
        joints, visible = crops.joints[index].astype(np.float64), crops.visible[index]
        baked = bool((rgba[::16, ::16, 3] == 255).all())
        size = (self.size, self.size)
        matrix = _placement(labels, self.size, rng)
        if baked:
            reduced = float(np.abs(np.linalg.det(matrix[:, :2]))) < 0.3
            border = rgba[..., :3].reshape(-1, 3)[rng.integers(256)].tolist()
            picture = cv2.warpAffine(
                rgba[..., :3],
                matrix,
                size,
                flags=cv2.INTER_AREA if reduced else cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=border,
            ).astype(np.float32)
        else:
            picture = self._background(rng)
            if rng.random() < 0.22:
                picture = self._neighbour(picture, rng)
            picture = _composited(_decorated(picture, joints, matrix, rng), rgba, matrix, rng)
        labels = cv2.warpAffine(labels, matrix, size, flags=cv2.INTER_NEAREST)
        joints = (joints - 0.5) @ matrix[:, :2].T + matrix[:, 2] + 0.5
        if rng.random() < 0.5:
            picture, labels = picture[:, ::-1], OTHER_SIDE[labels[:, ::-1]]
            joints = joints[list(JOINT_MIRROR)] * [-1, 1] + [self.size, 0]
            visible = visible[list(JOINT_MIRROR)]
        share = (joints / self.size).astype(np.float32)
        inside = ((share > 0) & (share < 1)).all(axis=1)
        return CropView(
            simulate_scan(np.ascontiguousarray(picture, np.float32), rng),
            np.ascontiguousarray(labels),
            share,
            visible & inside,
            inside,
        )

    def _background(self, rng: np.random.Generator) -> NDArray[np.float32]:
        kind = rng.random()
        if kind < 0.36:
            return np.full((self.size, self.size, 3), 255 if rng.random() < 0.85 else rng.uniform(225, 255), np.float32)
        if kind < 0.52:
            colour = rng.uniform(120, 250, 3) if rng.random() < 0.7 else rng.uniform(0, 255, 3)
            out = np.ones((self.size, self.size, 1), np.float32) * colour.astype(np.float32)
            if rng.random() < 0.4:  # a gradient, as photographs of paper have
                y, x = np.mgrid[: self.size, : self.size].astype(np.float32) / self.size
                out = out * (1 + rng.normal(0, 0.12) * (x - 0.5) + rng.normal(0, 0.12) * (y - 0.5))[..., None]
            return np.clip(out, 0, 255)
        ground = self.backgrounds[int(rng.integers(len(self.backgrounds)))]
        zoom = rng.uniform(0.75, 2.2)
        matrix = cv2.getRotationMatrix2D((128, 128), float(rng.uniform(-180, 180)), zoom)
        matrix[:, 2] += self.size / 2 - 128 + rng.uniform(-40, 40, 2)
        moved = cv2.warpAffine(ground, matrix, (self.size, self.size), borderMode=cv2.BORDER_REFLECT)
        return np.asarray(moved, np.float32)

    def _neighbour(self, picture: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
        """Add another figure at the rim."""
        other = self.crops.rgba[int(rng.integers(len(self.crops)))]
        if (other[::16, ::16, 3] == 255).all():
            return picture
        scale = self.size / 256 * rng.uniform(0.5, 1.0)
        angle = rng.uniform(0, 2 * np.pi)
        where = (
            self.size / 2 + self.size * rng.uniform(0.62, 0.8) * np.array([np.cos(angle), np.sin(angle)]) - 128 * scale
        )
        return _composited(picture, other, np.array([[scale, 0, where[0]], [0, scale, where[1]]]), rng)


def _placement(labels: NDArray[np.uint8], size: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(2, 3) random affine map from a crop's pixels to the picture's; at times the figure is cut off."""
    rows, columns = np.flatnonzero((labels > 0).any(axis=1)), np.flatnonzero((labels > 0).any(axis=0))
    centre = np.array([columns[0] + columns[-1], rows[0] + rows[-1]]) / 2
    angle = float(np.radians(np.clip(rng.normal(0, 12), -35, 35))) if rng.random() < 0.6 else 0.0
    stretch = np.exp(rng.normal(0, 0.08)) if rng.random() < 0.5 else 1.0
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ np.diag([stretch, 1 / stretch])
    corners = np.array([[columns[0], rows[0]], [columns[-1], rows[0]], [columns[0], rows[-1]], [columns[-1], rows[-1]]])
    span = np.ptp((corners - centre) @ turn.T, axis=0).max()
    fill = rng.uniform(0.78, 0.96) if rng.random() < 0.6 else rng.uniform(0.4, 0.95)
    if rng.random() < 0.1:
        fill = rng.uniform(0.95, 1.25)
    scale = fill * size / span
    room = max(1 - fill, 0.04) * size / 2
    middle = size / 2 + rng.uniform(-room, room, 2)
    matrix = np.empty((2, 3))
    matrix[:, :2] = turn * scale
    matrix[:, 2] = middle - matrix[:, :2] @ centre
    return matrix


def _composited(
    picture: NDArray[np.float32], rgba: NDArray[np.uint8], matrix: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float32]:
    alpha = rgba[..., 3:].astype(np.float32) / 255
    layer = np.concatenate([rgba[..., :3] * alpha, alpha], axis=-1)
    scale = float(np.sqrt(abs(np.linalg.det(matrix[:, :2]))))
    if scale < 0.8:
        layer = cv2.GaussianBlur(layer, (0, 0), 0.3 / scale)
    moved = cv2.warpAffine(layer, matrix, picture.shape[1::-1], flags=cv2.INTER_LINEAR)
    if rng.random() < 0.06:  # printed in one ink
        moved[..., :3] = moved[..., :3].mean(axis=-1, keepdims=True) * rng.uniform(0.3, 1.0, 3)
    return np.asarray(picture * (1 - moved[..., 3:]) + moved[..., :3], np.float32)


def _decorated(
    picture: NDArray[np.float32], joints: NDArray[np.float64], matrix: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float32]:
    """Draw things that surround figures: shadows, ground lines, frames, bases."""
    size = picture.shape[0]
    feet = (joints[[17, 18, 19, 20]] @ matrix[:, :2].T + matrix[:, 2]).mean(axis=0)
    ink = rng.uniform(0, 200, 3).tolist()
    if rng.random() < 0.1:
        axes = (int(size * rng.uniform(0.1, 0.35)), int(size * rng.uniform(0.02, 0.06)))
        shade = np.zeros((size, size), np.float32)
        cv2.ellipse(shade, (int(feet[0]), int(feet[1])), axes, 0, 0, 360, 1.0, -1)
        if rng.random() < 0.6:
            shade = cv2.GaussianBlur(shade, (0, 0), 2)
        picture = picture * (1 - rng.uniform(0.15, 0.6) * shade[..., None])
    if rng.random() < 0.1:
        y = float(feet[1] + rng.normal(0, 4))
        picture = np.ascontiguousarray(picture)
        if rng.random() < 0.5:
            cv2.line(picture, (0, int(y)), (size, int(y + rng.normal(0, 8))), ink, int(rng.integers(1, 3)))
        else:
            below = picture[max(int(y), 0) :]
            below[:] = below * 0.5 + 0.5 * rng.uniform(60, 250, 3).astype(np.float32)
    if rng.random() < 0.08:
        picture = np.ascontiguousarray(picture)
        inset = int(rng.integers(1, 14))
        cv2.rectangle(picture, (inset, inset), (size - inset, size - inset), ink, int(rng.integers(1, 4)))
    if rng.random() < 0.05:
        picture = np.ascontiguousarray(picture)
        half, high = size * rng.uniform(0.08, 0.25), size * rng.uniform(0.02, 0.12)
        low = (int(feet[0] - half), int(feet[1] + 2)), (int(feet[0] + half), int(feet[1] + high))
        cv2.rectangle(picture, *low, rng.uniform(100, 255, 3).tolist(), -1)
        cv2.rectangle(picture, *low, ink, 1)
    return picture


def simulate_scan(picture: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Degrade a picture as by printing, fading, photography, scanning and compression."""
    size = picture.shape[0]
    if rng.random() < 0.5:
        gain, lift = rng.uniform(0.7, 1.25), rng.normal(0, 12)
        picture = np.clip((picture - 128) * gain + 128 + lift, 0, 255)
    if rng.random() < 0.25:
        picture = (255 * (np.clip(picture, 0, 255) / 255) ** rng.uniform(0.6, 1.7)).astype(np.float32)
    if rng.random() < 0.3:
        picture = picture * rng.uniform(0.8, 1.08, 3).astype(np.float32)
    if rng.random() < 0.18:
        grey = picture.mean(axis=-1, keepdims=True)
        picture = np.repeat(grey, 3, axis=-1)
        if rng.random() < 0.5:  # brown prints
            picture = picture * np.array([1.0, rng.uniform(0.85, 0.95), rng.uniform(0.65, 0.85)], np.float32)
    elif rng.random() < 0.15:
        picture = picture[..., rng.permutation(3)]
    if rng.random() < 0.02:
        picture = 255 - np.clip(picture, 0, 255)
    if rng.random() < 0.22:
        small = int(size * rng.uniform(0.3, 0.8))
        packed = cv2.resize(picture, (small, small), interpolation=cv2.INTER_AREA)
        picture = cv2.resize(packed, (size, size), interpolation=cv2.INTER_LINEAR if rng.random() < 0.7 else 0)
    elif rng.random() < 0.2:
        picture = cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.4, 1.3))
    if rng.random() < 0.25:
        grain = rng.normal(0, rng.uniform(2, 14), (size, size, 1)).astype(np.float32)
        picture = picture + (cv2.GaussianBlur(grain, (0, 0), 0.7)[..., None] * 1.5 if rng.random() < 0.5 else grain)
    out = np.clip(picture, 0, 255).astype(np.uint8)
    if rng.random() < 0.25:
        packed = cv2.imencode(".jpg", out, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(15, 85))])[1]
        out = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), np.uint8)
    return out
