"""Checks that joints and silhouette belong together.

Files of one figure may be normalised, shifted, mirrored, of half the size, or of another picture altogether. Joints are
compared with the silhouette, and so are changed joints: where those fit and the given ones do not, the change names
what is wrong with the file.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.records import BoolArray, FloatArray
from fig2mesh.skeleton import JOINT, SIDES

WORKING_PX: Final = 512
"""Pixels along the longer side at which everything is compared."""

SLACK: Final = 0.04
"""Distance, share of the silhouette's extent, at which a joint still counts as inside."""

FAR: Final = 0.12
"""Distance from the silhouette, in diagonals of its box, beyond which a joint is no imprecise one."""

MIN_INSIDE: Final = 0.5
"""Share of the joints inside a given silhouette below which they are refused."""

EXPLAINED_INSIDE: Final = 0.75
"""The same where a change of the joints explains them. Those of the figures measured are all inside."""

SURE_INSIDE: Final = 0.9
"""The same share below which joints are doubtful."""

MIN_EXTENT: Final = 0.25
EXPLAINED_EXTENT: Final = 0.5
SURE_EXTENT: Final = 0.6
MAX_EXTENT: Final = 2.5
"""Extent of the joints, shares of the silhouette's, as above; of the figures measured 0.78 to 0.94."""

MIN_WHOLE: Final = 10
"""Least number of joints whose extent is compared."""

MIN_JUDGED: Final = 24
"""Width and height of a silhouette, px, below which joints are not compared with it: a pixel is a share of a limb."""

FITS: Final = 0.9
"""Share of changed joints inside the silhouette from which the change explains what is wrong."""


class Mismatch(NamedTuple):
    """Mismatch of files that do not fit together.

    text : as in messages; remedy : the way to mend it, with a guess at what is wrong
    certain : whether the files cannot be used
    """

    text: str
    remedy: str
    certain: bool


