"""Frames: pictures of a body, traced pixel by pixel in one pass, with only the requested channels.

The cost of a frame lies in the pixels that show the body. Before rays are traced, the bricks that contain the surface
(`field.empty_space`) are projected onto the tiles of the picture. Each tile then has a list of the parts that it may
show and their depth ranges, so that rays start next to the surface and empty tiles cost nothing. Use `field.trace` for
rays that do not start at a camera, such as those towards a lamp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fig2mesh import counters
from fig2mesh.field.body import Body
from fig2mesh.field.camera import Camera
from fig2mesh.field.compiled import run_blocks, sealed
from fig2mesh.records import FloatArray, IntArray
from fig2mesh.render.frame_kernel import TILE, Window, render_tiles, span_bricks

_TILES_AT_ONCE = 4


@dataclass(frozen=True)
class RenderedFrame:
    """H rows of W pixels, and counts of the work done for them.

    depth : (H, W) float32, distance along the ray, FIGURE units; infinite where nothing is hit
    parts : (H, W) int32, index into `Body.parts`, -1 where nothing is hit; None if not requested
    normals : (H, W, 3) float32, FIGURE, zeros where nothing is hit; None if not requested
    rays : number traced; pixels of tiles without the body need none
    cells : number visited, as `Hits.steps`
    normals_computed : number of normals
    """

    depth: FloatArray
    parts: IntArray | None
    normals: FloatArray | None
    rays: int
    cells: int
    normals_computed: int


def render_frame(
    body: Body,
    camera: Camera,
    rows: tuple[int, int] | None = None,
    *,
    with_parts: bool = False,
    with_normals: bool = False,
    tolerance: float = 1e-4,
) -> RenderedFrame:
    """Trace a camera's picture, or its rows from the first to before the last.

    with_parts, with_normals : channels to compute; for each combination a separate kernel is compiled at first use
    tolerance : as in `fig2mesh.field.trace.trace`, whose depths agree with these
    """
    if not tolerance > 0:
        raise ValueError(f"tolerance: {tolerance}, expected a positive length")
    window = _window(camera, rows or (0, camera.size[1]))
    shape = (window.rows, window.columns)
    depth = np.empty(shape, np.float32)
    parts = np.empty(shape, np.int32) if with_parts else None
    normals = np.empty((*shape, 3), np.float32) if with_normals else None
    grids, space = body.grids, body.empty_space
    across, down = -(-window.columns // TILE), -(-window.rows // TILE)
    spans = np.empty((len(grids.sizes), down, across, 2), np.float32)
    run_blocks(lambda first, step: span_bricks(grids, space, window, first, step, spans), len(grids.sizes), 1)
    done: list[tuple[int, int, int]] = []

    def run(first: int, step: int) -> None:
        done.append(
            render_tiles(
                grids, space, window, spans, first, step, _TILES_AT_ONCE, float(tolerance), depth, parts, normals
            )
        )

    run_blocks(run, across * down, _TILES_AT_ONCE)
    rays, cells, computed = (int(sum(column)) for column in zip(*done, strict=True))
    counters.count("rays", rays)
    return RenderedFrame(depth, parts, normals, rays, cells, computed)


def _window(camera: Camera, rows: tuple[int, int]) -> Window:
    """Window of a picture's rows, for the kernels."""
    width, height = camera.size
    if not 0 <= rows[0] < rows[1] <= height:
        raise ValueError(f"rows: {rows}, expected some of the {height} of the picture")
    origin, direction = camera.steps()
    return Window(
        width,
        rows[1] - rows[0],
        rows[0],
        0.5 * width - 0.5,
        0.5 * height - 0.5 - rows[0],
        sealed(origin, np.float64),
        sealed(direction, np.float64),
        sealed(camera.start, np.float64),
        sealed(camera.axes, np.float64),
        float(camera.pixel),
        float(camera.distance),
        bool(camera.perspective),
    )
