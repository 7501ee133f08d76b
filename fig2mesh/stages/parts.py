"""Stage `parts`: part masks and joints into part fields with the drawn outline (paper §4.2-4.3)."""

from __future__ import annotations

from fig2mesh.image_frame import image_frame
from fig2mesh.parts.canvas import make_canvas
from fig2mesh.parts.network import part_inference
from fig2mesh.parts.outline import Outline, outline_parts
from fig2mesh.records import Figure, Pose3D
from fig2mesh.settings import Parts, Precision


def parts(
    figure: Figure,
    lift: Pose3D,
    *,
    parts: Parts,
    canvas_px: int,
    voxel: float,
    part_nodes: int,
    precision: Precision,
    device: str,
) -> Outline:
    """Signed distance fields of the parts; their depth is inferred by networks, or by rules."""
    canvas = make_canvas(figure, image_frame(figure), canvas_px, voxel)
    infer = None if parts == "outline" else part_inference(lift, part_nodes, device, precision)
    return outline_parts(canvas, lift, figure.visible, voxel=voxel, device=device, infer=infer)