class Change(NamedTuple):
    """A change of coordinates that explains a file. matrix : (2, 2); offset : (2,), px of the whole picture"""

    remedy: str
    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]

    def apply(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        return np.asarray(points @ self.matrix.T + self.offset, np.float64)


class PictureFrame(NamedTuple):
    """Window of a figure. size : (width, height) of the whole picture; corner : (x, y) of the window there;
    window : its (width, height)"""

    size: tuple[int, int]
    corner: tuple[int, int]
    window: tuple[int, int]


class JointFit(NamedTuple):
    """How joints fit a silhouette. inside : share of the joints in it; extent : of the joints, share of its own"""

    inside: float
    extent: float

    @property
    def good(self) -> bool:
        return self.inside >= FITS and SURE_EXTENT <= self.extent <= 1.3


class ReducedSilhouette(NamedTuple):
    """Silhouette at working size. away : (h, w) distance of each pixel to it, px of the window; step : px per cell
    low, high : (x, y) of the corners of its box, px of the window"""

    away: FloatArray
    step: int
    low: NDArray[np.float64]
    high: NDArray[np.float64]

    @property
    def extent(self) -> float:
        return float(np.linalg.norm(self.high - self.low))

    @property
    def small(self) -> bool:
        """Whether it is too small to be compared with joints."""
        return float((self.high - self.low).min()) < MIN_JUDGED

    def fit(self, points: NDArray[np.floating]) -> JointFit:
        """JointFit of (N, 2) joints, px of the window."""
        extent = float(np.linalg.norm(np.ptp(points, axis=0))) / max(self.extent, 1e-9)
        return JointFit(float((self.distances(points) <= SLACK * self.extent).mean()), extent)

    def distances(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Distances (N,) of (N, 2) points to the silhouette, px of the window; 0 in it."""
        cells = np.asarray(points, np.float64) / self.step
        limit = np.array(self.away.shape[::-1], np.float64) - 1
        near = np.clip(cells, 0, limit)
        beyond = np.linalg.norm(cells - np.clip(cells, -1, limit + 2), axis=1) * self.step
        return np.asarray(self.away[near[:, 1].astype(int), near[:, 0].astype(int)] + beyond, np.float64)


def reduced_silhouette(mask: BoolArray) -> ReducedSilhouette:
    """Silhouette at working size, without its holes; mask : (H, W), not empty"""
    step = max(1, -(-max(mask.shape) // WORKING_PX))
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    height, width = (-(-length // step) for length in mask.shape)
    padded = np.pad(mask, ((0, height * step - mask.shape[0]), (0, width * step - mask.shape[1])))
    small = padded.reshape(height, step, width, step).any(axis=(1, 3))
    away = ndimage.distance_transform_edt(~ndimage.binary_fill_holes(small)).astype(np.float32) * step
    low, high = np.array([columns[0], rows[0]], float), np.array([columns[-1] + 1, rows[-1] + 1], float)
    return ReducedSilhouette(away, step, low, high)


def coordinate_finding(points: NDArray[np.floating], frame: PictureFrame) -> Mismatch | None:
    """Mismatch of joints that no picture is needed for: normalised ones, or all at one place.

    points : (N, 2), px of the whole picture
    """
    low, high = points.min(axis=0), points.max(axis=0)
    spread = float((high - low).max())
    if float(low.min()) >= -1 and float(high.max()) <= 2 and min(frame.size) > 8:
        found = f"all joints lie between {low.min():.3g} and {high.max():.3g}"
        return Mismatch(found, "coordinates from 0 to 1? give pixels", True)
    if spread < max(2.0, 0.005 * max(frame.window)) and min(frame.size) > 8:
        found = f"all joints lie within {spread:.3g} px of one point"
        return Mismatch(found, "give each joint its own position, in pixels of the picture", True)
    if (low[0] >= 0) and high[1] <= 0 and spread > 2:
        return Mismatch("all joints have a negative y", "y upwards? count it downwards from the picture's top", True)
    return None


def changes(frame: PictureFrame) -> Iterator[Change]:
    """Changes by which the coordinates of other programs differ from pixels of the picture."""
    size, corner = np.array(frame.size, float), np.array(frame.corner, float)
    one, none = np.eye(2), np.zeros(2)
    yield Change("coordinates from 0 to 1? give pixels", np.diag(size), none)
    yield Change("coordinates in per cent? give pixels", np.diag(size / 100), none)
    if abs(np.log(size / 1000)).min() > 0.5:
        yield Change("coordinates from 0 to 1000? give pixels", np.diag(size / 1000), none)
    if corner.any():
        x, y = frame.corner
        yield Change(f"in pixels of --bbox? add {x} to x and {y} to y", one, corner)
        yield Change(f"shifted by the corner of --bbox? subtract {x} from x and {y} from y", one, -corner)
    for factor, name in ((2.0, "2"), (0.5, "0.5"), (3.0, "3"), (1 / 3, "1/3"), (4.0, "4"), (0.25, "0.25")):
        width, height = (round(length / factor) for length in frame.size)
        yield Change(f"made for a picture of {width}×{height} px? scale them by {name}", one * factor, none)
    yield Change("x and y exchanged? write x first", one[::-1], none)
    flips = np.diag([-1.0, 1.0]), np.diag([1.0, -1.0])
    yield Change("of the mirrored picture? subtract x from the width", flips[0], np.array([size[0], 0]))
    yield Change("y upwards? count it downwards from the picture's top", flips[1], np.array([0, size[1]]))
    yield Change("y upwards? count it downwards from the picture's top", flips[1], none)
    yield Change("of the picture turned by 180°? turn them too", -one, size)


def joint_finding(
    points: NDArray[np.floating], silhouette: ReducedSilhouette, frame: PictureFrame, inferred: bool = False
) -> Mismatch | None:
    """Mismatch of joints and a silhouette that do not fit together; None where they do.

    points : (N, 2) of the joints that the file has, px of the window
    inferred : the silhouette is inferred, which may be wrong itself
    """
    found = silhouette.fit(points)
    if len(points) < MIN_WHOLE:  # a few joints may be of the upper half alone
        found = JointFit(found.inside, 1.0)
    corner = np.array(frame.corner, np.float64)
    if found.inside >= SURE_INSIDE and SURE_EXTENT <= found.extent <= MAX_EXTENT:
        return None
    text = (
        f"{round(found.inside * len(points))} of {len(points)} joints lie in the "
        f"{'inferred ' if inferred else ''}silhouette"
    )
    if found.inside >= SURE_INSIDE:
        text = f"the joints span {found.extent:.0%} of the {'inferred ' if inferred else ''}silhouette"
    explained = _explained(points + corner, silhouette, corner, changes(frame))
    moved = _moved(points, silhouette)
    remedy = "pass the joints and the silhouette of this picture"
    if explained is not None:
        remedy = explained.remedy
    elif moved is not None:
        remedy = f"shifted? add about {moved[0]:.0f} to x and {moved[1]:.0f} to y, or {remedy}"
    understood = explained is not None or moved is not None
    least = MIN_INSIDE if not inferred else MIN_INSIDE / 2
    wrong = found.inside < least or (not inferred and not MIN_EXTENT <= found.extent <= MAX_EXTENT)
    # What a change explains needs less to be wrong.
    meant = found.inside < (least + EXPLAINED_INSIDE - MIN_INSIDE) or found.extent < EXPLAINED_EXTENT
    return Mismatch(text, remedy, (wrong and not inferred) or (understood and (wrong or meant)))


def _explained(
    points: NDArray[np.floating], silhouette: ReducedSilhouette, corner: NDArray[np.float64], tried: Iterator[Change]
) -> Change | None:
    fits = [(change, silhouette.fit(change.apply(points) - corner)) for change in tried]
    given = silhouette.fit(points - corner)
    good = [(fit.inside, change) for change, fit in fits if fit.good and fit.inside > given.inside - 0.02]
    return max(good, key=lambda each: each[0])[1] if good else None


def _moved(points: NDArray[np.floating], silhouette: ReducedSilhouette) -> NDArray[np.float64] | None:
    """(2,) shift that brings the joints into the silhouette, if one does."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    shift: NDArray[np.float64] = (silhouette.low + silhouette.high) / 2 - middle
    return shift if silhouette.fit(points + shift).good else None


def stray_finding(points: FloatArray, drawn: BoolArray, silhouette: ReducedSilhouette) -> Mismatch | None:
    """Mismatch of single joints that lie far from the silhouette, which the share of those in it does not show.

    points : (21, 2), px of the window; drawn : (21,) joints that the file has
    """
    away = silhouette.distances(points)
    far = [name for name, index in JOINT.items() if drawn[index] and away[index] > FAR * silhouette.extent]
    if not far:
        return None
    listed = ", ".join(f"{name} ({away[JOINT[name]]:.0f} px)" for name in far)
    return Mismatch(f"far outside the silhouette: {listed}", "correct or leave out these joints", False)


def upright_finding(points: FloatArray, silhouette: ReducedSilhouette) -> Mismatch | None:
    """Mismatch of joints upside down: the head below the feet; points : (21, 2), px of the window"""
    y = points[:, 1]
    feet = [y[JOINT[f"{side}_{name}"]] for side in SIDES for name in ("ankle", "foot")]
    if y[JOINT["head"]] < max(feet) or y[JOINT["head"]] < y[JOINT["pelvis"]]:
        return None
    middle = float(silhouette.low[1] + silhouette.high[1])
    turned = silhouette.fit(points * [1, -1] + [0, middle]).inside
    certain = turned >= FITS and turned > silhouette.fit(points).inside + 0.02
    remedy = "y upwards? count it downwards from the picture's top, unless the figure stands on its head"
    return Mismatch("the head is below the feet", remedy, certain)


def side_finding(points: FloatArray, visible: BoolArray) -> Mismatch | None:
    """Mismatch of joints whose left and right look exchanged: eyes are visible, but left is where right should be.

    points : (21, 2) IMAGE
    """
    signs = [points[JOINT[f"l_{name}"], 0] - points[JOINT[f"r_{name}"], 0] for name in ("shoulder", "hip")]
    height = float(np.ptp(points[:, 1]))
    if not visible[JOINT["eyes"]] or not all(sign < -0.05 * height for sign in signs):
        return None
    text = "left shoulder and hip are where a figure that faces the viewer has the right ones, yet its eyes are visible"
    remedy = "mirrored? exchange l_ and r_, or mark the eyes as hidden if it shows its back"
    return Mismatch(text, remedy, False)
