"""Stage `lift`: 3D joints from the drawn ones (paper §4.1)."""

from __future__ import annotations

from fig2mesh.image_frame import image_frame
from fig2mesh.pose.network import lift_by_network
from fig2mesh.pose.order import ordered
from fig2mesh.pose.prior import lift as lift_by_rule
from fig2mesh.records import Figure, Pose3D
from fig2mesh.settings import Parts


def lift(figure: Figure, *, parts: Parts) -> Pose3D:
    """Joints in FIGURE, with the depth order given in the figure."""
    infer = lift_by_rule if parts == "outline" else lift_by_network
    return ordered(infer(figure, image_frame(figure)), figure.depth_order)
