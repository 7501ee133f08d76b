"""Bands that go round: runs of one material on both sides of a limb or the trunk, joined to belts, hems and stripes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.texture.rim import LayerRim

MAX_BAND: Final = 0.16
"""Largest width of a band, FIGURE units."""

MAX_CHORD: Final = 0.9
"""Largest length of a band, FIGURE units."""

MAX_SLANT: Final = 0.55
"""Largest cosine between a band and the bone."""

STEEP: Final = 0.05
"""Width from which bands may be as slanted, FIGURE units; narrow stripes may be less so."""

MIN_FACING: Final = 0.35
"""Least cosine between the rim's inward normal and the band."""

MAX_RATIO: Final = 4.0
"""Largest ratio of the widths of a band at its ends."""

INSIDE: Final = 0.97
"""Least share of a band's middle line within the region."""

UNEQUAL: Final = 0.3
"""Cost of a difference of widths relative to one of heights."""


MAX_HEIGHT: Final = 0.45
"""Largest height of a drawn band along the bone relative to its length."""

NEAR_RIM: Final = 0.03
"""Largest distance of a drawn band's ends from the rim, FIGURE units: lines, an edge turned away, a thing in front."""

MAX_FACE: Final = 0.1
"""Largest share of a drawn band in the middle of a face."""

MIN_LENGTH: Final = 0.06
"""Least length of a drawn band, FIGURE units."""


@dataclass(frozen=True)
class RimRun:
    """Consecutive points of a contour with one material.

    members : indices of points of the rim, in order
    material : index; -1 for unknown
    """

    members: NDArray[np.int_]
    material: int


def find_runs(rim: LayerRim, material: NDArray[np.int_]) -> list[RimRun]:
    """Runs along the closed contours of a rim."""
    result = []
    for number in np.unique(rim.contour):
        members = np.flatnonzero(rim.contour == number)
        own = material[members]
        starts = np.flatnonzero(own != np.roll(own, 1))
        if not len(starts):
            result.append(RimRun(members, int(own[0])))
            continue
        turned, turned_own = np.roll(members, -starts[0]), np.roll(own, -starts[0])
        for piece in np.split(np.arange(len(members)), np.flatnonzero(np.diff(turned_own)) + 1):
            result.append(RimRun(turned[piece], int(turned_own[piece[0]])))
    return result


def match_runs(
    rim: LayerRim, runs: list[RimRun], region: NDArray[np.bool_], axis: NDArray[np.float64], pitch: float
) -> list[tuple[int, int]]:
    """Pairs of runs that are the two ends of one band; no two bands cross.

    axis : (H, W, 2) direction of the bones; pitch : FIGURE units per pixel
    """
    candidates = []
    short = [i for i, run in enumerate(runs) if run.material >= 0 and len(run.members) * pitch <= MAX_BAND]
    middle = {i: rim.points[runs[i].members].mean(axis=0) for i in short}
    inward = {i: _unit(rim.inwards[runs[i].members].mean(axis=0)) for i in short}
    for at, i in enumerate(short):
        for j in short[at + 1 :]:
            wide = len(runs[i].members), len(runs[j].members)
            if runs[i].material != runs[j].material or max(wide) > MAX_RATIO * min(wide):
                continue
            chord = middle[j] - middle[i]
            length = float(np.linalg.norm(chord))
            if not 0 < length * pitch < MAX_CHORD:
                continue
            along = chord / length
            if inward[i] @ along < MIN_FACING or inward[j] @ along > -MIN_FACING:
                continue
            line = middle[i] + np.linspace(0.05, 0.95, 25)[:, None] * chord
            places = tuple(np.clip(np.round(line).astype(int), 0, np.array(region.shape) - 1).T)
            bone = axis[places]
            slant = float(np.abs(bone @ along).mean())
            limit = MAX_SLANT * min(1.0, max(wide) * pitch / STEEP + 0.3)
            if region[places].mean() < INSIDE or slant > limit:
                continue
            candidates.append((slant * length + UNEQUAL * abs(wide[0] - wide[1]), i, j))
    pairs: list[tuple[int, int]] = []
    taken: set[int] = set()
    for _, i, j in sorted(candidates):
        if i in taken or j in taken:
            continue
        if any(_cross(middle[i], middle[j], middle[a], middle[b]) for a, b in pairs):
            continue
        pairs.append((i, j))
        taken |= {i, j}
    return pairs


