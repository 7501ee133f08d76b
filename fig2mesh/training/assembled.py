"""Whole figures against the truth: the drawing of a synthetic body goes down the road, what comes out is measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.body import Body
from fig2mesh.field.distance import grid_distance
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.parse.frame import image_frame
from fig2mesh.parts.kinds import anchor_joints
from fig2mesh.records import BODY_PARTS, JOINT_NAMES, Figure
from fig2mesh.training.pack import Pack
from fig2mesh.training.samples import scene
from fig2mesh.training.sdf import signed_distance
from fig2mesh.training.subject import Subject, draw_subject

PICTURE = 512
"""Pixels of the drawing's edge."""

SAMPLES = 8_000
"""Points a surface from which the chamfer distance is measured."""

TRUNK = {"head": (2,), "eyes": (2,), "neck": (1, 2), "thorax": (1,), "pelvis": (1,)}
"""Joint of the trunk → parts that show it."""


@dataclass(frozen=True)
class Truth:
    """A synthetic body as FIGURE has it when its front is the drawing.

    figure : the drawing
    joints : (21, 3) float64, FIGURE
    parts : part label → vertices (N, 3) and faces (F, 3) of its closed solid
    points : (SAMPLES, 3) on the body's skin
    """

    figure: Figure
    joints: NDArray[np.float64]
    parts: dict[int, tuple[NDArray[np.float64], NDArray[np.int32]]]
    points: NDArray[np.float64]


def truth_of(subject: Subject, seed: int = 0) -> Truth:
    """The drawing of a subject's front and what is behind it; what hangs free of the body is not drawn."""
    bare = replace(subject, skirt_vertices=np.zeros((0, 3)), skirt_faces=np.zeros((0, 3), np.int32))
    _, labels, corner, pitch = scene(bare, 0, PICTURE)
    columns = (subject.joints[:, 0] - corner[0]) / pitch
    rows = PICTURE - (subject.joints[:, 1] - corner[1]) / pitch
    showing = {name: set(TRUNK.get(name, ())) for name in JOINT_NAMES}
    for part in BODY_PARTS:
        for joint in anchor_joints(part):
            showing[JOINT_NAMES[joint]].add(part)
    seen = [
        labels[int(np.clip(r, 0, PICTURE - 1)), int(np.clip(c, 0, PICTURE - 1))] in showing[name]
        for name, r, c in zip(JOINT_NAMES, rows, columns, strict=True)
    ]
    mask = labels > 0
    rgba = np.zeros((PICTURE, PICTURE, 4), np.uint8)
    rgba[mask] = (200, 190, 170, 255)
    figure = Figure("synthetic", rgba, mask, np.stack([columns, rows], axis=1), np.array(seen), np.zeros_like(labels))
    scale = image_frame(figure).units_per_px / pitch
    solids = {part.part: part.solid(subject.vertices * scale) for part in subject.parts}
    corners = (subject.vertices * scale)[subject.rig.faces]
    rng = np.random.default_rng(seed)
    return Truth(figure, subject.joints * scale, solids, _on_triangles(corners, rng))


def chamfer(body: Body, truth: Truth, spacing: float = 0.012) -> tuple[float, float]:
    """Mean distance between the surfaces, both ways averaged, FIGURE units; and the depth shift that was taken out.

    A drawing says nothing of how far away its figure stands: it is shifted to where the medians of depth agree, and of
    five places about that the best is taken.
    """
    from scipy.spatial import cKDTree

    mesh = isosurface(body, spacing=spacing, project=False)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    made = _on_triangles(corners, np.random.default_rng(1))
    shift = float(np.median(truth.points[:, 2]) - np.median(made[:, 2]))
    best = (np.inf, 0.0)
    tree = cKDTree(truth.points)
    for extra in (-0.03, -0.015, 0.0, 0.015, 0.03):
        moved = made + [0.0, 0.0, shift + extra]
        there = tree.query(moved)[0].mean()
        back = cKDTree(moved).query(truth.points)[0].mean()
        best = min(best, (float(there + back) / 2, shift + extra))
    return best


def part_ious(parts: Any, truth: Truth, shift: float, nodes: int = 40) -> dict[int, float]:
    """Intersection over union of each true part's solid and what was made of it, on a grid about both.

    parts : `PartSdf` records; several of one label count together
    """
    result = {}
    for label, (vertices, faces) in truth.parts.items():
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        own = [part for part in parts if part.part == label]
        for part in own:
            low = np.minimum(low, part.origin + [0, 0, shift])
            high = np.maximum(high, part.origin + part.edge + [0, 0, shift])
        axes = [np.linspace(a, b, nodes) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        there = signed_distance(vertices, faces, grid) < 0
        made = np.zeros(len(grid), bool)
        for part in own:
            made |= grid_distance(part, grid - [0.0, 0.0, shift]) < 0
        union = (there | made).sum()
        result[label] = float((there & made).sum() / union) if union else 1.0
    return result


@dataclass(frozen=True)
class Measured:
    """chamfer : FIGURE units; ious : by part label."""

    chamfer: float
    ious: dict[int, float]


ROADS = ("outline", "networks", "plain union of the networks' parts")
"""What is compared: the drawn outline and rules alone; the networks with the drawn outline; and the networks' parts put
together as they are (paper §4.3)."""


def measure_roads(pack: Pack, split: str, seed: int) -> dict[str, Measured]:
    """One held-out figure down every road."""
    from fig2mesh.parts.canvas import make_canvas
    from fig2mesh.parts.network import part_inference
    from fig2mesh.parts.outline import outline_parts
    from fig2mesh.parts.split import split as divide
    from fig2mesh.pose.network import lift_by_network
    from fig2mesh.pose.prior import lift
    from fig2mesh.settings import settings_for

    settings = settings_for("draft")
    truth = truth_of(draw_subject(pack, split, seed))
    frame = image_frame(truth.figure)
    canvas = make_canvas(truth.figure, frame, settings.canvas_px, 0.9 * settings.voxel)
    pose = lift_by_network(truth.figure, frame)
    infer = part_inference(pose, settings.part_nodes)
    seen, voxel = truth.figure.visible, settings.voxel
    made = dict(
        zip(
            ROADS,
            (
                outline_parts(canvas, lift(truth.figure, frame), seen, voxel=voxel).parts,
                outline_parts(canvas, pose, seen, voxel=voxel, infer=infer).parts,
                infer(canvas, divide(canvas, pose.joints.astype(np.float64), seen)),
            ),
            strict=True,
        )
    )
    result = {}
    for road, parts in made.items():
        distance, shift = chamfer(Body(parts), truth)
        result[road] = Measured(distance, part_ious(parts, truth, shift))
    return result


def _on_triangles(corners: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = corners[rng.choice(len(corners), SAMPLES, p=area / area.sum())]
    return np.asarray(np.einsum("nk,nkc->nc", rng.dirichlet((1.0, 1.0, 1.0), SAMPLES), chosen))
