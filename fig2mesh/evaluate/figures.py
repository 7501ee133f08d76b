"""`fig2mesh evaluate figures`: convert every drawing of a folder and take all measures of the models.

The models are 1.79 m high, the height for which the thresholds of the measures are defined, and are not written.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from exporters.asset import without_outline
from fig2mesh.asset_frame import asset_from_figure, on_drawing
from fig2mesh.conversion.convert import run_stages
from fig2mesh.conversion.stores import MemoryStore
from fig2mesh.errors import InputError
from fig2mesh.image_frame import image_frame
from fig2mesh.measure.bleed import bleed_share
from fig2mesh.measure.front import flange_share, front_view, gap, wall_share
from fig2mesh.measure.ink import pens_of, side_ink
from fig2mesh.measure.model import front_similarity, silhouette_iou
from fig2mesh.measure.outline import outline_laws
from fig2mesh.measure.solid import laws, quality, thinnest_wall
from fig2mesh.mesh.simplify import deviation
from fig2mesh.mesh.simplify import simplify as simplify_mesh
from fig2mesh.parse.read import read_figure
from fig2mesh.settings import Settings
from fig2mesh.skeleton import FIGURE_HEIGHT
from fig2mesh.stages.lift import lift
from fig2mesh.stages.model import model
from fig2mesh.stages.simplify import simplify
from fig2mesh.stages.solid import solid

LEVELS = 3
COARSE = 5000
"""Triangles of an additional level, the same for every quality, for maps with hundreds of figures."""

Log = Callable[[str], None]
Facts = dict[str, float | int | bool]


@dataclass(frozen=True)
class Drawing:
    """Files of one figure; mask is None where the picture's alpha channel is the silhouette."""

    name: str
    image: Path
    keypoints: Path
    mask: Path | None

    def arguments(self) -> dict[str, Any]:
        """Arguments of `read_figure`."""
        return {"path": self.image, "mask": self.mask, "keypoints": self.keypoints, "name": self.name}


@dataclass(frozen=True)
class FigureRow:
    """Result for one drawing: values by the keys of `COLUMNS`, or the reason of the failure in one line."""

    name: str
    facts: Facts
    failure: str = ""


@dataclass(frozen=True)
class Column:
    """One measure in the table: its key, heading, factor and format, and which extreme is the worst."""

    key: str
    title: str
    form: str = ".2f"
    factor: float = 1.0
    worse: Literal["min", "max"] = "max"


COLUMNS = (
    Column("silhouette_iou", "IoU %", ".1f", 100, "min"),
    Column("front_psnr_db", "PSNR dB", ".1f", 1, "min"),
    Column("front_ssim", "SSIM", ".3f", 1, "min"),
    Column("bleed_share", "bleed %", ".2f", 100),
    Column("side_ink_share", "ink from the side %", ".2f", 100),
    Column("side_ink_width", "its width, lines", ".1f"),
    Column("outline_closed", "outline closed", "yes", 1, "min"),
    Column("outline_inverted", "outline inverted", "yes", 1, "min"),
    Column("outline_outside_mm", "outline outside mm", ".2f"),
    Column("outline_turned", "turned by inset", "d"),
    Column("gap_share", "gap %", ".2f", 100),
    Column("gap_radius_mm", "gap mm", ".1f"),
    Column("flange_share", "flange %", ".2f", 100),
    Column("wall_share", "wall %", ".1f", 100),
    Column("thinnest_mm", "thinnest mm", ".2f", 1, "min"),
    Column("thinnest_quantile_mm", "thinnest 0.1 % mm", ".1f", 1, "min"),
    Column("quality_least", "q least", ".3f", 1, "min"),
    Column("quality_quantile", "q 1 %", ".2f", 1, "min"),
    Column("slivers", "q < 0.05 %", ".3f", 100),
    Column("closed", "closed", "yes", 1, "min"),
    Column("manifold", "manifold", "yes", 1, "min"),
    Column("components", "pieces", "d"),
    Column("pieces_drawn", "drawn", "d"),
    Column("genus", "genus", "d"),
    Column("inner_shells", "inner shells", "d"),
    Column("crossing", "crossing triangles", "d"),
    Column("turned", "turned normals %", ".2f", 100),
    *(
        Column(f"{level}_{which}_deviation_mm", f"{title} {which} mm", ".2f")
        for level, title in [*((f"lod{n}", f"level {n}") for n in range(LEVELS)), ("coarse", f"{COARSE:,}")]
        for which in ("mean", "max")
    ),
)


