"""Part fields from the outline alone: the road without networks.

The silhouette is split into layers by the skeleton (`split`), each layer's completed outline is inflated
(`inflate`) around a middle surface that follows the 3D joints (`depth`), and the parts are cut out of the layers
with some overlap. Parts of one layer share one surface, so that their union has no seam at a joint.

It is the baseline for the networks of paper §4.2 and an oracle for tests: no weights are needed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.depth import mid_surface, place_limb
from fig2mesh.parts.inflate import inflate, single_threaded
from fig2mesh.parts.limbs import Limb
from fig2mesh.parts.split import Layer, Split, split
from fig2mesh.records import BODY_PARTS, JOINT, PART, PART_NAMES, BoolArray, PartSdf, Pose3D

LOAD = {"torso": 0.95, "head": 3.0, "garment": 1.1, "foot": 2.2, "limb": 2.0}
"""Right-hand side of the inflation by kind of part: 2 makes a strip as deep as wide, 1 about 0.7 times; a torso is
two thirds as deep as wide, a head nearly a ball."""

FRONTAL_FOOT = 4.0
"""What a foot that points to the viewer has on top of that: it is longer than the drawing shows it wide."""

OVERLAP = 0.025
"""How far neighbouring parts of one layer reach into each other, FIGURE units."""

LEAST_NODES, MOST_NODES = 16, 192


@dataclass(frozen=True)
class LayerSurface:
    """A layer in depth: it fills z0 − √u … z0 + √u.

    u : (H, W) float64, squared half thickness in FIGURE units², negative outside the outline
    z0 : (H, W) float64, FIGURE z of its middle
    labels : (H, W) uint8, part of each pixel, 0 outside the region
    """

    u: NDArray[np.float64]
    z0: NDArray[np.float64]
    labels: NDArray[np.uint8]


@dataclass(frozen=True)
class Outline:
    """Everything the outline road knows: the part fields and, for the texture, which part each pixel shows."""

    parts: tuple[PartSdf, ...]
    split: Split
    layers: tuple[LayerSurface, ...]
    canvas: Canvas


def outline_parts(canvas: Canvas, pose: Pose3D, visible: BoolArray, *, voxel: float, device: str = "cpu") -> Outline:
    """Part fields of a silhouette.

    Parameters
    ----------
    visible : (21,) bool, joints that the drawing shows
    voxel : grid spacing aimed at, FIGURE units; large parts on coarser grids than 192³ asks for get a larger one
    device : PyTorch device of the inflation and the field evaluation
    """
    joints = pose.joints.astype(np.float64)
    divided = split(canvas, joints, visible)
    surfaces = _surfaces(canvas, divided, joints, device)
    parts = [
        part
        for surface in surfaces
        for label in np.unique(surface.labels[surface.labels > 0])
        if (part := _part_field(canvas, surface, int(label), voxel, divided, device)) is not None
    ]
    return Outline(tuple(parts), divided, surfaces, canvas)


def _surfaces(canvas: Canvas, divided: Split, joints: NDArray[np.float64], device: str) -> tuple[LayerSurface, ...]:
    in_core = [limb for limb in divided.limbs if all(limb is not layer.limb for layer in divided.layers)]
    trunk_joints = [
        JOINT[n] for n in ("neck", "thorax", "pelvis", "l_shoulder", "r_shoulder", "l_hip", "r_hip", "head")
    ]
    trunk = np.concatenate([joints[trunk_joints], _between(joints[JOINT["thorax"]], joints[JOINT["pelvis"]])])
    points = np.concatenate([trunk[:, :2], *(limb.points for limb in in_core)])
    depth = np.concatenate([trunk[:, 2], *(limb.depth for limb in in_core)])
    core, *others = divided.layers
    loads = _loads(joints)
    surfaces = [_inflated(canvas, core, mid_surface(canvas, points, depth), loads, device)]
    top, bottom = _extent(surfaces[0])
    legs_top, legs_bottom = np.full_like(top, np.nan), np.full_like(bottom, np.nan)
    for layer in sorted(others, key=_drawn_order):
        assert layer.limb is not None
        if layer.limb.is_arm:
            limb = place_limb(layer.limb, canvas, _upper(top, legs_top), _lower(bottom, legs_bottom), behind=True)
        else:
            raised = layer.limb.seen & (joints[JOINT["pelvis"], 1] < layer.limb.points[:, 1])
            limb = place_limb(layer.limb, canvas, np.where(np.isnan(legs_top), np.nan, legs_top), legs_bottom)
            if raised.any():
                limb = place_limb(limb, canvas, top, bottom)
        surface = _inflated(canvas, layer, mid_surface(canvas, limb.points, limb.depth), loads, device)
        surfaces.append(surface)
        above, below = _extent(surface)
        if not limb.is_arm:
            legs_top, legs_bottom = _upper(legs_top, above), _lower(legs_bottom, below)
    return tuple(surfaces)


def _drawn_order(layer: Layer) -> tuple[bool, float, float]:
    """Legs before arms; of two legs first the one that the drawing hides, else the one further up (further away)."""
    limb: Limb | None = layer.limb
    assert limb is not None
    return limb.is_arm, float(limb.seen.mean()), -float(limb.points[-1, 1])


def _between(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    t = np.linspace(0.0, 1.0, 6)[:, None]
    return start + t * (end - start)


def _extent(surface: LayerSurface) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    half = np.where(surface.u > 0, np.sqrt(np.maximum(surface.u, 0.0)), np.nan)
    return surface.z0 + half, surface.z0 - half


def _upper(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.fmax(a, b))


def _lower(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.fmin(a, b))


def _loads(joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right-hand side of the inflation for every part label."""
    loads = np.array([LOAD.get(name, LOAD["limb"]) for name in PART_NAMES])
    for side in "lr":
        across, along = np.abs(joints[JOINT[f"{side}_foot"], :2] - joints[JOINT[f"{side}_ankle"], :2])
        sideways = across / max(0.8 * float(np.hypot(across, along)), 1e-9)
        loads[PART[f"{side}_foot"]] = LOAD["foot"] + FRONTAL_FOOT * max(0.0, 1.0 - float(sideways))
    return loads


