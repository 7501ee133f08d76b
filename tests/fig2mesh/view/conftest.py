"""A figure of formulas as a page, and a browser to look at it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fig2mesh.field.analytic import MANNEQUIN, mannequin
from fig2mesh.field.body import Body
from fig2mesh.image_frame import ImageFrame
from fig2mesh.records import Pose3D
from fig2mesh.skeleton import JOINT, PART
from fig2mesh.texture.pen import Pen
from fig2mesh.texture.sources import Sources
from fig2mesh.view.page import view_page
from fig2mesh.view.scene import ViewScene, make_scene


@dataclass(frozen=True)
class Painted:
    """A body, what colours it, and the scene made of them."""

    body: Body
    sources: Sources
    frame: ImageFrame
    scene: ViewScene


@pytest.fixture(scope="session")
def painted() -> Painted:
    """The mannequin with melting shoulders, drawn in stripes and dots; its unseen sides are plain."""
    parts = mannequin(40)
    torso, *arms = (
        next(i for i, part in enumerate(parts) if part.part == PART[name])
        for name in ("torso", "l_upper_arm", "r_upper_arm")
    )
    body = Body(parts, smooth=tuple((torso, arm, 0.06) for arm in arms))
    frame = ImageFrame((80.0, 100.0), 1.79 / 180)
    rows, columns = np.mgrid[0:200, 0:160]
    stripes = ((rows // 9) % 2)[..., None]
    seen = np.where(stripes, [210, 60, 40], [240, 220, 170]) + (columns[..., None] - 80) * [0.0, 0.4, 0.8]
    head, rest = np.full((100, 80, 3), (90.0, 60.0, 30.0)), np.full((100, 80, 3), (40.0, 90.0, 190.0))
    rest[60:] = (60, 140, 60)
    plain = {part.part: rest for part in parts} | {PART["head"]: head}
    pen = Pen(np.array([20, 10, 30], np.float32), 0.02, np.zeros((1, 1), bool))
    pictures = {label: picture.astype(np.float32) for label, picture in plain.items()}
    pictures |= dict.fromkeys((label for label in plain if label != PART["head"]), pictures[PART["torso"]])
    sources = Sources(np.clip(seen, 0, 255).astype(np.float32), pictures, 0.5, pen)
    joints = np.zeros((21, 3), np.float32)
    for side in "lr":
        joints[JOINT[f"{side}_ankle"]], joints[JOINT[f"{side}_foot"]] = MANNEQUIN[f"{side}_foot"][:2]
    scene = make_scene("Mannequin & <friend>", body, sources, frame, Pose3D(joints), 1.79)
    return Painted(body, sources, frame, scene)


@pytest.fixture(scope="session")
def page(painted: Painted, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("view") / "page.html"
    path.write_text(view_page(painted.scene), encoding="utf-8")
    return path
