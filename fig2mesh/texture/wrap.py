"""Colours of a layer's far side and of what is hidden of its near side, continued along the surface.

A layer is inflated from its outline: its far side is a second sheet over the same pixels, joined to the drawn one along
the rim. So colours of the far side are those of the rim, inside of the drawn line, diffused over the sheet across the
bones: what the rim shows goes round, and what only the middle of the front shows does not. What another layer hides of
the near side is filled from the shown pixels around it in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.texture.bands import RimRun, draw_bands, drawn_bands, find_runs, match_runs
from fig2mesh.texture.diffusion import diffused
from fig2mesh.texture.heads import BESIDE, FACE, FacePositions, HeadMaterials, covered_rim
from fig2mesh.texture.patterns import striped
from fig2mesh.texture.rim import NEAR, REACH, SMOOTH, STEP, LayerRim, count_votes, decided, find_rim, samples

ANISOTROPY: Final = 5.0
"""Ratio of distances along and across a bone at which colours have the same weight."""

MIN_RUN: Final = 0.03
"""Least length of a run of the rim that is not an end of a band, FIGURE units."""

AT_SIDE: Final = 0.04
"""Distance from the rim to which colours of one side go in any case, FIGURE units."""

EARRING: Final = 0.7
"""Largest length of a run of the rim beside a face that is no hair, face radii."""

MIN_AREA: Final = 0.025**2
"""Least area of one material, FIGURE units²."""

PATTERN_WINDOW: Final = 0.022
"""Distance over which an area's colour dominates its marks, FIGURE units."""

BLUR: Final = 0.006
"""Standard deviation of the smoothing of borders, FIGURE units."""

EXTRA_REACH: Final = 2.0
"""Search depth for the first pixel inside of a drawn line, widths of strokes."""

WINDOW: Final = 0.015
"""Standard deviation of the average that decides on the material of an area, FIGURE units."""


@dataclass(frozen=True)
class Sheet:
    """A layer on a raster.

    region : (H, W) bool, its outline, completed behind others
    shown : (H, W) bool, where the drawing shows it
    index : (H, W) material of the drawing's pixels; ink : (H, W) bool, strokes, which have none
    axis : (H, W, 2) direction of the bones
    number : of materials; pitch : FIGURE units per pixel; stroke : largest width of strokes, pixels
    head : (H, W) bool; face : positions about it, None where it has none; skin : what is known of its materials
    """

    region: NDArray[np.bool_]
    shown: NDArray[np.bool_]
    index: NDArray[np.int_]
    ink: NDArray[np.bool_]
    axis: NDArray[np.float64]
    number: int
    pitch: float
    stroke: float
    head: NDArray[np.bool_]
    face: FacePositions | None = None
    skin: HeadMaterials | None = None


@dataclass(frozen=True)
class RimColours:
    """Materials along a rim.

    rim : its points; material : (N,) of each, -1 for unknown; share : (N,) of the votes for it
    """

    rim: LayerRim
    material: NDArray[np.int_]
    share: NDArray[np.float64]


def one_hot(index: NDArray[np.int_], number: int) -> NDArray[np.float64]:
    """(H, W, number), zeros where the index is negative."""
    result = np.zeros((*index.shape, number))
    rows = np.nonzero(index >= 0)
    result[(*rows, index[rows])] = 1.0
    return result


def front_materials(sheet: Sheet) -> NDArray[np.float64]:
    """(H, W, K) share of each material of the near side: shown areas without details, hidden ones filled."""
    own = sheet.region & sheet.shown
    clear = own & ~sheet.ink
    if not clear.any():
        clear = own if own.any() else sheet.region
    votes = np.stack(
        [
            ndimage.gaussian_filter((clear & (sheet.index == k)).astype(np.float32), WINDOW / sheet.pitch)
            if (clear & (sheet.index == k)).any()
            else np.zeros(clear.shape, np.float32)
            for k in range(sheet.number)
        ],
        axis=-1,
    ).astype(np.float64)
    reliable = votes.sum(axis=-1) > 1e-3
    near = own & reliable if (own & reliable).any() else reliable
    _, source = ndimage.distance_transform_edt(~near, return_indices=True)
    area = one_hot(votes.argmax(axis=-1)[tuple(source)], sheet.number)
    return diffused(sheet.region, own, area, sheet.axis, ANISOTROPY)


