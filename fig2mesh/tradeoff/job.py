"""`fig2mesh tradeoff`: sweep each figure and write the results."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from pathlib import Path

from exporters.atomic_file import sweep_temporary, write_whole
from fig2mesh.errors import InputError, OutputError
from fig2mesh.evaluate.figures import Drawing, drawing_in
from fig2mesh.field.body import Body
from fig2mesh.parse.read import read_figure
from fig2mesh.settings import PRESETS

Log = Callable[[str], None]

PAGE = "README.md"
"""Put in place last, because it refers to the other files."""


def drawings_of(figures: Sequence[Path], keypoints: Path | None, mask: Path | None) -> list[Drawing]:
    """Drawings in folders with image.png, keypoints.json and optionally mask.png, or the drawing of one picture."""
    if (keypoints or mask) and (len(figures) != 1 or figures[0].is_dir()):
        raise InputError("--keypoints", "cannot be combined with several figures or a folder", "give one picture")
    found = []
    for figure in figures:
        if figure.is_dir():
            files = drawing_in(figure)
        else:
            files = Drawing(figure.stem, figure, keypoints or figure.with_name("keypoints.json"), mask)
        # Invalid input is reported before minutes of work.
        read_figure(**files.arguments())
        found.append(files)
    names = [files.name for files in found]
    if len(set(names)) != len(names):
        raise InputError("FIGURE", f"two figures named {max(names, key=names.count)}", "rename one of the folders")
    return found


def tradeoff(figures: Sequence[Drawing], folder: Path, knobs: Sequence[str], overwrite: bool, log: Log) -> None:
    """Sweep all figures; writes tradeoff.csv, README.md and two plots per figure to `folder`, all or none."""
    from fig2mesh.tradeoff.measures import measure
    from fig2mesh.tradeoff.report import as_csv, plot, rows, summary
    from fig2mesh.tradeoff.sweep import requests, sweep
    from fig2mesh.tradeoff.tolerance import tolerances

    sweep_temporary(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())) and not overwrite:
        raise OutputError(
            folder, "already exists and is not an empty folder", "use --overwrite or choose another folder"
        )

    def fill(stage: Path) -> None:
        table, pages = [], []
        count = sum(1 for _ in requests(knobs))
        for files in figures:
            found = []
            finest = None
            for number, run in enumerate(sweep(files.arguments(), knobs), 1):
                label = f"{run.knob} {run.value}".strip()
                log(f"{files.name} {number}/{count} {label}: {run.failure or f'{run.total_s:.1f} s'}")
                if finest is None:
                    finest = run.mesh
                    if finest is None:
                        raise InputError(files.name, run.failure, "give a figure that can be converted")
                    log(f"{files.name}: errors are measured against this one")
                found.append(measure(run, finest))
            table += rows(files.name, found)
            plot(found, stage, files.name)
            pages.append(summary(files.name, found, tolerances(_body(files)), _machine()))
        head = (
            "# What accuracy costs\n\nWritten by `fig2mesh tradeoff`; the numbers are in [tradeoff.csv](tradeoff.csv)."
        )
        (stage / PAGE).write_text("\n\n".join([head, *pages]), encoding="utf-8")
        (stage / "tradeoff.csv").write_text(as_csv(table), encoding="utf-8")

    write_whole(folder, folder / PAGE, fill, overwrite)


def _body(files: Drawing) -> Body:
    from fig2mesh.conversion.convert import run_stages
    from fig2mesh.stages.body import body

    return run_stages(read_figure(**files.arguments()), PRESETS["standard"], (body,)).results[body]


def _machine() -> str:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{cores} cores of {platform.machine()}, {platform.system()}"
