"""Checks that a silhouette and part labels are those of the picture.

The outline of a silhouette follows edges of its picture. Where the outline of a mirrored, turned or shifted one does so
and the given one's does not, the change names what is wrong.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy import ndimage

from fig2mesh.parse.checks.consistency import EXPLAINED_INSIDE, MIN_INSIDE, WORKING_PX, Mismatch, PictureFrame
from fig2mesh.parse.picture import on_white
from fig2mesh.records import BoolArray, ByteArray, FloatArray
from fig2mesh.skeleton import BODY_PARTS, JOINT, LIMB_BONES, PART, PART_MIRROR, SIDES

MAX_COVER: Final = 0.97
"""Share of the picture that no silhouette of a person covers."""

MAX_RIM: Final = 0.6
"""Share of the picture's rim, with all four corners, that only an inverted silhouette covers."""

SAME_COLOUR: Final = 24.0
"""Difference of levels up to which two pixels count as one colour."""

MIN_GROUND_RIM: Final = 0.8
MAX_GROUND: Final = 0.95
"""Share of the rim, and of the whole picture, that a ground of one colour has at least and at most."""

EDGE_LEVELS: Final = 6.0
"""Steepness of a picture's edge, levels of 255 per pixel."""

ON_EDGES: Final = 0.85
MIN_GAIN: Final = 0.15
MIN_ON_EDGES: Final = 0.5
"""Share of the outline on edges: of a changed silhouette that explains the given one, what it has to be more than that
of the given one, and what that has below which it is refused. Those of the figures measured have 1.00."""


def silhouette_finding(rgba: ByteArray, mask: BoolArray, frame: PictureFrame) -> Mismatch | None:
    """Mismatch of a silhouette that is inverted, or covers all or hardly any of the picture.

    rgba : (H, W, 4); mask : (H, W)
    """
    cover = float(mask.mean())
    rim = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    corners = mask[[0, 0, -1, -1], [0, -1, 0, -1]].all()
    remedy = "give a silhouette of the figure, bright on dark, or leave it out to have it inferred"
    if cover >= MAX_COVER:
        return Mismatch(f"the silhouette covers {cover:.1%} of the picture", remedy, _has_ground(rgba))
    if corners and float(rim.mean()) > MAX_RIM:
        text = f"the silhouette covers all corners and {rim.mean():.0%} of the picture's rim"
        return Mismatch(text, f"inverted? {remedy}", True)
    if mask.sum() < 100 or (cover < 2e-4 and frame.window == frame.size):
        return Mismatch(f"the silhouette has {int(mask.sum())} px of {mask.size}", remedy, False)
    return None


