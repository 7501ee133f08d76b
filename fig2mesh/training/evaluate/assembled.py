"""Whole figures against ground truth: synthetic bodies are drawn, their drawings converted, the results measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.field.body import Body
from fig2mesh.field.distance import grid_distance
from fig2mesh.image_frame import image_frame
from fig2mesh.mesh.isosurface import isosurface
from fig2mesh.records import Figure, Pose3D
from fig2mesh.skeleton import JOINT
from fig2mesh.training.bodies.pack import Pack
from fig2mesh.training.bodies.subject import Subject, draw_subject
from fig2mesh.training.drawing.scene import scene
from fig2mesh.training.samples.drawn_figure import drawn_joints
from fig2mesh.training.samples.sdf import signed_distance

PICTURE = 512
"""Pixels of the drawing's edge."""

SAMPLES = 8_000
"""Points per surface from which the chamfer distance is measured."""

SIDE_PIXEL = 0.006
"""Pixel of the silhouettes from the side, FIGURE units."""


@dataclass(frozen=True)
class GroundTruth:
    """A synthetic body in FIGURE, its front the drawing.

    figure : the drawing
    joints : (21, 3) float64, FIGURE
    parts : part label → vertices (N, 3) and faces (F, 3) of its closed solid
    points, normals : (SAMPLES, 3) on the body's skin
    """

    figure: Figure
    joints: NDArray[np.float64]
    parts: dict[int, tuple[NDArray[np.float64], NDArray[np.int32]]]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]


def ground_truth(subject: Subject, seed: int = 0) -> GroundTruth:
    """Draw a subject's front, and return it with the geometry; a skirt is not drawn."""
    bare = replace(subject, skirt_vertices=np.zeros((0, 3)), skirt_faces=np.zeros((0, 3), np.int32))
    _, labels, _, pitch = scene(bare, 0, PICTURE)
    joints_px, visible = drawn_joints(bare, PICTURE)
    mask = labels > 0
    rgba = np.zeros((PICTURE, PICTURE, 4), np.uint8)
    rgba[mask] = (200, 190, 170, 255)
    figure = Figure("synthetic", rgba, mask, joints_px, visible, np.zeros_like(labels))
    scale = image_frame(figure).units_per_px / pitch
    solids = {part.part: part.solid(subject.vertices * scale) for part in subject.parts}
    corners = (subject.vertices * scale)[subject.rig.faces]
    rng = np.random.default_rng(seed)
    return GroundTruth(figure, subject.joints * scale, solids, *_on_triangles(corners, rng))


@dataclass(frozen=True)
class Similarity:
    """Similarity of a surface to the true one.

    chamfer : mean distance, both ways averaged, FIGURE units
    normals : mean cosine between normals at nearest points, both ways averaged
    side_iou : intersection over union of the silhouettes seen from the figure's left
    shift : offset that was added to depths
    """

    chamfer: float
    normals: float
    side_iou: float
    shift: float


def similarity(body: Body, truth: GroundTruth, spacing: float = 0.012) -> Similarity:
    """Compare a body with the ground truth.

    A drawing does not determine the distance of its figure: the body is shifted to where the medians of depth agree,
    and of five shifts about that the one with the smallest chamfer distance is taken.
    """
    from scipy.spatial import cKDTree

    mesh = isosurface(body, spacing=spacing, project=False)
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    made, facing = _on_triangles(corners, np.random.default_rng(1))
    middle = float(np.median(truth.points[:, 2]) - np.median(made[:, 2]))
    tree = cKDTree(truth.points)
    best: tuple[float, float, float] = (np.inf, 0.0, 0.0)
    for extra in (-0.03, -0.015, 0.0, 0.015, 0.03):
        moved = made + [0.0, 0.0, middle + extra]
        there, near = tree.query(moved)
        back, nearest = cKDTree(moved).query(truth.points)
        cosines = (facing * truth.normals[near]).sum(axis=1), (truth.normals * facing[nearest]).sum(axis=1)
        found = float(there.mean() + back.mean()) / 2, float(cosines[0].mean() + cosines[1].mean()) / 2, middle + extra
        best = min(best, found)
    distance, normals, shift = best
    whole = np.concatenate([vertices[faces] for vertices, faces in truth.parts.values()])
    return Similarity(distance, normals, _side_iou(corners + [0.0, 0.0, shift], whole), shift)


