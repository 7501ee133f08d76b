"""Backs of models of synthetic figures, against their true backs.

Figures are drawn from the front and from behind; the front is converted, and the model's view from behind is compared
with the drawn one. People and clothes of the test figures are not in the training data, nor among the tuning figures.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from exporters.asset import TexturedMesh, without_outline
from fig2mesh.asset_frame import asset_from_figure, on_drawing
from fig2mesh.conversion.convert import run_stages
from fig2mesh.errors import InputError
from fig2mesh.image_frame import image_frame
from fig2mesh.measure.model import load_textured
from fig2mesh.mesh.preview import render_mesh, view_bounds
from fig2mesh.mesh.raycast import MeshCaster
from fig2mesh.parse.annotation import Annotation, write_annotation
from fig2mesh.records import BoolArray, Figure
from fig2mesh.settings import Settings
from fig2mesh.skeleton import FIGURE_HEIGHT
from fig2mesh.stages.lift import lift
from fig2mesh.stages.model import model
from fig2mesh.stages.simplify import simplify
from fig2mesh.training.bodies.pack import Pack
from fig2mesh.training.bodies.subject import draw_subject
from fig2mesh.training.evaluate.networks import table
from fig2mesh.training.samples.drawn_figure import DrawnFigure, DrawnSide, drawn_figure

Picture = NDArray[np.floating]
Report = Callable[[str], None]
Rows = dict[str, dict[str, dict[str, float]]]
"""Figure → method → measure → value."""

SETS: Final[dict[str, tuple[str, int]]] = {"tuning": ("valid-clips", 16), "test": ("valid-characters", 64)}
"""Set of figures → split of the subjects, and number of figures."""

# fmt: off
OURS, MIRRORED, MIRRORED_BARE, NEAREST = (
    "model", "mirrored front", "mirrored front without lines", "nearest seen colour, without lines",
)
# fmt: on

WINDOW: Final = 7
"""Edge of the windows of SSIM, pixels, as for fronts."""

RIM: Final = 1.3
"""Width of the silhouette's rim that is left out of areas, line widths, as for ink in side views."""

AREAS: Final = "area_"
"""Prefix of the measures over areas."""

PALETTE: Final = 400
"""Number of pixels of each picture whose colours are compared as palettes."""

UNCHANGED, UNLIKE = 30.0, 40.0
"""Maximum difference of a channel (0-255) between equal colours, and minimum between different ones."""

SHADES: Final = tuple(np.linspace(0.65, 1.0, 8).tolist())
"""Brightness of skin, lit or in the shade of cel-shading."""


METHODS: Final = (OURS, MIRRORED, MIRRORED_BARE, NEAREST)


class Likeness(NamedTuple):
    """Likeness of two pictures over some of their pixels.

    psnr : dB, sRGB; ssim : mean of 7 x 7 windows; delta_e : mean CIEDE2000
    palette : earth mover's distance between the colours of both, CIELAB units: what remains if pixels may be moved
    """

    psnr: float
    ssim: float
    delta_e: float
    palette: float


KEYS: Final = (*Likeness._fields, *(AREAS + key for key in Likeness._fields))
"""Measures of colours, over the whole silhouette and over areas."""


@dataclass(frozen=True)
class Pixels:
    """Scale of a drawing: metres of ASSET per pixel, and the pixel (x, y) under the ASSET origin."""

    metres: float
    origin: tuple[float, float]


def figures_of(pack: Pack, name: str, limit: int | None = None) -> Iterator[DrawnFigure]:
    """Draw the figures of a set; the same pack gives the same figures."""
    split, count = SETS[name]
    for seed in range(count if limit is None else min(count, limit)):
        yield drawn_figure(draw_subject(pack, split, seed), f"{name}-{seed:02d}", seed)


