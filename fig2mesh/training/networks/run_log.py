"""Log, curve and scores of a training run, as files of its folder."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from pathlib import Path

from exporters.atomic_file import atomic_path, atomic_text, write_text

LOG = "log.csv"


CURVE = "curve.png"


SCORES = "scores.json"


def write_log(path: Path, rows: list[dict[str, float]]) -> None:
    """Write the rows as CSV, one column per name; replaced as a whole, so that no row of a lost step remains."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with atomic_text(path) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([f"{row[name]:.6g}" if name in row else "" for name in columns] for row in rows)


def write_scores(folder: Path, scores: Mapping[str, float]) -> None:
    """Write the scores of a finished run, whole or not at all."""
    write_text(folder / SCORES, json.dumps(dict(scores), indent=1) + "\n")


def draw_curve(path: Path, rows: list[dict[str, float]]) -> None:
    """Plot losses and scores over the steps; nothing is drawn without matplotlib."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib.figure import Figure
    except ImportError:
        return
    every = dict.fromkeys(name for row in rows for name in row)
    names = [name for name in every if name not in ("step", "seconds", "samples", "rate")]
    pairs = {
        name.removeprefix("valid_"): [n for n in names if n.removeprefix("valid_") == name.removeprefix("valid_")]
        for name in names
    }
    figure = Figure(figsize=(5, 2.2 * len(pairs)), layout="constrained")
    for index, (title, shown) in enumerate(pairs.items()):
        axes = figure.add_subplot(len(pairs), 1, index + 1)
        for name in shown:
            points = [(row["step"], row[name]) for row in rows if name in row]
            axes.plot(*zip(*points, strict=True), label=name, marker="." if name.startswith("valid_") else "")
        if all(row[name] > 0 for name in shown for row in rows if name in row):
            axes.set_yscale("log")
        axes.set_title(title, fontsize="small")
        axes.legend(fontsize="x-small")
    with atomic_path(path) as partial:
        figure.savefig(partial, dpi=80)
