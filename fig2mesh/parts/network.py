"""Part fields from the networks (paper §4.2): masks and 3D joints in, signed distances out.

Each part gets its 64 x 64 mask, cut out of the drawing in the square of its PART cube, and its anchor joints. The size
of the cube follows from both (§4.3). A part that the drawing hides has an empty mask: its shape comes from the pose
alone, its size from its twin where that is visible.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fig2mesh.counters import count
from fig2mesh.field.distance import grid_distance
from fig2mesh.parts.canvas import Canvas
from fig2mesh.parts.inflate import single_threaded
from fig2mesh.parts.split import Split
from fig2mesh.records import BoolArray, FloatArray, PartSdf, Pose3D
from fig2mesh.skeleton import BODY_PARTS, KINDS, PART, PART_KIND, anchor_joints, part_centre

if TYPE_CHECKING:
    from fig2mesh.nets.disn import Disn
    from fig2mesh.nets.part_size import PartSizeNet

MASK = 64
NODES = 64
"""The paper's grids (§4.2); depth alone needs fewer, because columns are cut between nodes."""

MIN_PIXELS = 6
"""Least number of visible pixels of a part; parts with fewer count as hidden."""

ROOM = 1.04
"""Least ratio of a cube's edge to the drawn size of its part."""

MIN_EDGE = 0.03

MAX_CLOTH = 0.3
"""Largest share under cloth of a hidden part; parts with more are left out."""

MIN_CONTACT = 8
"""Least number of nodes of a hidden part inside another one: fewer would hold it by a thread."""


def network_parts(
    canvas: Canvas,
    divided: Split,
    joints: NDArray[np.float64],
    nets: Mapping[str, Disn],
    sizes: Mapping[str, PartSizeNet],
    nodes: int = NODES,
) -> tuple[PartSdf, ...]:
    """Fields of all 14 parts on grids of `nodes` nodes per edge, FIGURE, in the order of their labels.

    joints : (21, 3) FIGURE
    nets, sizes : networks by kind
    """
    from fig2mesh.nets.decode import decode_many

    inputs = network_inputs(canvas, divided, joints, sizes)
    count("part networks", len(inputs))
    grids = decode_many(nets, {part: (given.mask, given.anchors) for part, given in inputs.items()}, nodes)
    return tuple(
        PartSdf(
            part,
            grids[part] * np.float32(given.edge / 2),
            given.centre.astype(np.float32),
            given.edge,
            bool(given.mask.any()),
        )
        for part, given in inputs.items()
    )


class PartInput(NamedTuple):
    """Input of a part network: mask (64, 64) bool; anchors (A, 3) PART; centre (3,) and edge of the cube, FIGURE."""

    mask: BoolArray
    anchors: NDArray[np.float64]
    centre: NDArray[np.float64]
    edge: float


def network_inputs(
    canvas: Canvas, divided: Split, joints: NDArray[np.float64], sizes: Mapping[str, PartSizeNet]
) -> dict[int, PartInput]:
    """Input of each part's network, by label."""
    regions = {part: part_region(divided, part) for part in BODY_PARTS}
    return {
        part: PartInput(
            part_mask(canvas, regions[part], centre, edge),
            2.0 * (joints[list(anchor_joints(part))] - centre) / edge,
            centre,
            edge,
        )
        for part, (centre, edge) in part_cubes(canvas, regions, joints, sizes).items()
    }


def part_region(divided: Split, part: int) -> BoolArray:
    """(H, W) bool: region of a part, also behind others as far as its layer's outline was completed."""
    region = np.zeros(divided.labels.shape, bool)
    for layer in divided.layers:
        region |= layer.labels == part
    return region if region.sum() >= MIN_PIXELS else np.zeros_like(region)


def part_cubes(
    canvas: Canvas, regions: Mapping[int, BoolArray], joints: NDArray[np.float64], sizes: Mapping[str, PartSizeNet]
) -> dict[int, tuple[NDArray[np.float64], float]]:
    """Centre (3,) and edge of each part's PART cube, FIGURE."""
    from fig2mesh.nets.part_size import part_size

    points = canvas.points()
    result = {}
    for part, region in regions.items():
        centre = part_centre(part, joints)
        own = points[region]
        drawn = None if not len(own) else tuple((np.ptp(own, axis=0) + canvas.pitch).tolist())
        _, edge = part_size(sizes[PART_KIND[part]], part, joints, drawn)
        if len(own):
            edge = max(edge, 2.0 * ROOM * float(np.abs(own - centre[:2]).max() + canvas.pitch))
        result[part] = (centre, max(edge, MIN_EDGE))
    for part, region in regions.items():
        twin = next((p for p in BODY_PARTS if PART_KIND[p] == PART_KIND[part] and p != part), None)
        if not region.any() and twin is not None and regions[twin].any():
            result[part] = (result[part][0], result[twin][1])
    return result