def converted(figure: Figure, settings: Settings) -> tuple[TexturedMesh, Pixels]:
    """Model of a figure, and its scale on the drawing."""
    done = run_stages(figure, settings, (lift, simplify, model), height_m=FIGURE_HEIGHT)
    asset = asset_from_figure(done.results[lift], done.results[simplify][0].vertices, FIGURE_HEIGHT)
    pixel, (x, y) = on_drawing(image_frame(done.figure), asset)
    (left, top), step = done.figure.origin_px, done.figure.step_px
    return done.results[model][0], Pixels(pixel / step, (left + step * x, top + step * y))


def pixels_of(mesh: TexturedMesh, mask: BoolArray) -> Pixels:
    """Scale of a model from elsewhere: its front fills the drawn figure's bounding box from top to bottom."""
    left, bottom, right, top = view_bounds(mesh, 0.0)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    metres = (top - bottom) / (rows[-1] + 1 - rows[0])
    middle = (columns[0] + columns[-1] + 1) / 2
    return Pixels(metres, (middle - (left + right) / 2 / metres, rows[-1] + 1 + bottom / metres))


def back_of(mesh: TexturedMesh, scale: Pixels, shape: tuple[int, int]) -> Picture:
    """(H, W, 3) 0-255 view of a model from behind at the pixels of the drawn back, colours continued beyond it."""
    shown = render_mesh(mesh, yaw_deg=180.0, size=(shape[1], shape[0]), bounds=_bounds(scale, shape), samples=2)
    covered = shown[..., 3] > 127
    if not covered.any():
        return np.full((*shape, 3), 255.0)
    _, source = ndimage.distance_transform_edt(~covered, return_indices=True)
    return np.asarray(shown[..., :3][tuple(source)], np.float64)


def nearest_seen(mesh: TexturedMesh, scale: Pixels, front: DrawnSide) -> Picture:
    """(H, W, 3) 0-255 view from behind in the colours of the nearest points that the front shows, lines left out."""
    shape = front.mask.shape
    caster = MeshCaster(without_outline(mesh))
    before, behind = (_points(caster, scale, shape, side) for side in (1.0, -1.0))
    seen = front.mask & np.isfinite(before).all(axis=2)
    result = front.bare[:, ::-1].astype(np.float64)
    covered = np.isfinite(behind).all(axis=2)
    if seen.any() and covered.any():
        _, index = cKDTree(before[seen]).query(behind[covered])
        result[covered] = front.bare[seen][index]
    return result


def _bounds(scale: Pixels, shape: tuple[int, int]) -> tuple[float, float, float, float]:
    """Left, bottom, right, top of the view from behind: the mirror image of the drawing's frame."""
    x, y = scale.origin
    left, bottom, right, top = x - shape[1], y - shape[0], x, y
    return left * scale.metres, bottom * scale.metres, right * scale.metres, top * scale.metres


def _points(caster: MeshCaster, scale: Pixels, shape: tuple[int, int], side: float) -> Picture:
    """(H, W, 3) points of the surface at the pixels of the view from the front (side 1) or behind (-1); NaN beside."""
    left, _, _, top = _bounds(scale, shape)
    across = left + (np.arange(shape[1]) + 0.5) * scale.metres
    if side > 0:
        across = scale.origin[0] * -scale.metres + (np.arange(shape[1]) + 0.5) * scale.metres
    x, y = np.meshgrid(side * across, top - (np.arange(shape[0]) + 0.5) * scale.metres)
    flat = np.stack([x, y], axis=-1).reshape(-1, 2)
    origins = np.zeros((len(flat), 3))
    origins[:, :2], origins[:, 2] = (flat - caster.centre[:2]) / caster.unit, side
    directions = np.broadcast_to([0.0, 0.0, -side], origins.shape)
    hits = caster.cast(origins, directions)
    origins[:, 2] = np.where(hits.hit, side - side * hits.depth, np.nan)
    return origins.reshape(*shape, 3)