def draw_bands(
    rim: LayerRim, runs: list[RimRun], pairs: list[tuple[int, int]], region: NDArray[np.bool_]
) -> NDArray[np.int_]:
    """(H, W) material of the bands between paired runs, -1 elsewhere."""
    from skimage.draw import polygon

    result = np.full(region.shape, -1)
    for i, j in pairs:
        first, second = rim.points[runs[i].members], rim.points[runs[j].members]
        corners = np.stack([first[0], first[-1], second[0], second[-1]])
        if np.linalg.norm(first[-1] - second[0]) + np.linalg.norm(second[-1] - first[0]) > np.linalg.norm(
            first[-1] - second[-1]
        ) + np.linalg.norm(second[0] - first[0]):
            corners = corners[[0, 1, 3, 2]]
        rows, columns = polygon(corners[:, 0], corners[:, 1], region.shape)
        result[rows, columns] = runs[i].material
    return np.where(ndimage.binary_dilation(result >= 0) & region, _spread(result), -1)


def drawn_bands(
    front: NDArray[np.int_],
    region: NDArray[np.bool_],
    not_in: NDArray[np.bool_],
    axis: NDArray[np.float64],
    pitch: float,
) -> NDArray[np.int_]:
    """(H, W) material of areas of the near side that run from rim to rim across the bone, -1 elsewhere.

    They go round as they are drawn, also where something at their ends hides them from the rim.

    not_in : (H, W) bool, where no band is: the face
    """
    result = np.full(region.shape, -1)
    depth = ndimage.distance_transform_edt(np.pad(region, 1))[1:-1, 1:-1] * pitch
    for k in np.unique(front[region]):
        areas, _ = ndimage.label(region & (front == k))
        for number, box in enumerate(ndimage.find_objects(areas), start=1):
            rows, columns = np.nonzero(areas[box] == number)
            rows, columns = rows + box[0].start, columns + box[1].start
            if not_in[rows, columns].mean() > MAX_FACE:
                continue
            bone = axis[rows, columns].mean(axis=0)
            if len(rows) * pitch**2 < MIN_LENGTH**2 / 8 or np.linalg.norm(bone) < 0.5:
                continue
            bone = _unit(bone)
            along = rows * bone[0] + columns * bone[1]
            across = rows * bone[1] - columns * bone[0]
            length = float(np.ptp(across)) * pitch
            if length < MIN_LENGTH:
                continue
            # Its width where it is, not from its highest to its lowest point: belts sag and hats are seen from below.
            bins = np.bincount((across - across.min()).astype(int), minlength=1)
            height = float(np.median(bins[bins > 0])) * pitch
            if height > MAX_HEIGHT * length or height > MAX_BAND or np.ptp(along) * pitch > length:
                continue
            ends = across <= across.min() + 1.5, across >= across.max() - 1.5
            if all(depth[rows[end], columns[end]].min() <= NEAR_RIM for end in ends):
                result[rows, columns] = k
    return result


def _spread(image: NDArray[np.int_]) -> NDArray[np.int_]:
    """Give pixels beside a band its material."""
    if not (image >= 0).any():
        return image
    _, source = ndimage.distance_transform_edt(image < 0, return_indices=True)
    return np.asarray(image[tuple(source)])


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-9))


def _cross(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]) -> bool:
    """Whether the segments a-b and c-d cross."""

    def side(p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64]) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    return side(a, b, c) * side(a, b, d) < 0 and side(c, d, a) * side(c, d, b) < 0
