"""Report of a sweep as CSV, plots and a page."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from fig2mesh.settings import PRESETS
from fig2mesh.tradeoff.measures import MeasuredRun, knee, pareto
from fig2mesh.tradeoff.sweep import KNOBS, STAGES_OF
from fig2mesh.tradeoff.tolerance import Tolerance

# fmt: off
COLUMNS: Final = (
    "figure", "knob", "value", "seconds", "stage_seconds", "peak_mb", "chamfer_mm", "hausdorff_mm", "normal_deg",
    "silhouette_iou", "front_ssim", "triangles", "failure",
)
# fmt: on


CROWD: Final = 0.15
"""Threshold of the natural logarithm of the ratio of errors for a run to be close to the standard preset."""


def rows(figure: str, found: Sequence[MeasuredRun]) -> list[dict[str, Any]]:
    """Rows of the table, one per run; missing numbers are empty."""
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


def summary(figure: str, found: Sequence[MeasuredRun], tolerances: Sequence[Tolerance], machine: str) -> str:
    """Page of one figure, Markdown: the knee, the presets, every knob."""
    front, best = _front(found)
    named = [_name(found[i]) for i in front]
    chosen = found[front[best]]
    lines = [
        f"## {figure}",
        f"Measured on {machine}; seconds of one run, errors against the finest setting of a figure 1.79 m high.",
        f"**The knee is `{_name(chosen)}`**: {chosen.run.total_s:.1f} s for {chosen.chamfer_mm:.2f} mm. "
        f"On the Pareto front, by rising time: {', '.join(f'`{name}`' for name in named)}.",
        f"![Error against seconds]({figure}-front.png)",
        *([f"![Every knob]({figure}-knobs.png)"] if any(m.run.knob in STAGES_OF for m in found) else []),
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
        head = [
            "| tolerance of the tracer | mean depth error mm | greatest mm | cells a ray | seconds |",
            "|---:|---:|---:|---:|---:|",
        ]
        body = [
            f"| {t.tolerance:g} | {t.mean_mm:.4f} | {t.worst_mm:.3f} | {t.steps:.1f} | {t.seconds:.3f} |"
            for t in tolerances
        ]
        lines += ["Rays of four views of 512 x 512 pixels, against a tolerance of 1e-7:", "\n".join(head + body)]
    return "\n\n".join(lines) + "\n"


def _front(found: Sequence[MeasuredRun]) -> tuple[list[int], int]:
    """Indices of the runs on the Pareto front, and which of them is the knee; models without colours are excluded
    as another product, and the finest because it has no error by definition."""
    rivals = [m.run.knob != "finest" and (m.run.knob, m.run.value) != ("textures", "none") for m in found]
    costs = [m.run.total_s if rival else np.nan for m, rival in zip(found, rivals, strict=True)]
    errors = [m.chamfer_mm for m in found]
    front = pareto(costs, errors).tolist()
    return front, knee([costs[i] for i in front], [errors[i] for i in front]) if front else 0


def _name(measured: MeasuredRun) -> str:
    run = measured.run
    return run.value if run.knob in ("", "quality") else f"{run.knob}={run.value}" if run.value else run.knob


def plot(found: Sequence[MeasuredRun], folder: Path, figure: str) -> None:
    """Write two plots: error against seconds with the front, and each knob separately."""
    import matplotlib

    matplotlib.use("Agg")
    _plot_front(found, folder / f"{figure}-front.png")
    _plot_knobs(found, folder / f"{figure}-knobs.png")


def _plot_front(found: Sequence[MeasuredRun], path: Path) -> None:
    from matplotlib.figure import Figure as Plot
    from matplotlib.ticker import ScalarFormatter

    front, best = _front(found)
    standard = next(m for m in found if m.run.knob == "")
    plot = Plot(figsize=(9, 5.5), layout="constrained")
    axes = plot.add_subplot()
    axes.plot([found[i].run.total_s for i in front], [found[i].chamfer_mm for i in front], color="0.75", zorder=1)
    for i, m in enumerate(found):
        if not m.chamfer_mm > 0 or m.run.knob == "finest":
            continue
        preset = m.run.knob in ("", "quality")
        axes.scatter(
            m.run.total_s, m.chamfer_mm, s=60 if preset else 18, color="tab:red" if preset else "tab:blue", zorder=2
        )
        # Labels close to the standard preset would only hide it.
        apart = abs(np.log(m.chamfer_mm / standard.chamfer_mm)) > CROWD
        if preset or apart or i in front:
            weight = "bold" if preset or i == front[best] else "normal"
            axes.annotate(
                _name(m),
                (m.run.total_s, m.chamfer_mm),
                (5, 4),
                textcoords="offset points",
                fontsize=8,
                fontweight=weight,
            )
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(ScalarFormatter())
    axes.tick_params(labelsize="small", which="both")
    axes.set_xlabel("seconds, all stages")
    axes.set_ylabel("mean distance to the finest, mm")
    axes.set_title("Presets red, the Pareto front grey; unnamed: close to standard in error", fontsize="medium")
    plot.savefig(path, dpi=110)


def _plot_knobs(found: Sequence[MeasuredRun], path: Path) -> None:
    from matplotlib.figure import Figure as Plot

    knobs = [knob for knob in KNOBS if any(m.run.knob == knob for m in found) and knob != "quality"]
    if not knobs:
        return
    standard = next(m for m in found if m.run.knob == "")
    plot = Plot(figsize=(13, 2.7 * -(-len(knobs) // 4)), layout="constrained")
    for index, knob in enumerate(knobs):
        own = str(getattr(PRESETS["standard"], knob))
        points = {m.run.value: m for m in found if m.run.knob == knob} | {own: standard}
        names = sorted(points, key=_order)
        by_texture = knob in ("texture_size", "textures")
        errors = [1 - points[name].run.front_ssim if by_texture else points[name].chamfer_mm for name in names]
        seconds = [points[name].run.seconds.get(STAGES_OF[knob], 0.0) for name in names]
        axes = plot.add_subplot(-(-len(knobs) // 4), 4, index + 1)
        axes.plot(names, errors, marker="o", markersize=4, color="tab:blue")
        axes.set_ylim(bottom=0)
        axes.set_title(f"{knob} (standard: {own})", fontsize="medium")
        axes.set_ylabel("1 - front SSIM" if by_texture else "chamfer mm", fontsize="x-small", color="tab:blue")
        beside = axes.twinx()
        beside.plot(names, seconds, marker="s", markersize=4, color="tab:orange", linestyle="--")
        beside.set_ylim(bottom=0)
        beside.set_ylabel(f"seconds of {STAGES_OF[knob]}", fontsize="x-small", color="tab:orange")
        for each in (axes, beside):
            each.tick_params(labelsize="x-small")
    plot.savefig(path, dpi=110)


def _order(value: str) -> tuple[float, str]:
    """Sort key: numbers by size, then words."""
    try:
        return float(value), ""
    except ValueError:
        return float("inf"), value
