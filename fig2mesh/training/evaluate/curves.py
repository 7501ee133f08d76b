"""Learning curves of trained runs in one picture, for the evaluation."""

from __future__ import annotations

import csv
from pathlib import Path

from exporters.atomic_file import atomic_path


def plot_runs(runs: Path, out: Path) -> bool:
    """Draw the scores on held-out bodies of all runs under a folder over the samples seen; False where there are none.

    Part networks: mean error of the distance at stored points of held-out bodies; pose networks: RMSE.
    False as well where matplotlib is missing.
    """
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    from matplotlib import pyplot

    logs = sorted(runs.rglob("log.csv"))
    panels = {"valid_l1": "part networks: mean error, PART units", "valid_rmse_mm": "pose networks: RMSE, mm"}
    figure, axes = pyplot.subplots(1, 2, figsize=(13, 5))
    drawn = False
    for axis, (column, title) in zip(axes, panels.items(), strict=True):
        for log in logs:
            with log.open(newline="") as stream:
                rows = [row for row in csv.DictReader(stream) if row.get(column)]
            if not rows or "table2" in log.parts:
                continue
            name = log.parent.relative_to(runs).as_posix().removesuffix("-two-stream-pose").removeprefix("disn-")
            axis.plot([float(row["samples"]) for row in rows], [float(row[column]) for row in rows], label=name)
            drawn = True
        axis.set(title=title, xlabel="samples", yscale="log")
        axis.legend(fontsize=7, ncols=2)
        axis.grid(alpha=0.3, which="both")
    if not drawn:
        pyplot.close(figure)
        return False
    figure.tight_layout()
    with atomic_path(out) as partial:
        figure.savefig(partial, dpi=80)
    pyplot.close(figure)
    return True