def part_mask(canvas: Canvas, region: BoolArray, centre: NDArray[np.float64], edge: float) -> BoolArray:
    """(64, 64) bool: a region in the square of a PART cube; row 0 at y = +1, column 0 at x = -1."""
    if not region.any():
        return np.zeros((MASK, MASK), bool)
    step = (np.arange(MASK) + 0.5) / MASK * 2.0 - 1.0
    x, y = np.meshgrid(centre[0] + edge / 2 * step, centre[1] - edge / 2 * step)
    where = np.moveaxis(canvas.pixels(np.stack([x, y], axis=-1)), -1, 0)
    # Pixels of the square may be larger than the canvas's: average before sampling, or strokes are lost.
    blur = 0.5 * (edge / MASK) / canvas.pitch
    image = ndimage.gaussian_filter(region.astype(np.float32), 0.5 * blur) if blur > 1.0 else region.astype(np.float32)
    return np.asarray(ndimage.map_coordinates(image, where, order=1, mode="constant") > 0.5)


def part_inference(
    pose: Pose3D, nodes: int = NODES, device: str = "cpu", precision: str = "float32"
) -> Callable[[Canvas, Split], tuple[PartSdf, ...]]:
    """`network_parts` with the networks that come with the package, loaded once per process.

    precision : "float32", or "bfloat16" for matrix products where that loses little
    """
    import torch

    from fig2mesh.nets.disn import PART_WEIGHTS, DisnShape

    nets = {kind: PART_WEIGHTS.shipped(DisnShape(kind)).to(device) for kind in KINDS}
    sizes = shipped_sizes()
    joints = pose.joints.astype(np.float64)

    def infer(canvas: Canvas, divided: Split) -> tuple[PartSdf, ...]:
        with single_threaded(), torch.autocast(device, torch.bfloat16, enabled=precision == "bfloat16"):
            return network_parts(canvas, divided, joints, nets, sizes, nodes)

    return infer


def shipped_sizes() -> dict[str, PartSizeNet]:
    """Size networks that come with the package, by kind, loaded once per process."""
    from fig2mesh.nets.part_size import SIZE_WEIGHTS, SizeShape

    return {kind: SIZE_WEIGHTS.shipped(SizeShape(kind)) for kind in KINDS}


def hidden_parts(
    fields: tuple[PartSdf, ...], shown: tuple[PartSdf, ...], canvas: Canvas, divided: Split
) -> tuple[PartSdf, ...]:
    """Parts that the drawing hides, inferred from the pose alone, without those that cannot be there.

    They are cut off at the drawn outline, because hidden parts may not stick out of it. Parts under cloth are left out,
    and so are parts that would float without touching what is shown.

    fields : fields made by the networks; shown : the parts of the drawing
    """
    under_cloth = divided.garment | (divided.labels >= PART["hair"])
    waiting = []
    for field in fields:
        if field.observed or any(part.part == field.part for part in shown):
            continue
        axis = np.linspace(0.0, field.edge, field.grid.shape[0])
        columns = np.stack(np.meshgrid(field.origin[0] + axis, field.origin[1] + axis, indexing="ij"), axis=-1)
        outline = canvas.sample(canvas.sdf, columns)
        grid: FloatArray = np.maximum(field.grid, (outline + canvas.pitch)[..., None]).astype(np.float32)
        there = (grid < 0).any(axis=2)
        if not there.any() or canvas.sample(under_cloth.astype(np.float64), columns[there]).mean() > MAX_CLOTH:
            continue
        waiting.append(PartSdf(field.part, grid, field.centre, field.edge, False))
    held: list[PartSdf] = []
    while True:
        # Parts hang on each other: a hidden hand is held by a hidden forearm.
        touching = [part for part in waiting if _touches(part, (*shown, *held))]
        if not touching:
            return tuple(held)
        held += touching
        waiting = [part for part in waiting if all(part is not other for other in touching)]


def _touches(part: PartSdf, others: tuple[PartSdf, ...]) -> bool:
    """Whether some nodes of a part lie well inside another."""
    nodes = np.argwhere(part.grid < 0)
    points = part.origin + part.spacing * nodes.astype(np.float64)
    return any((grid_distance(other, points) < -part.spacing).sum() > MIN_CONTACT for other in others)
