"""Contents of the page of one figure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fig2mesh.asset_frame import asset_from_figure
from fig2mesh.field.body import Body
from fig2mesh.image_frame import ImageFrame
from fig2mesh.records import FloatArray, Pose3D
from fig2mesh.texture.sources import Sources
from fig2mesh.view.colour_atlas import ColourAtlas, DepthMap, colour_atlas, depth_map
from fig2mesh.view.field_atlas import FieldAtlas, field_atlas

LINE_COLOUR = (32.0, 30.0, 32.0)
LINE_WIDTH = 0.009
"""Width of outlines if the drawing has no contours, FIGURE units."""


@dataclass(frozen=True)
class ViewScene:
    """A figure as textures and numbers.

    slots : for each brick, the slot of `colours` for its unseen sides
    pen : colour 0-255 and width in FIGURE units of the drawing's contours; None where it has none
    grazing : minimum z of a normal that the drawing colours
    contours : whether the drawing's own contours are on the surface
    bounds : (2, 3) FIGURE; feet : (3,) FIGURE, on the ground between the feet
    metres_per_unit : of the figure on the globe
    """

    name: str
    field: FieldAtlas
    colours: ColourAtlas
    depth: DepthMap
    slots: tuple[int, ...]
    pen: tuple[tuple[float, ...], float] | None
    grazing: float
    contours: bool
    bounds: FloatArray
    feet: NDArray[np.float64]
    metres_per_unit: float


def make_scene(
    name: str, body: Body, sources: Sources, frame: ImageFrame, pose: Pose3D, height_m: float, contours: bool = True
) -> ViewScene:
    """Make the scene of a figure `height_m` high, from the stage results `body` and `sources`."""
    field, bounds = field_atlas(body), body.bounds()
    colours = colour_atlas(sources, frame, body)
    asset = asset_from_figure(pose, bounds, height_m)
    labels = [int(body.labels[brick.owners[0]]) for brick in field.bricks]
    pen = None
    if sources.pen is not None:
        pen = (tuple(float(c) for c in sources.pen.colour), float(sources.pen.width))
    return ViewScene(
        name=name,
        field=field,
        colours=colours,
        depth=depth_map(body),
        slots=tuple(colours.slot_of_label.get(label, colours.default) for label in labels),
        pen=pen,
        grazing=sources.grazing,
        contours=contours and pen is not None,
        bounds=bounds,
        feet=asset.inverse().apply(np.zeros((1, 3)))[0],
        metres_per_unit=float(asset.matrix[0, 0]),
    )
