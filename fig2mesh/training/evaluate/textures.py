"""Textures of held-out bodies: texture coordinates (table 4), and the sides that a drawing hides.

The sides are made from the front picture alone and compared with the drawn sides of the training data.
Shapes, labels and depths are the true ones, so that networks alone are measured; for conversions see
`fig2mesh.evaluate.backs`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree

from fig2mesh.nets.head_hsv import HEAD_WEIGHTS, HeadShape
from fig2mesh.nets.uv_unet import SHIPPED, UV_WEIGHTS, UvUnetShape
from fig2mesh.nets.view_refine import REFINE_WEIGHTS, RefineShape
from fig2mesh.skeleton import PART
from fig2mesh.texture.space import spread
from fig2mesh.texture.unobserved import TextureNets, paint, place_changes, shipped, texture_coordinates
from fig2mesh.training.evaluate.networks import SPLIT_TITLE, SPLITS, table
from fig2mesh.training.evaluate.paper import UV_SCORES
from fig2mesh.training.networks.train_uv import scores
from fig2mesh.training.samples.texture_data import load_drawings
from fig2mesh.training.samples.textured_subject import TexturedSubject, subjects

FloatImage = NDArray[np.float32]
Report = Callable[[str], None]

# fmt: off
DRAWN, HEADS, REFINED, COORDINATES = (
    "coordinates, refined, in colours of the drawing", "coordinates, refined, heads", "coordinates, refined",
    "coordinates",
)
# fmt: on
# fmt: off
STRAIGHT, NEAREST, INPAINTED = (
    "straight through the body", "nearest observed point", "OpenCV inpainting in texture space",
)
# fmt: on
METHODS: Final = (DRAWN, HEADS, REFINED, COORDINATES, STRAIGHT, NEAREST, INPAINTED)
"""Methods that make unseen sides; the last three are baselines."""

PLACED: Final = (DRAWN, COORDINATES, STRAIGHT)
"""Methods that know the position in the drawing of each colour."""

NEEDS_REFINER: Final = (DRAWN, HEADS, REFINED)

COLOUR_WEIGHT: Final = 1.0
"""Distance, in half pictures, that weighs as much as black against white in the search for a drawn colour."""

UNCHANGED, UNLIKE = 30.0, 40.0
"""Maximum difference of a channel (0-255) between equal colours, and minimum between different ones."""

PAPER_SECTION: Final = """## Conversions in the paper's colours

`--textures paper` colours unseen sides as the paper does, to compare with: coordinates by the U-Net, completion in
texture space, four views that are blended by the normal; the front is the drawing. Of the paper's stages only the
first two have shipped weights, of our own training: the U-Net and completion, the latter in place of the paper's
inpainting. Refinement, cartoonisation and the autoencoder for heads are left out: the first and the last can be
trained ([training.md](training.md)), and are measured above; the second is not built.

