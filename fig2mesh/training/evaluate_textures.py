"""Textures on bodies that training never saw: texture coordinates (table 4), and the sides that a drawing hides.

The sides are made from the front picture alone and compared with what the draughtsman of the training data made of
them. Shapes, labels and depths are the true ones, so that textures alone are measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fig2mesh.nets import uv_unet
from fig2mesh.nets.head_hsv import head_path, read_head
from fig2mesh.nets.uv_unet import UvUnetShape, read_uv, uv_path
from fig2mesh.nets.view_refine import read_refine, refine_path
from fig2mesh.paper import UV_SCORES
from fig2mesh.records import JOINT, PART, Pose3D
from fig2mesh.texture.sides import Sides, body_labels
from fig2mesh.texture.space import inwards, spread
from fig2mesh.texture.unseen import TextureNets, paint, shipped, texture_coordinates, unseen_changes
from fig2mesh.training.build import read_shard, shards
from fig2mesh.training.evaluate import SPLIT_TITLE, SPLITS, table
from fig2mesh.training.texture_data import Drawings, load_drawings
from fig2mesh.training.train_uv import scores
from fig2mesh.training.unfold import carried_on, places

Picture = NDArray[np.float32]
Say = Callable[[str], None]

ROADS: Final = (
    "coordinates, refined, heads", "coordinates, refined", "coordinates",
    "straight through the body", "nearest seen point", "OpenCV inpainting in texture space",
)  # fmt: skip

TEXTURE: Final = 256
"""Texels of an edge for inpainting colours."""

PALETTE: Final = 400
"""Pixels of each picture whose colours are compared as palettes."""

FACE_WIDTH, FACE_UP, FACE_DOWN = 0.9, 0.35, 1.2
"""Half axes of the drawn features about the eyes, relative to the distance of the eyes from the head's middle."""


@dataclass(frozen=True)
class Subject:
    """One body of `Drawings` as if it were traced, and its front picture.

    sides : see `Sides`; FIGURE x, y relative to the middle of the front
    front : (H, W, 3) float32, 0-255, colours carried on beyond the silhouette
    truth : (4, H, W, 3) float32, 0-255
    face : (H, W) bool, where the front has eyes and mouth
    """

    sides: Sides
    front: Picture
    truth: Picture
    face: NDArray[np.bool_]


def subjects(data: Path, split: str, most: int) -> list[Subject]:
    """The first bodies of a split that have texture coordinates."""
    drawings = load_drawings(data, (split,), pictures=True, most=most)
    joints: list[NDArray[np.float32]] = []
    for path in shards(data, split):
        arrays = read_shard(path, ("joints", "uv"))
        joints += list(arrays["joints"][arrays["uv"].any(axis=(1, 2, 3, 4))])
    return [_subject(drawings, row, joints[row].astype(np.float32)) for row in range(len(drawings))]


def _subject(drawings: Drawings, row: int, joints: NDArray[np.float32]) -> Subject:
    labels, depth = drawings.labels[row], drawings.depth[row].astype(np.float32)
    place = places(labels, depth)
    size = labels.shape[1]
    columns = np.flatnonzero((labels[0] > 0).any(axis=0))
    left, right = float(depth[1][labels[1] > 0].max()), -float(depth[3][labels[3] > 0].max())
    pitch = (left - right) / (columns[-1] - columns[0] + 1)
    half = pitch * size / 2
    # Depth of front and back; those of left and right follow from their columns.
    along = (np.arange(size) + 0.5 - size / 2) * pitch
    near = depth[0][labels[0] > 0]
    far = -depth[2][labels[2] > 0]
    middle = (float(near.max()) + float(far.min())) / 2
    z = np.stack([depth[0], np.broadcast_to(middle - along, depth[1].shape), -depth[2],
                  np.broadcast_to(middle + along, depth[3].shape)])  # fmt: skip
    seen = labels > 0
    points = np.concatenate([place * [half, -half], z[..., None]], axis=-1)
    points = np.where(seen[..., None], points, 0.0).astype(np.float32)
    picture = drawings.picture[row].astype(np.float32)
    # Joints are relative to the pelvis, pictures to the middle of the figure's box.
    middle_x = (left + right) / 2
    head, eyes = (joints[JOINT[name]] for name in ("head", "eyes"))
    top = float(joints[:, 1].max())
    own = labels[0] == PART["head"]
    rows = np.flatnonzero(own.any(axis=1))
    face = np.zeros((size, size), bool)
    reach = float(np.linalg.norm(eyes - head))
    if len(rows) and eyes[2] - head[2] > 0.15 * reach:
        # The head joint is the middle of the skull: it ties the joints' heights to the picture's.
        centre = np.argwhere(own).mean(axis=0)
        column = (eyes[0] - middle_x) / pitch + size / 2
        line = centre[0] - (eyes[1] - head[1]) / pitch
        y, x = np.mgrid[:size, :size] + 0.5
        across = (x - column) / (FACE_WIDTH * reach / pitch)
        up = (line - y) * pitch / reach
        face = (across**2 + np.where(up > 0, up / FACE_UP, up / FACE_DOWN) ** 2 < 1) & own
    pose = Pose3D(np.concatenate([joints[:, :2] - [middle_x, top - half * 0.9], joints[:, 2:]], axis=1))
    sides = Sides(body_labels(labels, points, pose), labels, depth, points, (0.0, 0.0), pitch)
    return Subject(sides, carried_on(picture[0], inwards(seen[0])), picture, face)


