"""Drawn pictures of a subject from its four sides, with labels, depths and texture coordinates of the pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.skeleton import JOINT, PART
from fig2mesh.training.bodies.garments import vertex_normals
from fig2mesh.training.bodies.subject import Subject
from fig2mesh.training.drawing.background import draw_background
from fig2mesh.training.drawing.draw import Layers, draw
from fig2mesh.training.drawing.faces import Face
from fig2mesh.training.drawing.raster import Raster
from fig2mesh.training.drawing.scene import VIEWS, scene
from fig2mesh.training.drawing.styles import random_style

SIZE = 256
"""Pixels of a picture's edge; §4.3 works at this size."""

SHRINK = 2
"""Factor by which pictures are drawn larger, for smooth edges."""

EYES_APART = 0.43
"""Distance of an eye from the middle between them, relative to that of the eyes from the head's centre."""

MOUTH_BELOW = 0.95


def draw_views(subject: Subject, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    """Draw picture (4, 256, 256, 3) uint8, labels (4, 256, 256) uint8, depth (4, 256, 256) float16 (VIEW z, -inf where
    nothing), uv (4, 256, 256, 2) float16 (zeros where the body has no texture coordinates)."""
    materials = [*subject.rig.materials, "cloth.skirt"]
    colours = None
    if subject.colours is not None and rng.random() < 0.3:
        colours = np.concatenate([subject.colours, rng.uniform(0, 1, (1, 3))]) * 255
    style = random_style(materials, rng, colours)
    # One sheet for all sides: through glazes, and where nothing is filled, it gives figures their colours.
    paper = draw_background(style.background, (SIZE * SHRINK, SIZE * SHRINK), rng)
    out: dict[str, list[NDArray[Any]]] = {"picture": [], "labels": [], "depth": [], "uv": []}
    for view in range(4):
        raster, labels, corner, pitch = scene(subject, view, SIZE * SHRINK)
        layers, uv = view_layers(subject, view, raster, labels)
        face = view_face(subject.joints @ VIEWS[view].T, corner, pitch)
        out["picture"].append(draw(layers, materials, rng, style=style, face=face, shrink=SHRINK, paper=paper))
        middle = np.s_[SHRINK // 2 :: SHRINK, SHRINK // 2 :: SHRINK]
        out["labels"].append(labels[middle])
        out["depth"].append(raster.depth[middle].astype(np.float16))
        out["uv"].append(uv[middle].astype(np.float16))
    return {name: np.stack(images) for name, images in out.items()}


def view_layers(
    subject: Subject, view: int, raster: Raster, labels: NDArray[np.uint8]
) -> tuple[Layers, NDArray[np.float32]]:
    """Layers of a view, and texture coordinates; bodies without any are patterned by their rest pose."""
    body, skirt = subject.vertices @ VIEWS[view].T, subject.skirt_vertices @ VIEWS[view].T
    vertices = np.concatenate([body, skirt])
    faces = np.concatenate([subject.rig.faces, subject.skirt_faces + len(body)])
    count = len(subject.rig.materials)
    material = np.concatenate([subject.rig.face_material.astype(np.int32), np.full(len(subject.skirt_faces), count)])
    normals = raster.blend(vertex_normals(vertices, faces), faces)
    # The inside of a skirt is visible too, and its normals point away.
    normals = np.where(normals[..., 2:] < 0, -normals, normals)
    hanging = np.zeros((len(subject.skirt_faces), 3, 2), np.float32)
    real = _corner_blend(raster, np.concatenate([subject.uv, hanging]))
    rest = np.concatenate([subject.rig.vertices, subject.skirt_vertices * [1, 1, 1] + [0, 1, 0]]).astype(np.float32)
    flat = np.stack([0.5 + 0.28 * (rest[:, 0] + 0.7 * rest[:, 2]), 1.0 - rest[:, 1] / 1.9], axis=1)
    made = raster.blend(flat, faces)
    pattern = made if not subject.uv.any() else np.where((labels == PART["garment"])[..., None], made, real)
    return Layers(labels, raster.pick(material, -1), pattern, raster.depth, normals), real


def _corner_blend(raster: Raster, corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, 2) values at the faces' corners (F, 3, 2), interpolated; zeros where no face is visible."""
    out = np.zeros((*raster.face.shape, 2), np.float32)
    seen = raster.mask
    out[seen] = np.einsum("nc,ncd->nd", raster.bary[seen], corners[raster.face[seen]])
    return out


def view_face(
    joints: NDArray[np.float64], corner: NDArray[np.float64], pitch: float, size: int = SIZE * SHRINK
) -> Face | None:
    """Eyes and mouth in pixels of a picture of edge `size`; None where the face is turned away."""
    head, eyes, neck = (joints[JOINT[name]] for name in ("head", "eyes", "neck"))
    forward = eyes - head
    reach = float(np.linalg.norm(forward))
    if reach < 1e-6 or forward[2] < 0.15 * reach:
        return None
    forward = forward / reach
    up = head - neck
    up = up - forward * (up @ forward)
    up = up / max(float(np.linalg.norm(up)), 1e-9)
    across = np.cross(up, forward)

    def pixel(point: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([(point[0] - corner[0]) / pitch, size - (point[1] - corner[1]) / pitch])

    both = [eyes + side * EYES_APART * reach * across for side in (-1.0, 1.0)]
    # Of a face in profile only the nearer eye is drawn.
    if abs(forward[0]) > 0.75:
        both = [max(both, key=lambda eye: float(eye[2]))]
    mouth = eyes - MOUTH_BELOW * reach * up
    return Face(np.array([pixel(eye) for eye in both]), pixel(mouth), float(forward[0]))