def find_drawings(folder: Path) -> tuple[Drawing, ...]:
    """Figures of a folder by name: folders with image.png, and pairs of NAME.png and NAME.json (NAME_mask.png)."""
    if not folder.is_dir():
        raise InputError(folder, "no such directory", "name a folder of figures")
    found = []
    for path in sorted(folder.iterdir()):
        if path.is_dir() and (path / "image.png").exists():
            found.append(drawing_in(path))
        elif path.suffix == ".png" and path.with_suffix(".json").exists():
            mask = path.with_name(f"{path.stem}_mask.png")
            found.append(Drawing(path.stem, path, path.with_suffix(".json"), mask if mask.exists() else None))
    if not found:
        remedy = "give folders with image.png and keypoints.json, or pairs of NAME.png and NAME.json"
        raise InputError(folder, "no figures", remedy)
    return tuple(found)


def drawing_in(folder: Path) -> Drawing:
    """Drawing in a folder with image.png, keypoints.json and, where needed, mask.png."""
    mask = folder / "mask.png"
    return Drawing(folder.name, folder / "image.png", folder / "keypoints.json", mask if mask.exists() else None)


def evaluate_figures(
    drawings: tuple[Drawing, ...], settings: Settings, log: Log = lambda line: None
) -> list[FigureRow]:
    """Make and measure a model of each drawing; a failure is reported in its row and does not stop the others."""
    rows = []
    for number, drawing in enumerate(drawings, 1):
        log(f"{number} of {len(drawings)}: {drawing.name}")
        try:
            rows.append(FigureRow(drawing.name, measure_drawing(drawing, settings)))
        except InputError as error:
            rows.append(FigureRow(drawing.name, {}, " ".join(str(error).split())))
        except Exception as error:  # Any error of one figure is a result for that figure.
            rows.append(FigureRow(drawing.name, {}, f"{type(error).__name__}: {' '.join(str(error).split())}"))
    return rows


