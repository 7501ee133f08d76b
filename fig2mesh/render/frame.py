"""Frames: pictures of a body, traced pixel by pixel in one pass, with only what is asked for.

The cost of a frame lies in the pixels that see the body. Before rays are sent, the bricks that hold the surface
(`field.empty_space`) are thrown onto the tiles of the picture: a tile then knows the parts it may see and between which
depths, so rays start next to the surface and empty tiles cost nothing.
"""

from __future__ import annotations

from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Any

import numpy as np

from fig2mesh.field.body import Body
from fig2mesh.field.camera import axes, orthographic, perspective
from fig2mesh.field.compiled import run_blocks, sealed
from fig2mesh.records import ByteArray, FloatArray, IntArray, Rays
from fig2mesh.render.frame_kernel import TILE, View, render_tiles, span_bricks
from fig2mesh.render.surface_colours import SurfaceColours

WANTS: frozenset[str] = frozenset({"colour", "depth", "parts", "normals"})
"""What a frame can hold."""

_TILES_AT_ONCE = 4


@dataclass(frozen=True)
class FrameCamera:
    """A camera as in `fig2mesh.field.camera`, as numbers instead of rays.

    yaw_deg, pitch_deg : as there: yaw 0 sees the front, 90 the figure's left side; a positive pitch looks down
    size : (width, height) in pixels; pixels are square
    height : what the picture shows from top to bottom in the plane through `centre`, FIGURE units
    centre : (3,) FIGURE, shown in the middle of the picture
    distance : from `centre` back to the plane where rays start (orthographic), or to the eye (perspective)
    perspective : whether rays start at one point
    """

    yaw_deg: float
    pitch_deg: float = 0.0
    size: tuple[int, int] = (512, 512)
    height: float = 2.0
    centre: Any = (0.0, 0.0, 0.0)
    distance: float = 10.0
    perspective: bool = False

    def __post_init__(self) -> None:
        centre = tuple(float(c) for c in self.centre)
        object.__setattr__(self, "centre", centre)
        if min(self.size) < 1 or not self.height > 0:
            raise ValueError(f"camera: size {self.size} and height {self.height}, expected positive numbers")
        if len(centre) != 3 or not np.isfinite((*centre, self.distance)).all():
            raise ValueError(f"camera: centre {centre} and distance {self.distance}, expected finite numbers")
        if self.perspective and not self.distance > 0:
            raise ValueError(f"camera: distance {self.distance}, expected a positive one in perspective")

    @property
    def pitch_units(self) -> float:
        """Edge of a pixel in the plane through `centre`, FIGURE units."""
        return self.height / self.size[1]

    def rays(self) -> Rays:
        """The rays of all pixels, row by row, for `fig2mesh.field.trace.trace`."""
        make = perspective if self.perspective else orthographic
        return make(
            self.yaw_deg,
            self.pitch_deg,
            size=self.size,
            height=self.height,
            centre=self.centre,
            distance=self.distance,
        )

    def view(self) -> View:
        """For the kernels."""
        right, up, back = axes(self.yaw_deg, self.pitch_deg)
        width, height = self.size
        pixel = self.pitch_units
        left, top = (0.5 - width / 2) * pixel, (height / 2 - 0.5) * pixel
        start = np.asarray(self.centre) + self.distance * back
        corner, per_column, per_row = left * right + top * up, pixel * right, -pixel * up
        nothing = np.zeros(3)
        if self.perspective:
            # directions of length 1 along the axis: t is the depth in front of the eye
            origin = np.stack([start, nothing, nothing])
            direction = np.stack([corner / self.distance - back, per_column / self.distance, per_row / self.distance])
        else:
            origin = np.stack([start + corner, per_column, per_row])
            direction = np.stack([-back, nothing, nothing])
        return View(
            width,
            height,
            sealed(origin, np.float64),
            sealed(direction, np.float64),
            sealed(start, np.float64),
            sealed(np.stack([right, up, back]), np.float64),
            pixel,
            float(self.distance),
            bool(self.perspective),
        )


@dataclass(frozen=True)
class Counts:
    """Work done for a frame.

    rays : sent; pixels of tiles that cannot see the body are not
    cells : looked at, as `Hits.steps`
    normals : computed
    samples : looked up in pictures
    """

    rays: int = 0
    cells: int = 0
    normals: int = 0
    samples: int = 0


@dataclass(frozen=True)
class Frame:
    """What was asked for, the rest None; H rows of W pixels.

    colour : (H, W, 4) uint8 sRGB and alpha, which is 255 where the body is seen and 0 elsewhere
    depth : (H, W) float32, distance along the ray, FIGURE units; infinite where nothing is hit
    parts : (H, W) int32, index into `Body.parts`; -1 where nothing is hit
    normals : (H, W, 3) float32, FIGURE; zeros where nothing is hit
    counts : work done
    """

    colour: ByteArray | None
    depth: FloatArray | None
    parts: IntArray | None
    normals: FloatArray | None
    counts: Counts


def render_frame(
    body: Body,
    camera: FrameCamera,
    *,
    colours: SurfaceColours | None = None,
    want: AbstractSet[str] = frozenset({"colour"}),
    tolerance: float = 1e-4,
) -> Frame:
    """Trace one frame.

    colours : of the surface; needed for "colour" only
    want : some of "colour", "depth", "parts", "normals". For each combination a kernel of its own is compiled at first
        use, in which the rest does not occur; and what is not wanted is not computed on the way either
    tolerance : as in `fig2mesh.field.trace.trace`, with which depths agree

    Raises ValueError for an unknown or empty `want`, and for "colour" without colours.
    """
    if not want or not want <= WANTS:
        raise ValueError(f"want: {sorted(want)}, expected some of {sorted(WANTS)}")
    if "colour" in want and colours is None:
        raise ValueError("colours: None, expected surface colours for a frame with colour")
    if not tolerance > 0:
        raise ValueError(f"tolerance: {tolerance}, expected a positive length")
    width, height = camera.size
    colour = np.empty((height, width, 4), np.uint8) if "colour" in want else None
    depth = np.empty((height, width), np.float32) if "depth" in want else None
    parts = np.empty((height, width), np.int32) if "parts" in want else None
    normals = np.empty((height, width, 3), np.float32) if "normals" in want else None
    colouring = colours.at(camera.pitch_units) if colours is not None and "colour" in want else None
    grids, space, view = body.grids, body.empty_space, camera.view()
    across, down = -(-width // TILE), -(-height // TILE)
    spans = np.empty((len(grids.sizes), down, across, 2), np.float32)
    run_blocks(lambda first, step: span_bricks(grids, space, view, first, step, spans), len(grids.sizes), 1)
    done: list[tuple[int, int, int, int]] = []

    def run(first: int, step: int) -> None:
        done.append(
            render_tiles(
                grids,
                space,
                view,
                spans,
                first,
                step,
                _TILES_AT_ONCE,
                float(tolerance),
                colouring,
                colour,
                depth,
                parts,
                normals,
            )
        )

    run_blocks(run, across * down, _TILES_AT_ONCE)
    counts = Counts(*(int(sum(column)) for column in zip(*done, strict=True)))
    return Frame(colour, depth, parts, normals, counts)