def painted(subject: Subject, road: str, nets: TextureNets) -> Picture:
    """(4, H, W, 3) the sides as one way to make them has them, from the front picture alone."""
    sides, front = subject.sides, subject.front
    seen = sides.labels > 0
    if road in ROADS[:3]:
        given = (nets, replace(nets, head=None), replace(nets, refine=None, head=None))[ROADS.index(road)]
        return paint(sides, front, given)
    if road == ROADS[3]:
        return _sampled(front, sides.places())
    if road == ROADS[4]:
        source = sides.points[0][seen[0]]
        _, index = cKDTree(source).query(sides.points[seen])
        result = np.zeros((*seen.shape, 3), np.float32)
        result[seen] = front[seen[0]][index]
        return result
    return _inpainted(subject, nets)


def _sampled(front: Picture, place: NDArray[np.floating]) -> Picture:
    size = front.shape[0]
    where = np.moveaxis((place[..., ::-1] + 1) / 2 * size - 0.5, -1, 0)
    return np.stack(
        [ndimage.map_coordinates(front[..., c], where, order=1, mode="nearest") for c in range(3)], axis=-1
    ).astype(np.float32)


def _inpainted(subject: Subject, nets: TextureNets) -> Picture:
    """Colours of the front in texture space, the rest of the texture by `cv2.inpaint` after Telea 2004."""
    import cv2

    sides = subject.sides
    seen = sides.labels > 0
    coordinates = texture_coordinates(sides, nets.uv)
    known, weight = spread(coordinates[0][seen[0]], subject.front[seen[0]], np.ones(seen[0].sum()), TEXTURE)
    hole = np.where(weight > 0, np.uint8(0), np.uint8(255))
    texture = cv2.inpaint(np.clip(known, 0, 255).astype(np.uint8), hole, 3.0, cv2.INPAINT_TELEA)
    cell = np.clip((coordinates * TEXTURE).astype(int), 0, TEXTURE - 1)
    return np.asarray(texture[cell[..., 1], cell[..., 0]], np.float32)


def compare(made: Picture, truth: Picture, mask: NDArray[np.bool_]) -> tuple[float, float, float]:
    """PSNR in dB, SSIM and palette distance (CIELAB units) of one side inside of the body.

    Palette distance: mean distance from a pixel's colour to the nearest colour of the other picture, both ways: what
    colours there are, wherever they are.
    """
    from skimage.color import rgb2lab
    from skimage.metrics import structural_similarity

    error = ((made - truth)[mask] / 255) ** 2
    psnr = 10 * np.log10(1 / max(float(error.mean()), 1e-9))
    flat = [np.where(mask[..., None], picture, 127.0) for picture in (made, truth)]
    _, similar = structural_similarity(*flat, channel_axis=2, data_range=255.0, full=True)
    rows = np.random.default_rng(0).permutation(int(mask.sum()))[:PALETTE]
    ours, theirs = (rgb2lab(np.clip(picture[mask][rows] / 255, 0, 1)) for picture in (made, truth))
    apart = cKDTree(theirs).query(ours)[0].mean() + cKDTree(ours).query(theirs)[0].mean()
    return float(psnr), float(similar[mask].mean()), float(apart) / 2