def _side_iou(made: NDArray[np.float64], true: NDArray[np.float64]) -> float:
    """IoU of the silhouettes of two sets of triangles (N, 3, 3), seen along x."""
    import open3d

    tensor: Any = open3d.core.Tensor
    low = np.minimum(made.min(axis=(0, 1)), true.min(axis=(0, 1)))
    high = np.maximum(made.max(axis=(0, 1)), true.max(axis=(0, 1)))
    z, y = np.meshgrid(np.arange(low[2], high[2], SIDE_PIXEL), np.arange(low[1], high[1], SIDE_PIXEL))
    start = np.stack([np.full(z.shape, low[0] - 1.0), y, z], axis=-1)
    rays = np.concatenate([start, np.broadcast_to([1.0, 0.0, 0.0], start.shape)], axis=-1).astype(np.float32)
    seen = []
    for triangles in (made, true):
        scene = open3d.t.geometry.RaycastingScene()
        faces = np.arange(3 * len(triangles), dtype=np.uint32).reshape(-1, 3)
        scene.add_triangles(tensor(triangles.reshape(-1, 3).astype(np.float32)), tensor(faces))
        seen.append(scene.test_occlusions(tensor(rays)).numpy())
    return float((seen[0] & seen[1]).sum() / max(int((seen[0] | seen[1]).sum()), 1))


def part_ious(parts: Any, truth: GroundTruth, shift: float, nodes: int = 40) -> dict[int, float]:
    """Intersection over union of each true part's solid and the modelled one, on a grid about both.

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
class FigureScores:
    """Scores of a whole figure; similarity : of the surface; ious : by part label."""

    similarity: Similarity
    ious: dict[int, float]


METHODS = ("outline", "assembled", "plain union of the networks' parts")
"""Methods compared: the drawn outline and rules alone; the networks' depths in the drawn outline, as conversions do it;
and the networks' parts united as they are (paper §4.3)."""

TRUE_DEPTHS = "with true depths: "
"""Prefix of the same methods with given depths of the joints, which measure shapes without poses."""


def measure_methods(pack: Pack, split: str, seed: int) -> dict[str, FigureScores]:
    """Score one held-out figure by every method, with inferred and with true depths of its joints."""
    from fig2mesh.pose.network import lift_by_network
    from fig2mesh.pose.prior import lift

    truth = ground_truth(draw_subject(pack, split, seed))
    frame = image_frame(truth.figure)
    network = lift_by_network(truth.figure, frame)
    joints = network.joints.copy()
    joints[:, 2] = truth.joints[:, 2] - truth.joints[JOINT["pelvis"], 2]
    made = _bodies_by_method(truth, lift(truth.figure, frame), network)
    made |= {
        TRUE_DEPTHS + method: body for method, body in _bodies_by_method(truth, Pose3D(joints), Pose3D(joints)).items()
    }
    result = {}
    for method, body in made.items():
        found = similarity(body, truth)
        result[method] = FigureScores(found, part_ious(body.parts, truth, found.shift))
    return result


def _bodies_by_method(truth: GroundTruth, ruled: Pose3D, pose: Pose3D) -> dict[str, Body]:
    """Bodies by method; "outline" has joints by rule, the others have those of the network."""
    from fig2mesh.parts.canvas import make_canvas
    from fig2mesh.parts.network import part_inference
    from fig2mesh.parts.outline import outline_parts
    from fig2mesh.parts.split import split as divide
    from fig2mesh.settings import settings_for

    settings = settings_for("draft")
    canvas = make_canvas(truth.figure, image_frame(truth.figure), settings.canvas_px, settings.voxel)
    infer = part_inference(pose, settings.part_nodes)
    seen, voxel = truth.figure.visible, settings.voxel
    outline = outline_parts(canvas, ruled, seen, voxel=voxel)
    assembled = outline_parts(canvas, pose, seen, voxel=voxel, infer=infer)
    return {
        METHODS[0]: Body(outline.parts, fillets=outline.fillets),
        METHODS[1]: Body(assembled.parts, fillets=assembled.fillets),
        METHODS[2]: Body(infer(canvas, divide(canvas, pose.joints.astype(np.float64), seen))),
    }


def _on_triangles(
    corners: NDArray[np.float64], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(SAMPLES, 3) points spread over triangles (N, 3, 3), and the normals there."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    chosen = rng.choice(len(corners), SAMPLES, p=area / area.sum())
    points = np.einsum("nk,nkc->nc", rng.dirichlet((1.0, 1.0, 1.0), SAMPLES), corners[chosen])
    return points, across[chosen] / area[chosen, None]