def _has_ground(rgba: ByteArray) -> bool:
    """Whether the picture's rim is of one colour and other colours are within it, so that it is not all figure."""
    step = max(1, -(-max(rgba.shape[:2]) // WORKING_PX))
    small = on_white(rgba[::step, ::step]).astype(np.float32)
    rim = np.concatenate([small[0], small[-1], small[:, 0], small[:, -1]])
    near = (np.abs(small - np.median(rim, axis=0)).max(axis=2)) < SAME_COLOUR
    on_rim = np.concatenate([near[0], near[-1], near[:, 0], near[:, -1]])
    return bool(on_rim.mean() > MIN_GROUND_RIM and near.mean() < MAX_GROUND)


def edge_finding(rgba: ByteArray, mask: BoolArray) -> Mismatch | None:
    """Mismatch of a silhouette whose outline is beside the picture's edges, while a changed one's is on them.

    rgba : (H, W, 4); mask : (H, W)
    """
    step = max(1, -(-max(mask.shape) // WORKING_PX))
    # Only what is compared is copied: a sheet has hundreds of megapixels.
    small, inner = on_white(rgba[::step, ::step]).astype(np.float32), mask[::step, ::step]
    smooth = ndimage.gaussian_filter(small, (1, 1, 0))
    steep = np.hypot(ndimage.sobel(smooth, 0), ndimage.sobel(smooth, 1)).max(axis=2) / 8
    edges = ndimage.maximum_filter(steep, 5) > EDGE_LEVELS
    outline = inner & ~ndimage.binary_erosion(inner, border_value=1)
    if outline.sum() < 40 or edges.mean() > 0.6:
        return None
    found = float(edges[outline].mean())
    best, remedy = 0.0, ""
    for turned, name in (
        (outline[:, ::-1], "of the mirrored picture? mirror it"),
        (outline[::-1], "upside down? turn it over"),
        (outline[::-1, ::-1], "of the picture turned by 180°? turn it too"),
    ):
        if (share := float(edges[turned].mean())) > best:
            best, remedy = share, name
    share, (dx, dy) = _best_shift(edges, outline)
    if share > best + 0.02 and max(abs(dx), abs(dy)) > 0.02 * max(inner.shape):
        best, remedy = share, f"shifted? move it by about {dx * step} px in x and {dy * step} px in y"
    if best < ON_EDGES or best < found + MIN_GAIN:
        return None
    text = f"{found:.0%} of the silhouette's outline follows edges of the picture"
    return Mismatch(text, f"{remedy}, or pass the silhouette of this picture", found < MIN_ON_EDGES)


def _best_shift(edges: BoolArray, outline: BoolArray) -> tuple[float, tuple[int, int]]:
    """Share of the outline on edges after the best shift, and that shift (x, y), by correlation."""
    shape = [2 * length for length in edges.shape]
    product = np.fft.rfft2(edges, shape) * np.conj(np.fft.rfft2(outline, shape))
    found = np.fft.irfft2(product, shape)
    # Edges are wider than the outline, so that several shifts near the right one are as good.
    best = np.argwhere(found > found.max() - 0.5)
    offsets = (best + np.array(shape) // 2) % np.array(shape) - np.array(shape) // 2
    dy, dx = np.rint(np.median(offsets, axis=0)).astype(int).tolist()
    return float(found.max() / outline.sum()), (dx, dy)


def label_finding(labels: ByteArray, mask: BoolArray, points: FloatArray | None) -> Mismatch | None:
    """Mismatch of part labels that are of another figure.

    labels : (H, W), 0 where none is given; points : (21, 2) joints, px of the window, None where they are not given
    """
    labelled = labels > 0
    if not labelled.any():
        return None
    inside = float((labelled & mask).sum()) / float(labelled.sum())
    remedy = "pass the part labels of this figure"
    if inside < EXPLAINED_INSIDE:
        mirrored = float((labelled[:, ::-1] & mask).sum()) / float(labelled.sum())
        guess = "of the mirrored picture? mirror them, or " if mirrored > max(0.9, inside + 0.15) else ""
        return Mismatch(f"{inside:.0%} of the part labels lie in the silhouette", guess + remedy, inside < MIN_INSIDE)
    if points is None:
        return None
    same, other, count = _along_bones(labels, points)
    if other >= 3 and other > 2 * same:
        text = f"{other} of {count} part labels along the bones are those of the other side"
        return Mismatch(text, "mirrored? exchange left and right of the labels or of the joints", False)
    if count >= 6 and same < 0.3 * count:
        return Mismatch(f"{same} of {count} part labels along the bones are those of the joints", remedy, False)
    return None


def _along_bones(labels: ByteArray, points: FloatArray) -> tuple[int, int, int]:
    """Bones of limbs whose middle has their own label, that of the other side, and any label of a body part."""
    same = other = count = 0
    for side in SIDES:
        for part, (start, end) in LIMB_BONES.items():
            label = PART[f"{side}_{part}"]
            middle = (points[JOINT[f"{side}_{start}"]] + points[JOINT[f"{side}_{end}"]]) / 2
            x, y = np.clip(middle.astype(int), 0, np.array(labels.shape[::-1]) - 1)
            found = int(labels[y, x])
            if found in BODY_PARTS[2:]:
                count += 1
                same += found == label
                other += found == PART_MIRROR[label]
    return same, other, count