def face_share(made_place: NDArray[np.floating], subject: Subject) -> float:
    """Share of the head's pixels, seen from behind, that take their colour from the drawn eyes, nose and mouth."""
    back = subject.sides.labels[2] == PART["head"]
    if not back.any() or not subject.face.any():
        return float("nan")
    size = back.shape[0]
    pixel = np.clip(((made_place[2][back] + 1) / 2 * size).astype(int), 0, size - 1)
    return float(subject.face[pixel[:, 1], pixel[:, 0]].mean())


def evaluate_textures(data: Path, runs: Path | None, bodies: int, say: Say = lambda line: None) -> str:
    """The report as Markdown; runs : folder of networks that are not shipped: without masks, and those that refine."""
    say("Table 4: texture coordinates")
    sections = [
        "# Textures",
        "Written by `fig2mesh evaluate textures`; [training.md](training.md) says how data and weights were made.",
        "## Table 4: texture coordinates",
        _uv_table(data, runs, bodies),
    ]
    say("Unseen sides")
    sections += ["## Unseen sides", _side_table(data, bodies, _networks(runs))]
    return "\n\n".join(sections) + "\n"


def _uv_table(data: Path, runs: Path | None, bodies: int) -> str:
    rows = []
    for masks, title in ((False, "depth"), (True, "depth × part masks (shipped)")):
        files = sorted(runs.rglob(uv_path(UvUnetShape(masks)).name)) if runs is not None else []
        net = uv_unet.load() if masks else read_uv(files[0])[0] if files else None
        cells = []
        for split in SPLITS:
            if net is None:
                cells += ["not trained", ""]
                continue
            found = scores(net, load_drawings(data, (split,), pictures=False, most=bodies))
            cells += [f"{found['mae']:.4f}", f"{found['rmse']:.4f}"]
        rows.append((title, *(f"{value:.3f}" for value in UV_SCORES[masks]), *cells))
    head = ["input", "paper MAE", "paper RMSE"]
    head += [f"{SPLIT_TITLE[split]}: {what}" for split in SPLITS for what in ("MAE", "RMSE")]
    text = f"Texture units (0 to 1), over all pixels of four sides of {bodies} bodies a split that have coordinates."
    return f"{text}\n\n{table(head, rows)}"


def _networks(runs: Path | None) -> TextureNets:
    """The shipped networks, and those that refine what they paint where they have been trained."""
    nets = shipped()
    refining, heads = (
        sorted(runs.rglob(path(Path()).name)) if runs is not None else [] for path in (refine_path, head_path)
    )
    return replace(
        nets,
        refine=read_refine(refining[0])[0] if refining else None,
        head=read_head(heads[0])[0] if heads else None,
    )


def _side_table(data: Path, bodies: int, nets: TextureNets) -> str:
    missing = {ROADS[0]: nets.head is None or nets.refine is None, ROADS[1]: nets.refine is None}
    roads = [road for road in ROADS if not missing.get(road)]
    rows, faces = [], []
    for split in SPLITS:
        chosen = subjects(data, split, bodies)
        for road in roads:
            cells = []
            found: dict[str, list[tuple[float, float, float]]] = {"back": [], "sides": []}
            for subject in chosen:
                made = painted(subject, road, nets)
                for view in (1, 2, 3):
                    mask = subject.sides.labels[view] > 0
                    key = "back" if view == 2 else "sides"
                    found[key].append(compare(made[view], subject.truth[view], mask))
            for values in found.values():
                means = np.mean(values, axis=0)
                cells += [f"{means[0]:.2f}", f"{means[1]:.3f}", f"{means[2]:.2f}"]
            rows.append((f"{SPLIT_TITLE[split]}: {road}", *cells))
        for road in ROADS[2:4]:
            shares = []
            for subject in chosen:
                place = subject.sides.places()
                if road == ROADS[2]:
                    uv = texture_coordinates(subject.sides, nets.uv)
                    place = place + unseen_changes(subject.sides, subject.front, uv, nets.fill)
                shares.append(face_share(place, subject))
            faces.append((f"{SPLIT_TITLE[split]}: {road}", f"{100 * float(np.nanmean(shares)):.2f}"))
    head = ["way", *(f"{side}: {what}" for side in ("back", "left and right") for what in ("PSNR", "SSIM", "palette"))]
    text = (
        f"{bodies} bodies a split; means over pictures of 256 x 256 pixels, inside of the body. Palette: mean distance "
        "to the nearest colour of the other picture, CIELAB units, both ways."
    )
    share = "Share of the back of heads that shows eyes, nose or mouth:"
    return f"{text}\n\n{table(head, rows)}\n\n{share}\n\n{table(('way', 'percent'), faces)}"
