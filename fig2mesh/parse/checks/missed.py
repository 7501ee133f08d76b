"""Drawn things that an inferred silhouette does not have: the shaft of a fork, a string, the prongs of a rake."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy import ndimage

from fig2mesh.parse.colours import reduced
from fig2mesh.parse.silhouette import PLAIN_SHARE, WORKING_PX, drawn_lines, plain_background
from fig2mesh.records import BoolArray, ByteArray

RIM_SHARE: Final = 0.006
"""Width of the rim by which outlines may differ, share of the figure's extent."""

MIN_MISSED: Final = 0.08
"""Extent of a drawn thing that is missed, share of the figure's."""

MIN_DETACHED: Final = 0.02
"""The same of a piece of the silhouette that is detached."""

MAX_AWAY: Final = 0.1
"""Distance from the silhouette's box within which a thing counts as the figure's, share of its extent."""

GROUND: Final = 0.05
"""Height above the feet, share of the figure's extent, below which lines are shadows or the ground."""

MAX_NAMED: Final = 3


class Box(NamedTuple):
    """Box in a picture, px: corner x, y; width, height."""

    x: int
    y: int
    width: int
    height: int

    def __str__(self) -> str:
        return f"{self.width}×{self.height} px at ({self.x}, {self.y})"


def extent_of(mask: BoolArray) -> int:
    """Width or height of a mask, the larger one, px."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(max(np.ptp(rows), np.ptp(columns))) + 1 if len(rows) else 0


def boxes(mask: BoolArray, least: float) -> list[Box]:
    """Boxes of the connected pieces of a mask whose larger side is at least so many pixels, the largest first."""
    regions, _ = ndimage.label(mask, np.ones((3, 3)))
    found = [
        Box(columns.start, rows.start, columns.stop - columns.start, rows.stop - rows.start)
        for rows, columns in ndimage.find_objects(regions)
    ]
    large = [box for box in found if max(box.width, box.height) >= least]
    return sorted(large, key=lambda box: (-max(box.width, box.height), box))


def in_picture(found: Sequence[Box], corner: tuple[float, float], step: float) -> list[Box]:
    """Boxes in pixels of the picture; corner : (x, y) there of the part they are in; step : its pixels per pixel"""
    return [
        Box(*(round(corner[axis] + step * box[axis]) for axis in (0, 1)), *(max(round(step * v), 1) for v in box[2:]))
        for box in found
    ]


def named(found: Sequence[Box], end: str) -> tuple[str, ...]:
    """Doubt about some boxes; end : what is the matter with them"""
    if not found:
        return ()
    more = f" and {len(found) - MAX_NAMED} more" if len(found) > MAX_NAMED else ""
    return (f"{', '.join(map(str, found[:MAX_NAMED]))}{more} of the drawing: {end}",)


def detached_pieces(mask: BoolArray, corner: tuple[int, int]) -> tuple[str, ...]:
    """Doubt about pieces of an inferred silhouette that float beside the figure: what joins them may be missed."""
    found = boxes(mask, MIN_DETACHED * extent_of(mask))
    if len(found) < 2:
        return ()
    return named(in_picture(found[1:], corner, 1), "detached from the figure in the inferred silhouette")


def missed_things(rgb: ByteArray, mask: BoolArray, corner: tuple[int, int]) -> tuple[str, ...]:
    """Doubt about things drawn beside an inferred silhouette, on a plain background.

    rgb : (H, W, 3); mask : (H, W); corner : (x, y) of the window in the picture

    Lines that leave the picture are not the figure's, nor are shadows and the ground under its feet.
    """
    height, width = mask.shape
    step = max(1, -(-max(height, width) // WORKING_PX))
    small = reduced(rgb.astype(np.float32), step)
    inside = reduced(mask[..., None].astype(np.float32), step)[..., 0]
    background = plain_background(small, inside)
    if background is None or background.share < PLAIN_SHARE:
        return ()
    figure = inside > 0.5
    rows, columns = np.flatnonzero(figure.any(axis=1)), np.flatnonzero(figure.any(axis=0))
    extent = extent_of(figure)
    if not extent:
        return ()
    around = ndimage.binary_dilation(figure, np.ones((3, 3)), iterations=max(3, round(RIM_SHARE * extent)))
    room, ground = MAX_AWAY * extent, rows[-1] - GROUND * extent

    def is_near(box: Box) -> bool:
        across = columns[0] - room - box.width < box.x < columns[-1] + room
        return bool(across and rows[0] - room - box.height < box.y < ground)

    def leaves(box: Box) -> bool:
        right, bottom = box.x + box.width, box.y + box.height
        return min(box.x, box.y) <= 1 or right >= figure.shape[1] - 1 or bottom >= figure.shape[0] - 1

    drawn = boxes(drawn_lines(background) & ~around, MIN_MISSED * extent)
    found = [box for box in drawn if is_near(box) and not leaves(box)]
    whole = in_picture(in_picture(found, (0, 0), step), corner, 1)
    return named(whole, "beside the figure, not in the inferred silhouette; if it is the figure's, pass --mask")