def rim_colours(sheet: Sheet, front: NDArray[np.int_]) -> RimColours:
    """Materials along the rim, inside of the drawn line; of the filled near side where it is hidden.

    front : (H, W) material of the near side
    """
    rim = find_rim(sheet.region)
    reach = max(int(REACH / sheet.pitch / STEP), 2)
    at = samples(rim, REACH / sheet.pitch + EXTRA_REACH * sheet.stroke)
    place = tuple(np.clip(np.round(at).astype(int), 0, np.array(sheet.region.shape) - 1).transpose(2, 0, 1))
    depth = ndimage.distance_transform_edt(np.pad(sheet.region, 1))[1:-1, 1:-1][place]
    # Beyond the middle of a limb samples approach the other rim.
    ahead = np.maximum.accumulate(depth, axis=1) <= depth + 1.5
    valid = sheet.region[place] & sheet.shown[place] & ~sheet.ink[place] & ahead
    votes = count_votes(sheet.index[place], valid, sheet.number, reach)
    near_votes = count_votes(sheet.index[place], valid, sheet.number, max(int(NEAR / sheet.pitch / STEP), 2))
    seen = ndimage.binary_dilation(sheet.region & sheet.shown, iterations=2)[place][:, 0]
    hidden = one_hot(front[place][:, min(4, at.shape[1] - 1)][:, None], sheet.number)[:, 0]
    votes, near_votes = (np.where(seen[:, None], counted, hidden) for counted in (votes, near_votes))
    material, share = decided(rim, near_votes, votes, sheet.pitch)
    if sheet.face is not None and sheet.skin is not None:
        covered = covered_rim(
            material, rim.smoothed(votes, SMOOTH / sheet.pitch), sheet.face.above[place][:, 0], sheet.skin
        )
        material = np.where(sheet.head[place][:, 0], covered, material)
    return RimColours(rim, material, share)


def without_short_runs(colours: RimColours, paired: set[int], runs: list[RimRun], pitch: float) -> NDArray[np.int_]:
    """(N,) materials with short runs unknown that are not ends of bands."""
    result = colours.material.copy()
    for number, run in enumerate(runs):
        result[run.members] = run.material
        if number not in paired and len(run.members) * pitch < MIN_RUN:
            result[run.members] = -1
    return result


def back_materials(sheet: Sheet, colours: RimColours, front: NDArray[np.int_]) -> NDArray[np.float64]:
    """(H, W, K) share of each material of the far side.

    front : (H, W) material of the near side
    """
    runs = find_runs(colours.rim, colours.material)
    if sheet.face is not None and sheet.skin is not None:
        runs = [_without_earrings(sheet, colours.rim, run) for run in runs]
    pairs = match_runs(colours.rim, runs, sheet.region, sheet.axis, sheet.pitch)
    material = without_short_runs(colours, {i for pair in pairs for i in pair}, runs, sheet.pitch)
    fixed = _at_rim(sheet.region, colours.rim, material)
    bands = draw_bands(colours.rim, runs, pairs, sheet.region)
    drawn = drawn_bands(front, sheet.region, _middle_of_face(sheet), sheet.axis, sheet.pitch)
    if sheet.skin is not None:
        drawn[sheet.head & np.isin(drawn, sheet.skin.skin)] = -1
    fixed = np.where(bands >= 0, bands, np.where(drawn >= 0, drawn, fixed))
    own = sheet.region & sheet.shown & ~sheet.head
    fixed = np.where(striped(front, own, PATTERN_WINDOW / sheet.pitch), front, fixed)
    if not (fixed >= 0).any():
        return one_hot(front, sheet.number)
    share = diffused(sheet.region, fixed >= 0, one_hot(fixed, sheet.number), sheet.axis, ANISOTROPY)
    first = share.argmax(axis=-1)
    beyond = _beyond_extent(sheet, colours.rim, fixed, first, front)
    if beyond.any():
        kept = np.where(beyond, -1, np.where(fixed >= 0, fixed, first))
        share = diffused(sheet.region, sheet.region & (kept >= 0), one_hot(kept, sheet.number), sheet.axis, ANISOTROPY)
        share[beyond, first[beyond]] = 0.0
    return covered(sheet, share)


