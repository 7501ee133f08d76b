"""The sweep as CSV, plots and a page."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from fig2mesh.tradeoff.measures import Measured, knee, pareto
from fig2mesh.tradeoff.sweep import KNOBS, STAGES_OF
from fig2mesh.tradeoff.tolerance import Tolerance

COLUMNS: Final = (
    "figure", "knob", "value", "seconds", "stage_seconds", "peak_mb", "chamfer_mm", "hausdorff_mm", "normal_deg",
    "silhouette_iou", "front_ssim", "triangles", "failure",
)  # fmt: skip


def rows(figure: str, found: Sequence[Measured]) -> list[dict[str, Any]]:
    """A row of the table for each run; numbers that there are none of are left empty."""
    return [
        {
            "figure": figure,
            "knob": m.run.knob or "quality",
            "value": m.run.value,
            "seconds": _number(m.run.total_s, 3),
            "stage_seconds": _number(m.run.seconds.get(STAGES_OF.get(m.run.knob, ""), float("nan")), 3),
            "peak_mb": _number(m.run.peak_mb, 0),
            "chamfer_mm": _number(m.chamfer_mm, 4),
            "hausdorff_mm": _number(m.hausdorff_mm, 3),
            "normal_deg": _number(m.normal_deg, 3),
            "silhouette_iou": _number(m.run.silhouette_iou, 5),
            "front_ssim": _number(m.run.front_ssim, 5),
            "triangles": len(m.run.mesh.faces) if m.run.mesh is not None else "",
            "failure": m.run.failure,
        }
        for m in found
    ]


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else ""


def as_csv(table: Sequence[dict[str, Any]]) -> str:
    """The rows as CSV with a header."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    return stream.getvalue()


def summary(figure: str, found: Sequence[Measured], tolerances: Sequence[Tolerance], machine: str) -> str:
    """The page of one figure, Markdown: the knee, the presets, every knob."""
    front, best = _front(found)
    named = [_name(found[i]) for i in front]
    chosen = found[front[best]]
    lines = [
        f"## {figure}",
        f"Measured on {machine}; seconds of one run, errors against the finest setting of a figure 1.79 m high.",
        f"**The knee is `{_name(chosen)}`**: {chosen.run.total_s:.1f} s for {chosen.chamfer_mm:.2f} mm. "
        f"On the Pareto front, by rising time: {', '.join(f'`{name}`' for name in named)}.",
        f"![Error against seconds]({figure}-front.png)",
        f"![Every knob]({figure}-knobs.png)",
        "| setting | seconds | of its stage | peak MB | chamfer mm | Hausdorff mm | normals ° | IoU | front SSIM |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    table = [
        f"| {'**' if i in front else ''}{_name(m)}{'**' if i in front else ''} | "
        + " | ".join(str(row[key]) or "-" for key in COLUMNS[3:11])
        + " |"
        for i, (m, row) in enumerate(zip(found, rows(figure, found), strict=True))
    ]
    lines[-1] = "\n".join([lines.pop(-2), lines[-1], *table])
    if tolerances:
        head = ["| tolerance of the tracer | mean depth error mm | greatest mm | cells a ray | seconds |",
                "|---:|---:|---:|---:|---:|"]  # fmt: skip
        body = [f"| {t.tolerance:g} | {t.mean_mm:.4f} | {t.worst_mm:.3f} | {t.steps:.1f} | {t.seconds:.3f} |"
                for t in tolerances]  # fmt: skip
        lines += ["Rays of four views of 512 x 512 pixels, against a tolerance of 1e-7:", "\n".join(head + body)]
    return "\n\n".join(lines) + "\n"


def _front(found: Sequence[Measured]) -> tuple[list[int], int]:
    costs, errors = [m.run.total_s for m in found], [m.chamfer_mm for m in found]
    front = pareto(costs, errors).tolist()
    return front, knee([costs[i] for i in front], [errors[i] for i in front]) if front else 0


def _name(measured: Measured) -> str:
    run = measured.run
    return run.value if run.knob in ("", "quality") else f"{run.knob}={run.value}"


def plot(found: Sequence[Measured], folder: Path, figure: str) -> None:
    """Two pictures: error against seconds with the front, and each knob by itself."""
    import matplotlib

    matplotlib.use("Agg")
    _plot_front(found, folder / f"{figure}-front.png")
    _plot_knobs(found, folder / f"{figure}-knobs.png")


def _plot_front(found: Sequence[Measured], path: Path) -> None:
    from matplotlib.figure import Figure as Plot

    front, best = _front(found)
    plot = Plot(figsize=(8, 5), layout="constrained")
    axes = plot.add_subplot()
    known = [m for m in found if np.isfinite(m.chamfer_mm)]
    presets = [m for m in known if m.run.knob in ("", "quality")]
    axes.plot([found[i].run.total_s for i in front], [found[i].chamfer_mm for i in front], color="0.75", zorder=1)
    others = [m for m in known if m not in presets]
    axes.scatter([m.run.total_s for m in others], [m.chamfer_mm for m in others], s=18, color="tab:blue", zorder=2)
    axes.scatter([m.run.total_s for m in presets], [m.chamfer_mm for m in presets], s=60, color="tab:red", zorder=3)
    for m in known:
        weight = "bold" if m in presets or m is found[front[best]] else "normal"
        axes.annotate(_name(m), (m.run.total_s, m.chamfer_mm), (4, 3), textcoords="offset points", fontsize=7,
                      fontweight=weight)  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlabel("seconds, all stages")
    axes.set_ylabel("mean distance to the finest, mm")
    axes.set_title("Presets red; the grey line is the Pareto front", fontsize="medium")
    plot.savefig(path, dpi=110)


def _plot_knobs(found: Sequence[Measured], path: Path) -> None:
    from matplotlib.figure import Figure as Plot

    knobs = [knob for knob in KNOBS if any(m.run.knob == knob for m in found) and knob != "quality"]
    standard = next(m for m in found if m.run.knob == "")
    plot = Plot(figsize=(3.1 * 4, 2.6 * -(-len(knobs) // 4)), layout="constrained")
    for index, knob in enumerate(knobs):
        own = [m for m in found if m.run.knob == knob]
        points = sorted([*own, standard], key=lambda m: m.run.total_s)
        axes = plot.add_subplot(-(-len(knobs) // 4), 4, index + 1)
        by_texture = knob in ("texture_size", "textures")
        errors = [1 - m.run.front_ssim if by_texture else m.chamfer_mm for m in points]
        axes.plot([m.run.total_s for m in points], errors, marker="o", markersize=4)
        for m, error in zip(points, errors, strict=True):
            label = m.run.value if m is not standard else "standard"
            axes.annotate(label, (m.run.total_s, error), (3, 3), textcoords="offset points", fontsize=7)
        axes.set_title(knob, fontsize="medium")
        axes.set_xlabel("seconds", fontsize="x-small")
        axes.set_ylabel("1 - front SSIM" if by_texture else "chamfer mm", fontsize="x-small")
        axes.tick_params(labelsize="x-small")
    plot.savefig(path, dpi=110)
