"""Defects of a model along the drawing's line of sight: cracks, flanges, cookie-cutter edges.

All measures take closed surfaces in ASSET, metres, of a figure 1.79 m high, so that their thresholds in millimetres
mean the same for every figure. Thickness is the length of a line of sight (along z) inside the solid, all layers
together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exporters.asset import TexturedMesh
from fig2mesh.mesh.raycast import scene_of
from fig2mesh.records import BoolArray, Mesh

Surface = Mesh | TexturedMesh

PITCH = 0.0015
"""Metres between the lines of sight of `front_view`: two of them fit between a rim and the probe of `wall_share`."""
MAX_STEPS = 2000
"""Lines of sight along the longer side; larger models are sampled more coarsely."""
MAX_SIDE_PX = 1536
"""Of larger drawings only every second, third ... pixel is measured, as for the overlap of the silhouettes."""
LINES_AT_ONCE = 1 << 19

FLANGE_RATIO, FLANGE_DEPTH = 0.5, 0.004
WALL_RATIO, WALL_PROBE, NARROW = 0.6, 0.003, 0.02


@dataclass(frozen=True)
class Gap:
    """Parts of the drawing that the model does not cover.

    share : of the drawn silhouette's pixels
    radius_mm : of the largest disc that fits into the uncovered region
    """

    share: float
    radius_mm: float


@dataclass(frozen=True)
class FrontView:
    """A solid viewed from the front.

    thickness : (H, W) float64, metres, row 0 at the top; zero outside the solid and in the outermost pixels
    depth : (H, W) float64, metres from a pixel's centre to the silhouette's rim; zero outside
    pitch : metres between neighbouring pixels
    """

    thickness: NDArray[np.float64]
    depth: NDArray[np.float64]
    pitch: float


def gap(mesh: Surface, mask: BoolArray, *, metres_per_pixel: float, origin_px: tuple[float, float]) -> Gap:
    """Parts of the drawing that no model lies behind: their share and their largest disc.

    The overlap of the silhouettes hides this: 1 % of the figure missing is a missing hand, a crack all round a limb,
    or half a pixel along the whole rim. The largest disc distinguishes them: a crack between parts is long but narrow,
    a rim is half a pixel wide, and a missing hand contains a disc of centimetres.

    mesh : ASSET; mask : (H, W) bool, IMAGE; origin_px : the ASSET origin on the drawing
    """
    from scipy.ndimage import distance_transform_edt

    if not mask.any():
        return Gap(0.0, 0.0)
    step = -(-max(mask.shape) // MAX_SIDE_PX)
    drawn = mask[step // 2 :: step, step // 2 :: step]
    rows, columns = np.nonzero(drawn)
    at_px = np.stack([columns * step + step // 2 + 0.5, rows * step + step // 2 + 0.5], axis=1)
    points = (at_px - origin_px) * (metres_per_pixel, -metres_per_pixel)
    missing = np.zeros((drawn.shape[0] + 2, drawn.shape[1] + 2), np.bool_)
    missing[rows + 1, columns + 1] = ~_covered(mesh, points)
    if not missing.any():
        return Gap(0.0, 0.0)
    # From the centre of a pixel to the rim of the missing part: half a pixel less than to the next covered centre.
    radius_px = (float(distance_transform_edt(missing).max()) - 0.5) * step
    return Gap(float(missing.sum()) / max(len(rows), 1), 1000 * radius_px * metres_per_pixel)


def front_view(mesh: Surface) -> FrontView:
    """Thickness of a closed surface, ASSET, on a raster of lines of sight 1.5 mm apart."""
    from scipy.ndimage import distance_transform_edt

    (left, bottom), (right, top) = mesh.vertices[:, :2].min(axis=0).tolist(), mesh.vertices[:, :2].max(axis=0).tolist()
    pitch = max(PITCH, max(right - left, top - bottom) / MAX_STEPS)
    width, height = (int(np.ceil(length / pitch)) + 2 for length in (right - left, top - bottom))
    x = left + (np.arange(width) - 0.5) * pitch
    y = top - (np.arange(height) - 0.5) * pitch
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    thickness = thickness_at(mesh, points).reshape(height, width)
    distance = np.asarray(distance_transform_edt(np.pad(thickness > 0, 1)))[1:-1, 1:-1]
    return FrontView(thickness, np.maximum(distance - 0.5, 0.0) * pitch, pitch)


def flange_share(front: FrontView) -> float:
    """Share of the front view's pixels where the solid is paper-thin although they lie well inside the silhouette.

    With d the distance to the rim, a pixel is flange where d > 4 mm and the thickness is below d/2. A strip of
    circular section and half width r has thickness 2 sqrt(d (2r - d)) >= 2d up to its middle, a strip of elliptic
    section k times as deep as wide k times that: flanges are flatter than a quarter of that. Closer to the
    rim than 4 mm everything is thin, and the raster too coarse. Drawn sheets (fans, flags, hat brims) count as well.
    """
    inside = front.thickness > 0
    flange = inside & (front.depth > FLANGE_DEPTH) & (front.thickness < FLANGE_RATIO * front.depth)
    return float(flange.sum()) / max(int(inside.sum()), 1)


def wall_share(front: FrontView) -> float:
    """Share of the silhouette's rim that is a wall, as if a cookie cutter had made it.

    From each pixel of the rim the inward normal is followed to the middle of the strip, where the distance to the rim
    stops growing. The rim is a wall where the thickness 3 mm inside is more than 0.6 of the largest one met on the
    way. Circular sections of 20 to 150 mm half width have 0.53 to 0.14 there, a slab 1. Where the strip is narrower
    than 20 mm to its middle, 3 mm is no longer near the rim, and the rim is not judged. Flat hems of gowns and soles
    are walls by this measure too, rightly drawn or not.
    """
    from scipy.ndimage import gaussian_filter, map_coordinates

    inside, depth, pitch = front.thickness > 0, front.depth, front.pitch
    slopes = np.gradient(gaussian_filter(inside.astype(np.float64), 2 * WALL_PROBE / pitch))
    rim = np.argwhere(inside & (depth <= 0.51 * pitch))
    inward = np.stack([slope[tuple(rim.T)] for slope in slopes], axis=1)
    steep = np.linalg.norm(inward, axis=1)
    rim, inward = rim[steep > 1e-3], inward[steep > 1e-3] / steep[steep > 1e-3, None]

    def at(values: NDArray[np.float64], steps: float) -> NDArray[np.float64]:
        return np.asarray(map_coordinates(values, (rim + steps * inward).T, order=1, mode="constant"))

    # The centre of a pixel of the rim lies half a pixel inside.
    edge = at(front.thickness, WALL_PROBE / pitch - 0.5)
    half_width, largest = np.zeros(len(rim)), np.zeros(len(rim))
    going = np.ones(len(rim), np.bool_)
    for step in range(int(depth.max() / pitch) + 2):
        there = at(depth, step)
        going &= there > half_width - 1.5 * pitch
        half_width = np.where(going, np.maximum(half_width, there), half_width)
        largest = np.where(going, np.maximum(largest, at(front.thickness, step)), largest)
    judged = half_width > NARROW
    return float((edge[judged] > WALL_RATIO * largest[judged]).sum()) / max(int(judged.sum()), 1)


def thickness_at(mesh: Surface, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) thickness in metres of a closed surface, ASSET, at points (N, 2) x, y of the front view."""
    scene, top = scene_of(mesh.vertices, mesh.faces), _before(mesh)
    thickness = np.zeros(len(points))
    waiting = np.arange(len(points))
    # A line of sight through an edge can hit both its triangles or none: such lines are moved a little.
    for shift in (0.0, 2.3e-6, -3.1e-6, 7.7e-6):
        doubtful = []
        for part in np.array_split(waiting, -(-len(waiting) // LINES_AT_ONCE)) if len(waiting) else ():
            found, balance = _crossed(scene, mesh, points[part] + (shift, 0.7 * shift), top)
            thickness[part] = np.maximum(found, 0.0)
            doubtful.append(part[balance != 0])
        waiting = np.concatenate(doubtful) if doubtful else waiting[:0]
    thickness[waiting] = 0.0
    return thickness


def _crossed(
    scene: Any, mesh: Surface, points: NDArray[np.float64], top: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N,) thickness along lines of sight, and number of exits minus number of entries of each."""
    import open3d as o3d

    answer = scene.list_intersections(o3d.core.Tensor.from_numpy(_lines(points, top)))
    line, at = answer["ray_ids"].numpy(), answer["t_hit"].numpy().astype(np.float64)
    a, b, c = (
        mesh.vertices[mesh.faces[answer["primitive_ids"].numpy()][:, k], :2].astype(np.float64) for k in range(3)
    )
    u, v = b - a, c - a
    # Positive where the triangle faces the viewer, which is where the line of sight enters.
    sign = -np.sign(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    thickness, balance = (np.bincount(line, weights, len(points)) for weights in (sign * at, sign))
    return thickness.astype(np.float64), balance.astype(np.float64)


def _covered(mesh: Surface, points: NDArray[np.float64]) -> BoolArray:
    """(N,) bool, whether the surface lies behind points (N, 2) of the front view."""
    import open3d as o3d

    lines = o3d.core.Tensor.from_numpy(_lines(points, _before(mesh)))
    return np.asarray(scene_of(mesh.vertices, mesh.faces).test_occlusions(lines).numpy())


def _lines(points: NDArray[np.float64], top: float) -> NDArray[np.float32]:
    rays = np.zeros((len(points), 6), np.float32)
    rays[:, :2], rays[:, 2], rays[:, 5] = points, top, -1.0
    return rays


def _before(mesh: Surface) -> float:
    """Some z in front of the whole surface."""
    return float(mesh.vertices[:, 2].max()) + 0.1