def likeness(made: Picture, truth: Picture, over: BoolArray) -> Likeness:
    """Compare two pictures (H, W, 3), 0-255, over the pixels `over`."""
    from skimage.color import deltaE_ciede2000, rgb2lab
    from skimage.metrics import structural_similarity

    error = float(np.mean(((made - truth)[over] / 255) ** 2))
    flat = [np.where(over[..., None], picture, 255.0) for picture in (made, truth)]
    _, similar = structural_similarity(*flat, win_size=WINDOW, channel_axis=2, data_range=255.0, full=True)
    ours, theirs = (rgb2lab(np.clip(picture[over] / 255, 0, 1)) for picture in (made, truth))
    rows = np.random.default_rng(0).permutation(len(ours))[:PALETTE]
    cost = np.linalg.norm(ours[rows][:, None] - theirs[rows], axis=-1)
    return Likeness(
        10 * float(np.log10(1 / max(error, 1e-10))),
        float(similar[over].mean()),
        float(deltaE_ciede2000(ours, theirs).mean()),
        float(cost[linear_sum_assignment(cost)].mean()),
    )


def face_share(made: Picture, drawn: DrawnFigure) -> float:
    """Share of the head, seen from behind, that wrongly shows the face: skin, or what the front shows about the eyes.

    Pixels whose true colour, lines left out, is alike do not count: bald heads show skin. NaN where the head is hidden.
    """
    back, head = drawn.back, drawn.back.head
    if not head.any():
        return float("nan")
    wrong = np.abs(made - back.bare).max(axis=2) > UNLIKE
    skin = np.zeros_like(head)
    for shade in SHADES:
        skin |= np.abs(made - shade * drawn.skin).max(axis=2) < UNCHANGED / 2
    front = drawn.front.picture[:, ::-1].astype(np.float64)
    features = drawn.front.face[:, ::-1] & (np.abs(made - front).max(axis=2) < UNCHANGED)
    return float(((skin | features) & wrong)[head].mean())


def measure(made: Picture, drawn: DrawnFigure) -> dict[str, float]:
    """Measures of a back: over the whole silhouette, over areas without true lines and rim, and of the head."""
    back = drawn.back
    whole = back.mask
    inner = ndimage.distance_transform_edt(np.pad(whole, 1))[1:-1, 1:-1] > RIM * drawn.line_px
    areas = inner & ~ndimage.binary_dilation(back.inked)
    truth = back.picture.astype(np.float64)
    found = dict(likeness(made, truth, whole)._asdict())
    found |= {
        f"area_{key}": value for key, value in likeness(made, truth, areas if areas.any() else whole)._asdict().items()
    }
    return found | {"face": face_share(made, drawn)}


def measure_figure(drawn: DrawnFigure, mesh: TexturedMesh, scale: Pixels) -> dict[str, dict[str, float]]:
    """Measures of a model's back and of the simple ways to make one, by method."""
    front = drawn.front
    made = {
        OURS: back_of(mesh, scale, front.mask.shape),
        MIRRORED: front.picture[:, ::-1].astype(np.float64),
        MIRRORED_BARE: front.bare[:, ::-1].astype(np.float64),
        NEAREST: nearest_seen(mesh, scale, front),
    }
    return {method: measure(picture, drawn) for method, picture in made.items()}


def evaluate_backs(
    pack: Pack,
    name: str,
    settings: Settings,
    *,
    models: Path | None = None,
    limit: int | None = None,
    report: Report = lambda line: None,
) -> tuple[Rows, dict[str, str]]:
    """Measure a set of figures; returns the measures, and the reasons of failures by figure.

    models : folder with NAME.glb of each figure, made elsewhere from what `write_figures` writes; None to convert them
    """
    rows: Rows = {}
    failures: dict[str, str] = {}
    for drawn in figures_of(pack, name, limit):
        title = drawn.figure.name
        report(title)
        try:
            if models is None:
                mesh, scale = converted(drawn.figure, settings)
            else:
                mesh = load_textured(models / f"{title}.glb")
                scale = pixels_of(mesh, drawn.front.mask)
        except InputError as error:
            failures[title] = " ".join(str(error).split())
            continue
        rows[title] = measure_figure(drawn, mesh, scale)
    return rows, failures


