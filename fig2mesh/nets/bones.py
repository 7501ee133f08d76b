"""What a point looks like from the bones of its part: the inputs of the "bone" networks (our own, beyond appendix A).

A point on a limb is far easier to judge by "how far along, how far off, on which side" than by x, y, z of a cube in
which the limb may lie anyhow. Fingers lie beyond the hand's anchor: nothing is clipped at the ends of a bone.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

SHORTEST: Final = 0.05
"""Bones count as at least this long, PART units, so that coincident joints leave every feature finite."""

OCTAVES: Final = 2


class Frames(NamedTuple):
    """K bones of B parts: start (B, K, 3), axis (B, K, 3) unit, across (B, K, 2, 3) unit, length (B, K); PART."""

    start: Tensor
    axis: Tensor
    across: Tensor
    length: Tensor


def bone_count(kind: str) -> int:
    """Spine, shoulder line and hip line for the torso; one bone for every other part."""
    return 3 if kind == "torso" else 1


def feature_count(kind: str) -> int:
    """Channels of `point_features`."""
    return 3 + 6 * OCTAVES + 5 * bone_count(kind) + 1


def bone_frames(kind: str, anchors: Tensor) -> Frames:
    """Frames of a part's bones; anchors : (B, A, 3) PART, in the order of `ANCHORS[kind]`.

    A limb's cross directions come from the smallest rotation of straight down (head: up) onto the bone, the same for
    all four views; the torso's lines take each other as their second direction.
    """
    if kind == "torso":
        shoulder, hip = anchors[:, :2].mean(1), anchors[:, 2:].mean(1)
        start = torch.stack([hip, anchors[:, 1], anchors[:, 3]], 1)
        end = torch.stack([shoulder, anchors[:, 0], anchors[:, 2]], 1)
        canonical = anchors.new_tensor([[0, 1, 0], [1, 0, 0], [1, 0, 0]])
    else:
        start, end = anchors[:, :1], anchors[:, 1:2]
        canonical = anchors.new_tensor([[0, 1.0 if kind == "head" else -1.0, 0]])
    offset = end - start
    length = offset.norm(dim=-1)
    canonical = canonical.expand_as(offset)
    axis = torch.where(length[..., None] > 1e-6, offset / length.clamp_min(1e-6)[..., None], canonical)
    first = _swung(canonical, axis)
    if kind == "torso":
        second = torch.stack([axis[:, 1], axis[:, 0], axis[:, 0]], 1)
        second = second - (second * axis).sum(-1, keepdim=True) * axis
        size = second.norm(dim=-1, keepdim=True)
        first = torch.where(size > 1e-3, second / size.clamp_min(1e-3), first)
    across = torch.stack([first, torch.linalg.cross(axis, first)], 2)
    return Frames(start, axis, across, length.clamp_min(SHORTEST))


def _swung(canonical: Tensor, axis: Tensor) -> Tensor:
    """(B, K, 3) the z axis, turned with the smallest rotation of `canonical` onto `axis`, and square to `axis`."""
    side = canonical.new_tensor([0.0, 0.0, 1.0]).expand_as(canonical)
    turn = torch.linalg.cross(canonical, axis)
    # Opposite directions have no smallest rotation; the bound only keeps the formula finite there.
    share = 1 / (1 + (canonical * axis).sum(-1, keepdim=True)).clamp_min(1e-4)
    once = torch.linalg.cross(turn, side)
    swung = side + once + share * torch.linalg.cross(turn, once)
    swung = swung - (swung * axis).sum(-1, keepdim=True) * axis
    unit: Tensor = swung / swung.norm(dim=-1, keepdim=True).clamp_min(1e-6)
    return unit


def point_features(frames: Frames, points: Tensor, signed_mask: Tensor) -> tuple[Tensor, Tensor]:
    """(B, N, F) features of points, and (B, N) their distance to the first bone's segment, PART units.

    points : (B, N, 3) PART; signed_mask : (B, N) distance to the mask's outline in the picture plane, PART units
    Channels: x y z, sines and cosines, then for each bone: along it in bone lengths, two across, radius, distance to
    the segment; last the mask's distance.
    """
    waves = [turn(np.pi * 2.0**octave * points) for octave in range(OCTAVES) for turn in (torch.sin, torch.cos)]
    columns = [points, *waves]
    nearest = points[..., 0]
    for bone in range(frames.start.shape[1]):
        offset = points - frames.start[:, None, bone]
        basis = torch.cat([frames.axis[:, bone, None], frames.across[:, bone]], 1)
        local = offset @ basis.transpose(1, 2)
        along, across = local[..., :1], local[..., 1:]
        length = frames.length[:, bone, None, None]
        radius = across.norm(dim=-1, keepdim=True)
        over = along - along.clamp_min(0).minimum(length)
        segment = torch.cat([radius, over], -1).norm(dim=-1, keepdim=True)
        columns += [(along / length).clamp(-4, 4), across, radius, segment]
        if bone == 0:
            nearest = segment[..., 0]
    return torch.cat([*columns, signed_mask[..., None]], -1), nearest


def mask_distance(masks: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(B, n, n) signed distance of pixel centres to the outline of each mask, PART units, negative inside.

    Exact Euclidean transform (Felzenszwalb & Huttenlocher's two passes, the second by brute force in
    small integers), so that a machine for training needs no SciPy. An empty mask is +1 all over, a full one -1.
    """
    masks = np.asarray(masks, np.bool_)
    size = masks.shape[-1]
    inside, outside = (np.sqrt(_squared(shown), dtype=np.float32) for shown in (masks, ~masks))
    signed = np.where(masks, 0.5 - outside, inside - 0.5) * (2.0 / size)
    filled = masks.any(axis=(1, 2), keepdims=True)
    signed = np.where(filled, np.where(masks.all(axis=(1, 2), keepdims=True), -1.0, signed), 1.0)
    return np.clip(signed, -1, 1).astype(np.float32)


def _squared(masks: NDArray[np.bool_]) -> NDArray[np.int16]:
    """(B, n, n) squared distance to the nearest set pixel, px²; large where there is none."""
    size = masks.shape[-1]
    far = np.int16(2 * size)
    rows = np.where(masks.transpose(1, 0, 2), np.int16(0), far)  # the axis walked along comes first: long inner loops
    for row in range(1, size):
        np.minimum(rows[row], rows[row - 1] + np.int16(1), out=rows[row])
    for row in range(size - 2, -1, -1):
        np.minimum(rows[row], rows[row + 1] + np.int16(1), out=rows[row])
    square = np.ascontiguousarray(np.minimum(rows, far).transpose(2, 1, 0)) ** 2
    result = square.copy()
    for shift in range(1, size):
        moved = square + np.int16(shift * shift)
        np.minimum(result[shift:], moved[:-shift], out=result[shift:])
        np.minimum(result[:-shift], moved[shift:], out=result[:-shift])
    return result.transpose(1, 2, 0)
