"""Ink of a drawing's contour that a model shows from the side.

The contour runs along the front's silhouette. Seen from the side it belongs on that view's own silhouette; where it
lies on the surface instead, it is a band across the middle of the view.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from exporters.asset import ByteArray, TexturedMesh
from fig2mesh.mesh.preview import render_mesh, view_bounds
from fig2mesh.records import BoolArray

YAWS: Final = (90.0, 270.0)
"""Left and right side."""

RIM: Final = 1.3
"""Width of the silhouette's rim, where ink is expected, line widths."""

NEAR: Final = 75.0
"""Largest distance of ink from the pen's colour, RGB 0-255: soft edges of lines are mixed with what is beside them."""

SHIFT: Final = 0.5
"""Tolerance for lines inside the figure, line widths: the inset moves them."""

PIXELS: Final = 4.0
"""Pixels per line width ..."""

MAX_SIDE_PX: Final = 1536
"""... in pictures of at most this size."""


@dataclass(frozen=True)
class SideInk:
    """Contour ink in views from the sides, all views together.

    share : of the pixels inside the silhouettes, rims left out, that show contour ink
    width : mean width of its bands, relative to the drawn line's; 0 where there are none
    """

    share: float
    width: float


def side_ink(
    mesh: TexturedMesh,
    bare: TexturedMesh,
    pens: NDArray[Any],
    width_m: float,
    yaws: Sequence[float] = YAWS,
) -> SideInk:
    """Measure the contour's ink inside of side views.

    A pixel shows contour ink where its colour is near a pen's and the same model without its contour has other colours
    there and within `SHIFT` line widths. Black clothes, hair and lines inside the figure are alike in both, and do not
    count. Within `RIM` line widths of the view's silhouette ink is where it belongs.

    Parameters
    ----------
    mesh : ASSET, with its outline if it has one
    bare : the model made with the contour dropped: the same surface as drawn
    pens : (P, 3) sRGB 0-255, colours of the contour; none: no ink
    width_m : width of the drawn line, metres
    """
    if not len(pens) or not width_m > 0:
        return SideInk(0.0, 0.0)
    inked, inside, length, pixels = 0, 0, 0.0, PIXELS
    for yaw in yaws:
        left, bottom, right, top = view_bounds(bare, yaw)
        pixel = max(width_m / PIXELS, max(right - left, top - bottom) / MAX_SIDE_PX)
        pixels = width_m / pixel
        size = int(np.ceil((right - left) / pixel)) + 2, int(np.ceil((top - bottom) / pixel)) + 2
        bounds = left - pixel, bottom - pixel, left + (size[0] - 1) * pixel, bottom + (size[1] - 1) * pixel
        shown, without = (render_mesh(one, yaw_deg=yaw, size=size, bounds=bounds, samples=1) for one in (mesh, bare))
        inner = _distance(shown[..., 3] > 0) > RIM * pixels
        ink = inner & _near(shown, pens) & (_distance(~_near(without, pens)) > SHIFT * pixels)
        inked, inside, length = inked + int(ink.sum()), inside + int(inner.sum()), length + _length(ink)
    return SideInk(inked / max(inside, 1), inked / length / pixels if length else 0.0)


def pens_of(mesh: TexturedMesh) -> ByteArray:
    """(P, 3) colours of a model's outline."""
    if mesh.outline is None:
        return np.zeros((0, 3), np.uint8)
    return np.unique(mesh.outline.colors, axis=0)


def _near(picture: ByteArray, pens: NDArray[Any]) -> BoolArray:
    """(H, W) bool: colours near one of the pens."""
    colours = picture[..., :3].astype(np.float32)
    near = np.zeros(colours.shape[:2], np.bool_)
    for pen in np.asarray(pens, np.float32):
        near |= np.linalg.norm(colours - pen, axis=-1) < NEAR
    return near


def _distance(area: BoolArray) -> NDArray[np.float64]:
    """(H, W) distance to the nearest pixel outside of an area, pixels; beyond the picture is outside."""
    return np.asarray(ndimage.distance_transform_edt(np.pad(area, 1)))[1:-1, 1:-1]


def _length(ink: BoolArray) -> float:
    """Length of the bands, pixels: number of pixels of their skeletons."""
    from skimage.morphology import skeletonize

    return float(skeletonize(ink).sum()) if ink.any() else 0.0
