"""Hard figures: written to files, run through the main job, and what came of it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from fig2mesh.commands.main import main
from fig2mesh.field.body import Body
from fig2mesh.image_frame import image_frame
from fig2mesh.mesh.solid import make_solid
from fig2mesh.parts.canvas import make_canvas
from fig2mesh.parts.outline import outline_parts
from fig2mesh.pose.prior import lift
from fig2mesh.records import Figure
from fig2mesh.settings import PRESETS
from fig2mesh.skeleton import JOINT_NAMES
from tests.drawn import JOINTS, SIZE, Assembled, draw_figure

SKIN = (200, 160, 140, 255)

FAST = ("--quality", "draft", "--parts", "outline", "--mesher", "isosurface", "--triangles", "1000")
SMALL = ("--texture-size", "64", "-q")


def joints_on(width: int, height: int, visible: int = 1) -> dict[str, Any]:
    """The joints of the drawn figure, stretched over a picture."""
    return {name: [x / SIZE[0] * width, y / SIZE[1] * height, visible] for name, (x, y) in JOINTS.items()}


def painted(mask: NDArray[np.bool_], colour: tuple[int, ...] = SKIN) -> NDArray[np.uint8]:
    """(H, W, 4) one colour where the mask is, nothing elsewhere."""
    return np.where(mask[..., None], np.array(colour, np.uint8), np.uint8(0))


def drawn_mask(scale: int = 1) -> NDArray[np.bool_]:
    return np.asarray(draw_figure(scale))[..., 3] > 127


def figure_of(mask: NDArray[np.bool_], joints: dict[str, Any] | None = None) -> Figure:
    """A record without files; joints : as in `joints_on`"""
    values = np.array([(joints or joints_on(*mask.shape[::-1]))[name] for name in JOINT_NAMES], np.float32)
    labels = np.zeros(mask.shape, np.uint8)
    return Figure("hard", painted(mask), mask, values[:, :2], values[:, 2] > 0, labels)


def solid_of(figure: Figure, pieces: int = 1) -> Assembled:
    """The solid that draft makes of a figure without networks, crumbs left out as the main job does."""
    draft = PRESETS["draft"]
    frame = image_frame(figure)
    pose = lift(figure, frame)
    canvas = make_canvas(figure, frame, draft.canvas_px, draft.voxel)
    outline = outline_parts(canvas, pose, figure.visible, voxel=draft.voxel)
    body = Body(outline.parts, fillets=outline.fillets)
    return Assembled(
        figure,
        frame,
        pose,
        outline,
        body,
        make_solid(None, body, pieces, spacing=draft.spacing, closing=draft.closing).mesh,
    )


@dataclass(frozen=True)
class Outcome:
    """code : of the command; error : what it wrote to stderr; report : of a run that succeeded, else empty"""

    code: int
    error: str
    report: dict[str, Any]
    output: Path

    @property
    def measures(self) -> dict[str, Any]:
        return dict(self.report["measures"])


@dataclass(frozen=True)
class Job:
    """Runs the main job in an empty folder."""

    folder: Path
    capture: pytest.CaptureFixture[str]

    def __call__(
        self,
        picture: NDArray[np.uint8],
        joints: dict[str, Any] | str | None = None,
        *options: str,
        mask: NDArray[np.bool_] | None = None,
    ) -> Outcome:
        """joints : as in `joints_on`, the text of the file, or None for those of the drawn figure"""
        figure, keypoints = self.folder / "figure.png", self.folder / "joints.json"
        Image.fromarray(picture).save(figure)
        if mask is not None:
            Image.fromarray(np.where(mask, np.uint8(255), np.uint8(0))).save(self.folder / "mask.png")
            options = (*options, "--mask", str(self.folder / "mask.png"))
        height, width = picture.shape[:2]
        places = joints_on(width, height) if joints is None else joints
        keypoints.write_text(places if isinstance(places, str) else json.dumps({"keypoints": places}))
        return self.run(figure, keypoints, *options)

    def run(self, figure: Path, keypoints: Path, *options: str) -> Outcome:
        output, report = self.folder / "made.glb", self.folder / "report.json"
        before = {path: path.read_bytes() for path in sorted(self.folder.rglob("*"))}
        arguments = [str(figure), "--keypoints", str(keypoints), "-o", str(output), "--report", str(report)]
        code = main([*arguments, *FAST, *SMALL, *options])
        error = self.capture.readouterr().err
        if code != 0:
            after = {path: path.read_bytes() for path in sorted(self.folder.rglob("*"))}
            assert after == before, "a run that fails writes nothing"
            return Outcome(code, error, {}, output)
        return Outcome(code, error, json.loads(report.read_text()), output)


def refused(outcome: Outcome, *words: str) -> None:
    """One line that names the input and the finding; exit code 2; nothing written (`Job` has checked)."""
    assert outcome.code == 2, outcome.error
    assert outcome.error.startswith("fig2mesh: ")
    assert outcome.error.count("\n") == 1
    for word in words:
        assert word in outcome.error


def stick_figure(width: int = 1, head: float = 0.2) -> NDArray[np.bool_]:
    """A giant head on limbs of `width` pixels, 600 pixels high; head : its radius as a share of that."""
    joints = {name: (2.0 * x, 2.0 * y) for name, (x, y) in JOINTS.items()}
    image = Image.new("L", (400, 600))
    pen = ImageDraw.Draw(image)
    chains = [("neck", "thorax", "pelvis"), ("l_shoulder", "thorax", "r_shoulder"), ("l_hip", "pelvis", "r_hip")]
    for side in "lr":
        chains.append(tuple(f"{side}_{joint}" for joint in ("hip", "knee", "ankle", "foot")))
        chains.append(tuple(f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist", "hand")))
    for chain in chains:
        pen.line([joints[name] for name in chain], fill=255, width=width)
    radius = head * 600
    x, bottom = joints["neck"]
    pen.ellipse((x - radius, bottom + 4 - 1.4 * radius, x + radius, bottom + 4), fill=255)
    return np.asarray(image) > 0