def covered(sheet: Sheet, share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares without skin on the back of a head that has hair."""
    if sheet.face is None or sheet.skin is None:
        return share
    behind = sheet.region & sheet.head & (sheet.face.above > sheet.skin.nape)
    result = share.copy()
    for k in sheet.skin.skin:
        result[behind, k] = 0.0
    empty = behind & (result.sum(axis=-1) < 1e-3)
    result[empty, sheet.skin.hair] = 1.0
    return result


def _without_earrings(sheet: Sheet, rim: LayerRim, run: RimRun) -> RimRun:
    """Give a short run beside a face, an earring or an ear, the colour of the hair."""
    assert sheet.face is not None
    assert sheet.skin is not None
    if run.material < 0 or len(run.members) * sheet.pitch > EARRING * sheet.face.radius:
        return run
    place = tuple(np.clip(np.round(rim.points[run.members]).astype(int), 0, np.array(sheet.region.shape) - 1).T)
    above = sheet.face.above[place]
    if sheet.head[place].mean() < 0.5 or above.max() > BESIDE[3] or above.min() < sheet.skin.nape:
        return run
    return RimRun(run.members, sheet.skin.hair)


def _middle_of_face(sheet: Sheet) -> NDArray[np.bool_]:
    if sheet.face is None:
        return np.zeros_like(sheet.region)
    aside, above = np.abs(sheet.face.aside), sheet.face.above
    return sheet.head & (aside < FACE[0]) & (above > FACE[1]) & (above < FACE[2])


def _at_rim(region: NDArray[np.bool_], rim: LayerRim, material: NDArray[np.int_]) -> NDArray[np.int_]:
    """(H, W) material of the pixels at the rim, -1 elsewhere and where it is unknown."""
    border = region & ~ndimage.binary_erosion(region, border_value=0)
    nearest = np.full(region.shape, -1)
    rows, columns = (
        np.clip(np.round(rim.points).astype(int), 0, np.array(region.shape) - 1).T if len(rim.points) else ([], [])
    )
    nearest[rows, columns] = np.arange(len(rim.points))
    _, source = ndimage.distance_transform_edt(nearest < 0, return_indices=True)
    return np.where(border, material[nearest[tuple(source)]], -1)


def _beyond_extent(
    sheet: Sheet, rim: LayerRim, fixed: NDArray[np.int_], back: NDArray[np.int_], front: NDArray[np.int_]
) -> NDArray[np.bool_]:
    """(H, W) bool: pixels of areas that reach the rim on one side only and extend further than they do in front."""
    place = tuple(np.clip(np.round(rim.points).astype(int), 0, np.array(back.shape) - 1).T)
    bone = sheet.axis[place]
    side = bone[:, 0] * rim.inwards[:, 1] - bone[:, 1] * rim.inwards[:, 0]
    result = np.zeros_like(sheet.region)
    depth = ndimage.distance_transform_edt(np.pad(sheet.region, 1))[1:-1, 1:-1]
    for k in np.unique(back[sheet.region]):
        pieces, count = ndimage.label(sheet.region & (back == k))
        at = pieces[place]
        left = np.bincount(at[side > 0.3], minlength=count + 1)
        right = np.bincount(at[side < -0.3], minlength=count + 1)
        lone = (np.minimum(left, right) < 0.1 * (left + right)) & (left + right > 0)
        lone[0] = False
        result |= lone[pieces] & (front != k) & (depth > AT_SIDE / sheet.pitch) & (fixed < 0)
    return result


def settled(share: NDArray[np.float64], region: NDArray[np.bool_], pitch: float) -> NDArray[np.float64]:
    """Shares with smooth borders, without areas too small to be drawn, and continued outside the region."""
    index = share.argmax(axis=-1)
    small = np.zeros_like(region)
    for k in np.unique(index[region]):
        pieces, count = ndimage.label(region & (index == k))
        size = np.bincount(pieces.ravel(), minlength=count + 1) * pitch**2
        size[0] = np.inf
        small |= size[pieces] < MIN_AREA
    kept = region & ~small if (region & ~small).any() else region
    _, source = ndimage.distance_transform_edt(~kept, return_indices=True)
    spread = share[tuple(source)]
    used = np.flatnonzero(spread.reshape(-1, spread.shape[-1]).max(axis=0) > 1e-6)
    result = np.zeros_like(spread)
    for k in used:
        result[..., k] = ndimage.gaussian_filter(spread[..., k], BLUR / pitch)
    return np.asarray(result)