def _inflated(
    canvas: Canvas, layer: Layer, z0: NDArray[np.float64], loads: NDArray[np.float64], device: str
) -> LayerSurface:
    values = np.where(layer.region, loads[layer.labels], 0.0)
    blur = 0.03 / canvas.pitch
    cover = ndimage.gaussian_filter(layer.region.astype(float), blur)
    load = ndimage.gaussian_filter(values, blur) / np.maximum(cover, 1e-6)
    u = inflate(layer.region, load, device) * canvas.pitch**2
    return LayerSurface(_extended(canvas, layer.region, u), z0, layer.labels)


def _extended(canvas: Canvas, region: NDArray[np.bool_], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Continue u below zero outside its region, with the drawn contour located to a fraction of a pixel.

    Near the rim u grows linearly with the distance to it. The solver knows that distance only in whole pixels, the
    canvas knows it exactly: u is rescaled by their ratio. Outside, a circle's u goes on as −(s d + d²), where s is the
    slope at the rim: then the distance formula of `_evaluate` is exact for circular cross-sections.
    """
    whole = ndimage.distance_transform_edt(region, sampling=canvas.pitch)
    beyond, rim = ndimage.distance_transform_edt(~region, sampling=canvas.pitch, return_indices=True)
    slope = np.where(region, u / np.maximum(whole, canvas.pitch), 0.0)
    # The outermost pixels carry the solver's stairs; the slope two pixels further in is smooth.
    inner = whole >= 2.0 * canvas.pitch
    if inner.any():
        _, source = ndimage.distance_transform_edt(~inner, return_indices=True)
        slope = np.where(inner, slope, slope[tuple(source)])
    slope = slope[tuple(rim)]
    slope = np.where(region, slope, ndimage.gaussian_filter(slope, 1.5))
    # Where the region ends inside the silhouette (under another layer) its own raster distance must do.
    own = np.where(region, 0.5 * canvas.pitch - whole, beyond - 0.5 * canvas.pitch)
    distance = np.where(np.abs(own - canvas.sdf) < 1.5 * canvas.pitch, canvas.sdf, own)
    return np.asarray(np.where(distance > 0, -(slope * distance + distance**2), -slope * distance))


def _part_field(
    canvas: Canvas, surface: LayerSurface, label: int, voxel: float, divided: Split, device: str
) -> PartSdf | None:
    """One part of a layer on its own grid; None where nothing of it is left."""
    here = surface.labels == label
    if here.sum() < 4 or not (surface.u[here] > 0).any():
        return None
    cut = (ndimage.distance_transform_edt(~here) - ndimage.distance_transform_edt(here)) * canvas.pitch
    cut = ndimage.gaussian_filter(cut, 2.0) - OVERLAP
    solid = (surface.u > 0) & (cut < 0)
    rows, columns = np.nonzero(solid)
    half = np.sqrt(surface.u[solid])
    points = canvas.points()
    pad = 3.0 * voxel + canvas.pitch
    low = np.array([points[0, columns.min(), 0], points[rows.max(), 0, 1], (surface.z0[solid] - half).min()]) - pad
    high = np.array([points[0, columns.max(), 0], points[rows.min(), 0, 1], (surface.z0[solid] + half).max()]) + pad
    edge = float((high - low).max())
    nodes = min(max(math.ceil(edge / voxel) + 1, LEAST_NODES), MOST_NODES)
    centre = (low + high) / 2.0
    with single_threaded():
        grid = _evaluate(canvas, surface, cut, centre, edge, nodes, device)
    if not (grid < 0).any():
        return None
    observed = bool((divided.labels == label).any()) if label in BODY_PARTS or label >= PART["hair"] else True
    return PartSdf(label, grid, centre.astype(np.float32), edge, observed)


def _evaluate(
    canvas: Canvas,
    surface: LayerSurface,
    cut: NDArray[np.float64],
    centre: NDArray[np.float64],
    edge: float,
    nodes: int,
    device: str,
) -> NDArray[np.float32]:
    """(n, n, n) signed distances of a cut layer.

    With g = (z − z0)² − u, the distance is 2g / (|∇g| + √(|∇g|² − 4g)): the root along the gradient of a quadratic
    with the second derivative of (z − z0)². It is exact for circular cross-sections and first order everywhere.
    """
    import torch

    axis = np.linspace(-edge / 2, edge / 2, nodes)
    x, y, z = (axis + c for c in centre)
    columns = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    slopes = [np.gradient(image, canvas.pitch) for image in (surface.u, surface.z0)]
    images = [surface.u, surface.z0, slopes[0][1], -slopes[0][0], slopes[1][1], -slopes[1][0], cut]
    maps = [torch.from_numpy(canvas.sample(i, columns)).float().to(device)[..., None] for i in images]
    u, z0, u_x, u_y, z0_x, z0_y, cuts = maps
    # Beyond the canvas u is only continued flat; distance to the canvas makes up for it.
    height, width = canvas.sdf.shape
    where = canvas.pixels(columns)
    off = np.maximum(np.maximum(-where, where - (np.array([height, width]) - 1)), 0.0)
    away = torch.from_numpy(np.hypot(off[..., 0], off[..., 1]) * canvas.pitch).float().to(device)[..., None]
    lift = torch.from_numpy(z).float().to(device) - z0
    g = lift * lift - u
    slope2 = (u_x + 2.0 * lift * z0_x) ** 2 + (u_y + 2.0 * lift * z0_y) ** 2 + 4.0 * lift * lift
    slope = torch.sqrt(slope2)
    root = torch.sqrt(torch.clamp(slope2 - 4.0 * g, min=0.0))
    distance = 2.0 * g / torch.clamp(slope + root, min=1e-6)
    grid = torch.maximum(distance + away, cuts)
    return np.asarray(grid.cpu().numpy(), np.float32)
