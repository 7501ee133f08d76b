"""Part fields with the drawn outline: from rules alone, or with the cross-sections that networks infer.

The silhouette is split into layers by the skeleton (`split`), each layer's completed outline is inflated
(`inflate`) around a middle surface that follows the 3D joints (`depth`), and the parts are cut out of the layers
with some overlap. Parts of one layer share one surface, so that their union has no seam at a joint.

Without networks it is their baseline, and an oracle for tests: no weights are needed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.errors import FigureError
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.fillets import make_fillets
from fig2mesh.parts.inflate import single_threaded
from fig2mesh.parts.layer_inflation import LayerSurface
from fig2mesh.parts.layers import raise_layers
from fig2mesh.parts.network import hidden_parts
from fig2mesh.parts.split import Split, split
from fig2mesh.records import BoolArray, PartSdf, Pose3D
from fig2mesh.skeleton import BODY_PARTS, PART

OVERLAP = 0.025
"""Overlap of neighbouring parts of one layer, FIGURE units."""

CUT_BLUR_PX = 2.0
"""Smoothing of the cuts between parts, pixels. It moves the cut of a part one pixel wide by 1.3 pixels: on a coarse
canvas parts overlap by more than that."""

THIN = 0.75
"""Largest grid spacing relative to the half thickness of a part."""

MIN_NODES, MAX_NODES = 64, 192
"""The paper's grids have 64 nodes per edge (§4.2); small parts have fingers and need them more than large ones."""


@dataclass(frozen=True)
class Outline:
    """Result of the outline method: the part fields and, for the texture, the part that each pixel shows.

    fillets : (first, second, grid) between two of the parts, see `Body`
    """

    parts: tuple[PartSdf, ...]
    split: Split
    layers: tuple[LayerSurface, ...]
    canvas: Canvas
    fillets: tuple[tuple[int, int, PartSdf], ...] = ()


def outline_parts(
    canvas: Canvas,
    pose: Pose3D,
    visible: BoolArray,
    *,
    voxel: float,
    device: str = "cpu",
    infer: Callable[[Canvas, Split], tuple[PartSdf, ...]] | None = None,
) -> Outline:
    """Part fields of a silhouette.

    Parameters
    ----------
    visible : (21,) bool, joints that the drawing shows
    voxel : target grid spacing, FIGURE units; larger for large parts, whose grids are limited to 192³ nodes
    device : PyTorch device of the inflation and the field evaluation
    infer : function that makes the part fields from which layers take their cross-sections; None: rules alone
    """
    joints = pose.joints.astype(np.float64)
    divided = split(canvas, joints, visible)
    fields = infer(canvas, divided) if infer is not None else ()
    surfaces = raise_layers(canvas, divided, joints, device, fields)
    found = [
        (number, part)
        for number, surface in enumerate(surfaces)
        for label in np.unique(surface.labels[surface.labels > 0])
        if (part := _part_field(canvas, surface, int(label), voxel, divided, device)) is not None
    ]
    if not found:
        raise FigureError("silhouette", "too thin to be a solid", "give a larger picture, or --quality fine")
    layer_of, parts = zip(*found, strict=True)
    hidden = hidden_parts(fields, parts, canvas, divided)
    return Outline((*parts, *hidden), divided, surfaces, canvas, make_fillets(canvas, parts, layer_of))


def _part_field(
    canvas: Canvas, surface: LayerSurface, label: int, voxel: float, divided: Split, device: str
) -> PartSdf | None:
    """Field of one part of a layer on its own grid; None where nothing of it is left."""
    here = surface.labels == label
    if here.sum() < 4 or not (surface.u[here] > 0).any():
        return None
    cut = (ndimage.distance_transform_edt(~here) - ndimage.distance_transform_edt(here)) * canvas.pitch
    cut = ndimage.gaussian_filter(cut, CUT_BLUR_PX) - max(OVERLAP, 1.25 * CUT_BLUR_PX * canvas.pitch)
    if surface.clip is not None:
        cut = np.maximum(cut, surface.clip)
    solid = (surface.u > 0) & (cut < 0)
    if not solid.any():
        return None
    rows, columns = np.nonzero(solid)
    half = np.sqrt(surface.u[solid])
    points = canvas.points()
    # At least one node must fall inside a part, however thin it is drawn.
    voxel = min(voxel, THIN * float(half.max()))
    pad = 3.0 * voxel + canvas.pitch
    low = np.array([points[0, columns.min(), 0], points[rows.max(), 0, 1], (surface.z0[solid] - half).min()]) - pad
    high = np.array([points[0, columns.max(), 0], points[rows.min(), 0, 1], (surface.z0[solid] + half).max()]) + pad
    edge = float((high - low).max())
    nodes = min(max(math.ceil(edge / voxel) + 1, MIN_NODES), MAX_NODES)
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
    # Beyond the canvas u is only extrapolated as a constant; the distance to the canvas makes up for it.
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