def measure_drawing(drawing: Drawing, settings: Settings) -> Facts:
    """Measures of one drawing's model, by the keys of `COLUMNS`."""
    figure = read_figure(**drawing.arguments())
    settings, store = replace(settings, lods=LEVELS), MemoryStore()
    done = run_stages(figure, settings, (lift, solid, simplify, model), height_m=FIGURE_HEIGHT, store=store)
    dropped = run_stages(figure, replace(settings, contours="drop"), (model,), height_m=FIGURE_HEIGHT, store=store)
    figure, pieces = done.figure, done.pieces
    levels = done.results[model]
    finest, mesh = levels[0], done.results[solid].mesh

    frame = image_frame(figure)
    asset = asset_from_figure(done.results[lift], done.results[simplify][0].vertices, FIGURE_HEIGHT)
    pixel, origin_px = on_drawing(frame, asset)
    similar = front_similarity(finest, figure.rgba, figure.mask, metres_per_pixel=pixel, origin_px=origin_px)
    bare = without_outline(finest)
    width_m = 0.0 if finest.outline is None else finest.outline.width_m
    ink, outline = side_ink(finest, dropped.results[model][0], pens_of(finest), width_m), outline_laws(finest)
    missing = gap(bare, figure.mask, metres_per_pixel=pixel, origin_px=origin_px)
    front, wall, shape, law = front_view(bare), thinnest_wall(bare), quality(bare), laws(bare)
    # FIGURE units are metres at this height.
    deviations = [level.deviation_m for level in levels] + [deviation(simplify_mesh(mesh, COARSE), mesh)]
    names = [*(f"lod{number}" for number in range(LEVELS)), "coarse"]
    return {
        "silhouette_iou": silhouette_iou(finest, figure.mask, metres_per_pixel=pixel, origin_px=origin_px),
        "front_psnr_db": similar.psnr_db,
        "front_ssim": similar.ssim,
        "bleed_share": bleed_share(finest, figure.rgba, figure.mask, metres_per_pixel=pixel, origin_px=origin_px),
        "side_ink_share": ink.share,
        "side_ink_width": ink.width,
        "outline_closed": outline.closed,
        "outline_inverted": outline.inverted,
        "outline_outside_mm": 1000 * outline.outside_m,
        "outline_turned": outline.turned,
        "gap_share": missing.share,
        "gap_radius_mm": missing.radius_mm,
        "flange_share": flange_share(front),
        "wall_share": wall_share(front),
        "thinnest_mm": wall.min_mm,
        "thinnest_quantile_mm": wall.quantile_mm,
        "quality_least": shape.minimum,
        "quality_quantile": shape.quantile,
        "slivers": shape.slivers,
        "closed": law.closed,
        "manifold": law.manifold,
        "components": law.components,
        "pieces_drawn": pieces,
        "genus": law.genus,
        "inner_shells": law.inner_shells,
        "crossing": law.crossing,
        "turned": law.turned,
        **{f"{name}_mean_deviation_mm": 1000 * mean for name, (mean, _) in zip(names, deviations, strict=True)},
        **{f"{name}_max_deviation_mm": 1000 * most for name, (_, most) in zip(names, deviations, strict=True)},
    }


def summary(rows: list[FigureRow]) -> tuple[Facts, Facts]:
    """Median and worst value of each measure over the figures with a model."""
    median: Facts = {}
    worst: Facts = {}
    for column in COLUMNS:
        values = [row.facts[column.key] for row in rows if row.facts]
        if values:
            median[column.key] = (
                statistics.median_low(values) if column.form in ("d", "yes") else statistics.median(values)
            )
            worst[column.key] = min(values) if column.worse == "min" else max(values)
    return median, worst


def as_markdown(rows: list[FigureRow]) -> str:
    """Markdown table with a row for each figure, or the reason of its failure, then median and worst."""
    lines = [
        "| figure | " + " | ".join(column.title for column in COLUMNS) + " |",
        "|---|" + "---:|" * len(COLUMNS),
    ]
    for row in rows:
        # A bar would end the cell.
        reason = row.failure.replace("|", "\\|")
        cells = _cells(row.facts) if row.facts else [f"failed: {reason}", *[""] * (len(COLUMNS) - 1)]
        lines.append(f"| {row.name} | " + " | ".join(cells) + " |")
    for name, facts in zip(("**median**", "**worst**"), summary(rows), strict=True):
        if facts:
            lines.append(f"| {name} | " + " | ".join(_cells(facts)) + " |")
    return "\n".join(lines) + "\n"


def as_json(rows: list[FigureRow]) -> str:
    """JSON of the same values, unrounded: lengths in mm, shares as fractions."""
    median, worst = summary(rows)
    figures: dict[str, Any] = {row.name: row.facts or {"failure": row.failure} for row in rows}
    return json.dumps({"figures": figures, "median": median, "worst": worst}, indent=2, allow_nan=False) + "\n"


def _cells(facts: Facts) -> list[str]:
    def cell(column: Column) -> str:
        value = facts[column.key]
        if column.form == "yes":
            return "yes" if value else "**no**"
        return format(int(value) if column.form == "d" else column.factor * value, column.form)

    return [cell(column) for column in COLUMNS]
