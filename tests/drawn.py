"""A small drawn figure made of thick lines and discs, for tests that need a picture but no artist."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from fig2mesh.field.body import Body
from fig2mesh.image_frame import ImageFrame, image_frame
from fig2mesh.measure.front import thickness_at
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.parts.canvas import make_canvas
from fig2mesh.parts.outline import Outline, outline_parts
from fig2mesh.pose.prior import lift
from fig2mesh.records import Figure, Mesh, Pose3D
from fig2mesh.skeleton import JOINT, JOINT_NAMES

# fmt: off
JOINTS = {
    "head": (100, 40), "eyes": (100, 36), "neck": (100, 68), "thorax": (100, 90), "pelvis": (100, 160),
    "l_shoulder": (122, 82), "r_shoulder": (78, 82), "l_elbow": (150, 112), "r_elbow": (50, 112),
    "l_wrist": (172, 142), "r_wrist": (28, 142), "l_hand": (178, 150), "r_hand": (22, 150),
    "l_hip": (113, 165), "r_hip": (87, 165), "l_knee": (122, 220), "r_knee": (78, 220),
    "l_ankle": (126, 272), "r_ankle": (74, 272), "l_foot": (134, 282), "r_foot": (66, 282),
}
# fmt: on
"""IMAGE pixels on a picture of 200 x 300; a figure from the front, arms and legs apart."""

SIZE = (200, 300)


@dataclass(frozen=True)
class DrawnFiles:
    """Paths of one drawn figure."""

    image: Path
    mask: Path
    keypoints: Path


def draw_figure(scale: int = 2) -> Image.Image:
    """An RGBA picture of the figure: red shirt, blue trousers, black shoes, a green glove on the left hand."""
    image = Image.new("RGBA", (SIZE[0] * scale, SIZE[1] * scale), (0, 0, 0, 0))
    pen = ImageDraw.Draw(image)

    def line(names: tuple[str, ...], width: float, colour: tuple[int, int, int]) -> None:
        points = [tuple(scale * c for c in JOINTS[name]) for name in names]
        pen.line(points, fill=colour, width=int(width * scale))
        for x, y in points:
            r = width * scale / 2
            pen.ellipse((x - r, y - r, x + r, y + r), fill=colour)

    skin, shirt, trousers, shoes = (230, 180, 150), (200, 40, 40), (40, 60, 170), (30, 30, 30)
    glove = {"l": (40, 160, 60), "r": skin}
    for side in "lr":
        line((f"{side}_hip", f"{side}_knee", f"{side}_ankle"), 22, trousers)
        line((f"{side}_ankle", f"{side}_foot"), 16, shoes)
        line((f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"), 18, shirt)
        line((f"{side}_wrist", f"{side}_hand"), 17, glove[side])
    outline = [JOINTS[name] for name in ("l_shoulder", "r_shoulder", "r_hip", "l_hip")]
    pen.polygon([(scale * x, scale * y) for x, y in outline], fill=shirt)
    line(("neck", "thorax", "pelvis"), 44, shirt)
    line(("neck", "head"), 18, skin)
    x, y = (scale * c for c in JOINTS["head"])
    r = 26 * scale
    pen.ellipse((x - r, y - r, x + r, y + r), fill=skin)
    return image


def keypoints(scale: int = 2) -> dict[str, object]:
    """The joints in the format of `--keypoints`."""
    joints = {name: [scale * x, scale * y, 1] for name, (x, y) in JOINTS.items()}
    return {"width": SIZE[0] * scale, "height": SIZE[1] * scale, "keypoints": joints}


def write_figure(folder: Path, scale: int = 2, name: str = "drawn") -> DrawnFiles:
    """Write image, mask and joints into `folder`."""
    image = draw_figure(scale)
    files = DrawnFiles(folder / f"{name}.png", folder / f"{name}_mask.png", folder / f"{name}.json")
    image.save(files.image)
    Image.fromarray(np.where(np.asarray(image)[..., 3] >= 128, np.uint8(255), np.uint8(0))).save(files.mask)
    files.keypoints.write_text(json.dumps(keypoints(scale)))
    return files


Point = tuple[float, float]

CHAINS = (
    ("neck", "head"),
    ("thorax", "pelvis"),
    *((f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist", f"{side}_hand") for side in "lr"),
    *((f"{side}_hip", f"{side}_knee", f"{side}_ankle", f"{side}_foot") for side in "lr"),
)
BONES = tuple(bone for chain in CHAINS for bone in pairwise(chain))
"""Pairs of joints between which a body has to be solid."""


class Sketch:
    """A silhouette of capsules, discs and polygons on a picture of 200 x 300 pixels, drawn `SCALE` times as large.

    joints : (x, y) by name, changed from `JOINTS` as the pose wants it
    """

    SCALE = 2

    def __init__(self, **joints: Point) -> None:
        self.joints: dict[str, Point] = {**JOINTS, **joints}
        self.image = Image.new("L", (SIZE[0] * self.SCALE, SIZE[1] * self.SCALE))
        self.pen = ImageDraw.Draw(self.image)

    def place(self, at: str | Point) -> Point:
        return self.joints[at] if isinstance(at, str) else at

    def disc(self, at: str | Point, radius: float, *, ink: int = 255) -> Sketch:
        (x, y), s = self.place(at), self.SCALE
        self.pen.ellipse(((x - radius) * s, (y - radius) * s, (x + radius) * s, (y + radius) * s), fill=ink)
        return self

    def capsules(self, *chain: str | Point, width: float) -> Sketch:
        """Thick lines with round ends along joints (names) or points."""
        corners = [self.place(at) for at in chain]
        self.pen.line([(x * self.SCALE, y * self.SCALE) for x, y in corners], fill=255, width=round(width * self.SCALE))
        for corner in corners:
            self.disc(corner, width / 2)
        return self

    def polygon(self, *corners: str | Point, ink: int = 255) -> Sketch:
        places = [self.place(corner) for corner in corners]
        self.pen.polygon([(x * self.SCALE, y * self.SCALE) for x, y in places], fill=ink)
        return self

    def legs(self, width: float = 22) -> Sketch:
        for side in "lr":
            self.capsules(f"{side}_hip", f"{side}_knee", f"{side}_ankle", width=width)
            self.capsules(f"{side}_ankle", f"{side}_foot", width=0.73 * width)
        return self

    def arms(self, sides: str = "lr", width: float = 18) -> Sketch:
        for side in sides:
            self.capsules(*(f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist", "hand")), width=width)
        return self

    def trunk(self) -> Sketch:
        self.polygon("l_shoulder", "r_shoulder", "r_hip", "l_hip")
        return self.capsules("neck", "thorax", "pelvis", width=44)

    def head(self, radius: float = 26) -> Sketch:
        return self.capsules("neck", "head", width=18).disc("head", radius)

    def figure(self, name: str = "sketch", hidden: Iterable[str] = ()) -> Figure:
        """hidden : joints that the drawing does not show"""
        mask = np.asarray(self.image) > 127
        rgba = np.where(mask[..., None], np.array([200, 160, 140, 255], np.uint8), np.uint8(0))
        joints = self.SCALE * np.array([self.joints[joint] for joint in JOINT_NAMES], np.float32)
        visible = ~np.isin(JOINT_NAMES, list(hidden))
        return Figure(name, rgba, mask, joints, visible, np.zeros(mask.shape, np.uint8))


@dataclass(frozen=True)
class Assembled:
    """A drawn figure, converted without networks: its parts, the body that they make, the body's surface.

    mesh : FIGURE, whose units are the metres of a figure 1.79 m high
    """

    figure: Figure
    frame: ImageFrame
    pose: Pose3D
    outline: Outline
    body: Body
    mesh: Mesh

    def at(self, *places: Point) -> NDArray[np.float64]:
        """(N, 2) FIGURE x, y of points given in pixels of the sketch."""
        return self.frame.figure_from_image(np.array(places) * Sketch.SCALE)

    def length(self, pixels: float) -> float:
        """FIGURE units of a length given in pixels of the sketch."""
        return pixels * Sketch.SCALE * self.frame.units_per_px

    def thickness(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(...) what the solid covers of the lines of sight through (..., 2) FIGURE x, y."""
        return thickness_at(self.mesh, points.reshape(-1, 2)).reshape(points.shape[:-1])

    def side(self) -> Mesh:
        """The solid turned so that its left side is the front: x is what was z."""
        return Mesh(self.mesh.vertices[:, [2, 1, 0]] * np.array([1, 1, -1], np.float32), self.mesh.faces)

    def front_iou(self) -> float:
        """Overlap of the solid's silhouette with the drawing, at every second pixel of the picture."""
        rows, columns = np.mgrid[0 : self.figure.mask.shape[0] : 2, 0 : self.figure.mask.shape[1] : 2]
        points = self.frame.figure_from_image(np.stack([columns + 0.5, rows + 0.5], axis=-1))
        solid, drawn = self.thickness(points) > 0, self.figure.mask[rows, columns]
        return float((solid & drawn).sum() / (solid | drawn).sum())

    def slab(self, top: float, bottom: float) -> NDArray[np.float32]:
        """(N, 3) vertices of the solid between two rows of the sketch."""
        y = self.mesh.vertices[:, 1]
        high, low = self.at((0, top), (0, bottom))[:, 1]
        return np.asarray(self.mesh.vertices[(low <= y) & (y <= high)])

    def bone_points(self, count: int = 12) -> NDArray[np.float64]:
        """(B, count, 3) FIGURE points along the bones of the pose."""
        joints = self.pose.joints.astype(np.float64)
        ends = np.array([[joints[JOINT[a]], joints[JOINT[b]]] for a, b in BONES])
        share = np.linspace(0.0, 1.0, count)[:, None]
        return np.asarray(ends[:, :1] + share * (ends[:, 1:] - ends[:, :1]))


def assemble(
    figure: Figure,
    depths: Mapping[str, float] | None = None,
    *,
    canvas_px: int = 256,
    voxel: float = 0.012,
    infer: Any = None,
) -> Assembled:
    """The figure as a solid, without networks.

    depths : FIGURE z of joints, by name, in place of what the rules guess
    infer : as in `outline_parts`
    """
    frame = image_frame(figure)
    joints = lift(figure, frame).joints.copy()
    for name, depth in (depths or {}).items():
        joints[JOINT[name], 2] = depth
    pose = Pose3D(joints)
    canvas = make_canvas(figure, frame, canvas_px, voxel)
    outline = outline_parts(canvas, pose, figure.visible, voxel=voxel, infer=infer)
    body = Body(outline.parts, fillets=outline.fillets)
    return Assembled(figure, frame, pose, outline, body, isosurface(body, spacing=voxel))