![Six figures from four sides: in the colours of a conversion, and below in the paper's](textures_paper.jpg)"""

TEXTURE: Final = 256
"""Edge of the texture for inpainting, texels."""

PALETTE: Final = 400
"""Number of pixels of each picture whose colours are compared as palettes."""


def painted(subject: TexturedSubject, method: str, nets: TextureNets) -> tuple[FloatImage, FloatImage]:
    """Make the sides by one method, from the front picture alone.

    Returns
    -------
    (4, H, W, 3) colours, 0-255; (4, H, W, 2) position of each in the front, as far as it is known, edges at -1, 1
    """
    sides, front = subject.sides, subject.front
    seen = sides.labels > 0
    straight = sides.places()
    if method in (HEADS, REFINED):
        return paint(sides, front, nets if method == HEADS else replace(nets, head=None)), straight
    if method == STRAIGHT:
        return _sampled(front, straight), straight
    if method == NEAREST:
        source = sides.points[0][seen[0]]
        _, index = cKDTree(source).query(sides.points[seen])
        result = np.zeros((*seen.shape, 3), np.float32)
        result[seen] = front[seen[0]][index]
        return result, straight
    if method == INPAINTED:
        return _inpainted(subject, nets), straight
    found = straight + place_changes(sides, front, texture_coordinates(sides, nets.uv), nets.fill)
    if method == COORDINATES:
        return _sampled(front, found), found
    return _in_drawn_colours(paint(sides, front, replace(nets, head=None)), found, front, seen)


def _in_drawn_colours(
    made: FloatImage, place: FloatImage, front: FloatImage, seen: NDArray[np.bool_]
) -> tuple[FloatImage, FloatImage]:
    """Replace colours by those of drawn pixels that are most similar and near the expected position."""
    size = front.shape[0]
    rows, columns = np.nonzero(seen[0])
    at = np.stack([columns + 0.5, rows + 0.5], axis=1) / size * 2 - 1
    tree = cKDTree(np.concatenate([COLOUR_WEIGHT * front[seen[0]] / 255, at], axis=1))
    _, index = tree.query(np.concatenate([COLOUR_WEIGHT * made[seen] / 255, place[seen]], axis=1))
    result, where = np.zeros_like(made), place.copy()
    result[seen], where[seen] = front[seen[0]][index], at[index]
    return result, where


def _sampled(front: FloatImage, place: NDArray[np.floating]) -> FloatImage:
    size = front.shape[0]
    where = np.moveaxis((place[..., ::-1] + 1) / 2 * size - 0.5, -1, 0)
    return np.stack(
        [ndimage.map_coordinates(front[..., c], where, order=1, mode="nearest") for c in range(3)], axis=-1
    ).astype(np.float32)


def _inpainted(subject: TexturedSubject, nets: TextureNets) -> FloatImage:
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


def compare(made: FloatImage, truth: FloatImage, mask: NDArray[np.bool_]) -> tuple[float, float, float]:
    """PSNR in dB, SSIM and palette distance (CIELAB units) of one side inside of the body.

    Palette distance: mean distance from a pixel's colour to the nearest colour of the other picture, both ways: a
    measure of the colours that does not depend on their positions.
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


def face_share(made: FloatImage, place: FloatImage, subject: TexturedSubject) -> tuple[float, float]:
    """Shares of the head's pixels, seen from behind, that have the drawing's colours of the face, and of those among
    them where the ground truth is another colour.

    place : positions in the front of the colours `made`, see `painted`
    """
    back = subject.sides.labels[2] == PART["head"]
    if not back.any() or not subject.face.any():
        return float("nan"), float("nan")
    size = back.shape[0]
    pixel = np.clip(((place[2][back] + 1) / 2 * size).astype(int), 0, size - 1)
    column, row = pixel[:, 0], pixel[:, 1]
    alike = np.abs(made[2][back] - subject.front[row, column]).max(axis=1) < UNCHANGED
    shown = subject.face[row, column] & alike
    wrong = np.abs(made[2][back] - subject.truth[2][back]).max(axis=1) > UNLIKE
    return float(shown.mean()), float((shown & wrong).mean())


def evaluate_textures(data: Path, runs: Path | None, bodies: int, report: Report = lambda line: None) -> str:
    """Return the report as Markdown; runs : folder of networks that are not shipped: without masks, and refiners."""
    report("Table 4: texture coordinates")
    sections = [
        "# Textures",
        "Written by `fig2mesh evaluate textures`; [training.md](training.md) describes data and training.",
        "## Table 4: texture coordinates",
        _uv_table(data, runs, bodies),
    ]
    report("Unseen sides")
    sections += ["## Unseen sides", _side_table(data, bodies, _networks(runs)), PAPER_SECTION]
    return "\n\n".join(sections) + "\n"


def _uv_table(data: Path, runs: Path | None, bodies: int) -> str:
    rows = []
    for masks, title in ((False, "depth"), (True, "depth × part masks (shipped)")):
        files = sorted(runs.rglob(UV_WEIGHTS.path(UvUnetShape(masks)).name)) if runs is not None else []
        net = UV_WEIGHTS.shipped(SHIPPED) if masks else UV_WEIGHTS.read(files[0])[0] if files else None
        cells = []
        for split in SPLITS:
            if net is None:
                cells += ["not trained", ""]
                continue
            found = scores(net, load_drawings(data, (split,), pictures=False, limit=bodies))
            cells += [f"{found['mae']:.4f}", f"{found['rmse']:.4f}"]
        rows.append((title, *(f"{value:.3f}" for value in UV_SCORES[masks]), *cells))
    head = ["input", "paper MAE", "paper RMSE"]
    head += [f"{SPLIT_TITLE[split]}: {what}" for split in SPLITS for what in ("MAE", "RMSE")]
    text = f"Texture units (0 to 1), over all pixels of four sides of {bodies} bodies a split that have coordinates."
    return f"{text}\n\n{table(head, rows)}"


def _networks(runs: Path | None) -> TextureNets:
    """The shipped networks, and the refiners where they have been trained."""
    nets = shipped()
    refining, heads = (
        sorted(runs.rglob(name)) if runs is not None else []
        for name in (REFINE_WEIGHTS.path(RefineShape()).name, HEAD_WEIGHTS.path(HeadShape()).name)
    )
    return replace(
        nets,
        refine=REFINE_WEIGHTS.read(refining[0])[0] if refining else None,
        head=HEAD_WEIGHTS.read(heads[0])[0] if heads else None,
    )


def _side_table(data: Path, bodies: int, nets: TextureNets) -> str:
    absent = {HEADS} if nets.head is None else set()
    absent |= set(NEEDS_REFINER) if nets.refine is None else set()
    methods = [method for method in METHODS if method not in absent]
    rows, faces = [], []
    for split in SPLITS:
        chosen = subjects(data, split, bodies)
        for method in methods:
            found: dict[str, list[tuple[float, float, float]]] = {"back": [], "sides": []}
            shares = []
            for subject in chosen:
                made, place = painted(subject, method, nets)
                shares.append(face_share(made, place, subject))
                for view in (1, 2, 3):
                    mask = subject.sides.labels[view] > 0
                    found["back" if view == 2 else "sides"].append(compare(made[view], subject.truth[view], mask))
            means = [np.mean(values, axis=0) for values in found.values()]
            title = f"{SPLIT_TITLE[split]}: {method}"
            rows.append((title, *(cell for m in means for cell in (f"{m[0]:.2f}", f"{m[1]:.3f}", f"{m[2]:.2f}"))))
            if method in PLACED:
                faces.append((title, *(f"{100 * share:.1f}" for share in np.nanmean(shares, axis=0))))
    head = [
        "method",
        *(f"{side}: {what}" for side in ("back", "left and right") for what in ("PSNR", "SSIM", "palette")),
    ]
    text = (
        f"{bodies} bodies a split; means over pictures of 256 x 256 pixels, inside of the body. Palette: mean distance "
        "to the nearest colour of the other picture, CIELAB units, both ways."
    )
    share = (
        "Percent of the back of heads that shows what the drawing has between brows and chin, skin included; and as far"
        " as the truth has another colour there:"
    )
    return f"{text}\n\n{table(head, rows)}\n\n{share}\n\n{table(('method', 'face', 'face, wrongly'), faces)}"
