"""Depth of the joints by the network of paper §4.1; x and y stay as drawn."""

from __future__ import annotations

import numpy as np

from fig2mesh.parse.frame import ImageFrame
from fig2mesh.records import Figure, Pose3D


def lift_by_network(figure: Figure, frame: ImageFrame) -> Pose3D:
    """Joints in FIGURE: x and y exactly as drawn, z from the shipped network, 0 at the pelvis."""
    from fig2mesh.nets.pose_lift import lift_joints, load

    drawn = frame.figure_from_image(figure.joints_px)
    net = load()
    return Pose3D(lift_joints(net, np.asarray(drawn, np.float32), figure.visible if net.shape.visibility else None))