def write_figures(pack: Pack, name: str, folder: Path, limit: int | None = None) -> None:
    """Write the figures of a set as folders with image.png, mask.png, keypoints.json and the true back, back.png."""
    from PIL import Image

    for drawn in figures_of(pack, name, limit):
        figure, place = drawn.figure, folder / drawn.figure.name
        place.mkdir(parents=True, exist_ok=True)
        Image.fromarray(drawn.front.picture).save(place / "image.png")
        Image.fromarray(drawn.back.picture).save(place / "back.png")
        annotation = Annotation(figure.mask, figure.joints_px, figure.visible, figure.part_labels)
        write_annotation(place, annotation, "image.png", overwrite=True)


def means(rows: Rows) -> dict[str, dict[str, float]]:
    """Mean of each measure by method; figures without a head do not count for the face."""
    if not rows:
        return {}
    return {
        method: {key: float(np.nanmean([row[method][key] for row in rows.values()])) for key in (*KEYS, "face")}
        for method in METHODS
    }


def as_markdown(rows: Rows, failures: dict[str, str], name: str, settings: Settings) -> str:
    """Tables of the means, and of the wins of the model over the other methods."""
    heads = ("PSNR dB", "SSIM", "ΔE", "palette")
    forms = dict(zip(KEYS, 2 * (".2f", ".3f", ".1f", ".1f"), strict=True))
    lines = [
        (method, *(f"{found[key]:{form}}" for key, form in forms.items()), f"{100 * found['face']:.2f}")
        for method, found in means(rows).items()
    ]
    wins = [(method, *(str(_wins(rows, method, key)) for key in KEYS)) for method in METHODS if method != OURS]
    head = ["method", *heads, *(f"areas: {title}" for title in heads)]
    text = [
        "# Backs",
        "Written by `fig2mesh evaluate backs`; [training.md](training.md) describes the pack.",
        f"{len(rows)} synthetic figures of the {name} set, drawn from the front and from behind in flat or cel-shaded "
        f"colours with a contour, 512 x 512 pixels; the front is converted (textures: {settings.textures}, contours: "
        f"{settings.contours}), and the model's view from behind is compared with the drawn one inside the silhouette. "
        "Areas: without the true lines, and without the outermost 1.3 line widths. ΔE: CIEDE2000. Palette: earth "
        "mover's distance between the colours of both pictures, CIELAB units. Face: share of the head that wrongly "
        "shows skin or what the front shows about the eyes, percent. The mirrored front shows the contour as the true "
        "back does; the methods without lines are given the front as drawn without any.",
        table([*head, "face %"], lines),
        "Figures on which the model is better:",
        table(head, wins),
    ]
    if failures:
        text.append("\n".join(f"- {title}: {reason}" for title, reason in failures.items()))
    return "\n\n".join(text) + "\n"


def _wins(rows: Rows, method: str, key: str) -> int:
    sign = 1 if key.endswith(("psnr", "ssim")) else -1
    return sum(sign * (row[OURS][key] - row[method][key]) > 0 for row in rows.values())


def as_json(rows: Rows, failures: dict[str, str]) -> str:
    """JSON of all values, unrounded; null for the face of a hidden head."""

    def plain(found: dict[str, float]) -> dict[str, float | None]:
        return {key: None if np.isnan(value) else value for key, value in found.items()}

    figures = {title: {method: plain(found) for method, found in row.items()} for title, row in rows.items()}
    averages = {method: plain(found) for method, found in means(rows).items()}
    return json.dumps({"figures": figures, "failures": failures, "means": averages}, indent=1, allow_nan=False) + "\n"
