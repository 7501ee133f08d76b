"""Measure time and memory on a shipped figure: `python -m tests.benchmarks.run OUT.json`.

Writes `{name: {value, unit, how}}`. Machines differ and are noisy: compare ratios and medians within one run only.
"""

from __future__ import annotations

import json
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

FIGURE = Path(__file__).parents[2] / "examples" / "figures" / "farmer"


def measure() -> dict[str, dict[str, Any]]:
    """All benchmarks of this version."""
    with tempfile.TemporaryDirectory() as folder:
        return {**whole_figures(Path(folder)), **tracing(), **levels(Path(folder)), **decoding(), **batch(Path(folder))}


def arguments(target: Path, *more: str) -> list[str]:
    figure = [str(FIGURE / "image.png"), "--keypoints", str(FIGURE / "keypoints.json"), "--lonlat", "8.5417", "47.3769"]
    return [*figure, "-o", str(target), "--overwrite", "-q", *more]


def whole_figures(folder: Path) -> dict[str, dict[str, Any]]:
    """The main job in a fresh process, and again in one that has already made a figure."""
    from fig2mesh.commands.main import main

    # Peak memory comes from the report: a child's maximum as the operating system counts it starts at its parent's.
    report = folder / "report.json"
    command = [sys.executable, "-m", "fig2mesh", *arguments(folder / "cold.glb", "--report", str(report))]
    cold, peaks, textures = [], [], []
    for _ in range(3):
        cold.append(_seconds(lambda: subprocess.run(command, check=True)))
        stages = json.loads(report.read_text())["stages"]
        peaks.append(max(stage["peak_mb"] for stage in stages))
        textures.append(sum(stage["seconds"] for stage in stages if stage["stage"] in ("textures", "bake")))

    def warm(quality: str) -> float:
        words = arguments(folder / f"{quality}.glb", "--quality", quality)
        main(words)
        return statistics.median(_seconds(lambda: main(words)) for _ in range(3))

    return {
        "figure_cold_s": _value(statistics.median(cold), "s", "fresh process, standard quality, one GLB, median of 3"),
        "figure_warm_s": _value(warm("standard"), "s", "same process, standard quality, median of 3 after one"),
        "figure_draft_warm_s": _value(warm("draft"), "s", "same process, draft quality, median of 3 after one"),
        "peak_mb": _value(max(peaks), "MiB", "largest resident size of the fresh process, standard quality"),
        "textures_s": _value(statistics.median(textures), "s", "colours and bake, 1024 px, fresh process, median of 3"),
    }


def tracing() -> dict[str, dict[str, Any]]:
    """Frames per second of a turntable with normals and colours, and of Embree on the isosurface of the same field."""
    from tests.benchmarks.frames import VIEWS, drawn, measure

    farmer = drawn("farmer")
    found = {}
    for size in (256, 512):
        seconds = measure(farmer, size)
        how = f"{size}x{size}, trilinear, normals, colours blended, {VIEWS} views of the farmer, median"
        found[f"trace_fps_{size}"] = _value(1.0 / seconds["colour"], "1/s", how)
    how = "time per coloured frame over Embree's on triangles of the isosurface, 512x512, median of pairs"
    return {**found, "embree_ratio_512": _value(seconds["ratio"], "1", how)}


def levels(folder: Path) -> dict[str, dict[str, Any]]:
    """Mean distance of a 5,000-triangle model to the full mesh."""
    from fig2mesh.commands.main import main

    report = folder / "lod.json"
    main(arguments(folder / "lod.glb", "--triangles", "5000", "--report", str(report)))
    mean = json.loads(report.read_text())["lods"][0]["mean_deviation_m"]
    return {"lod5k_mean_mm": _value(1000 * mean, "mm", "5,000 triangles against the full mesh, 1.79 m figure")}


def decoding() -> dict[str, dict[str, Any]]:
    """The 14 part fields of the farmer, coarse to fine and, a few parts only, node by node."""
    from fig2mesh.image_frame import image_frame
    from fig2mesh.nets.decode import decode_counted, decode_dense
    from fig2mesh.nets.disn import PART_WEIGHTS, DisnShape
    from fig2mesh.parse.read import read_figure
    from fig2mesh.parts.canvas import make_canvas
    from fig2mesh.parts.network import network_inputs, shipped_sizes
    from fig2mesh.parts.split import split
    from fig2mesh.pose.network import lift_by_network
    from fig2mesh.skeleton import PART_KIND

    figure = read_figure(FIGURE / "image.png", keypoints=FIGURE / "keypoints.json")
    frame = image_frame(figure)
    canvas = make_canvas(figure, frame, 448)
    joints = lift_by_network(figure, frame).joints.astype(np.float64)
    inputs = network_inputs(canvas, split(canvas, joints, figure.visible), joints, shipped_sizes())
    work = [
        (PART_WEIGHTS.shipped(DisnShape(PART_KIND[part])), given.mask, given.anchors) for part, given in inputs.items()
    ]
    counts = [decode_counted(*part).evaluated for part in work]
    fast = statistics.median(_seconds(lambda: [decode_counted(*part) for part in work]) for _ in range(3))
    dense = statistics.median(_seconds(lambda: [decode_dense(*part) for part in work]) for _ in range(3))
    share = 100 * sum(counts) / (len(counts) * 64**3)
    return {
        "decode_s": _value(fast, "s", f"14 parts at 64³, {share:.0f} % of the nodes requested; median of 3"),
        "decode_dense_s": _value(dense, "s", "14 parts at 64³, every node; median of 3"),
    }


def batch(folder: Path) -> dict[str, dict[str, Any]]:
    """Two workers over one, a figure of draft quality a row."""
    from tests.benchmarks.batch import speedup

    found = speedup(folder, 12, "draft")["speedup_2"]
    how = "figures a minute with two workers over one, draft quality, 12 rows, after each worker's first"
    return {"batch_speedup_2": _value(found, "1", how)}


def _seconds(job: Callable[[], Any]) -> float:
    start = time.perf_counter()
    job()
    return time.perf_counter() - start


def _value(value: float, unit: str, how: str) -> dict[str, Any]:
    return {"value": round(float(value), 4), "unit": unit, "how": how}


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "build/bench.json")
    target.parent.mkdir(parents=True, exist_ok=True)
    results = measure()
    machine = f"{platform.machine()}, Python {platform.python_version()}"
    target.write_text(json.dumps(results, indent=2) + "\n")
    for name, entry in results.items():
        print(f"{name:22s} {entry['value']:>10g} {entry['unit']:4s} {entry['how']}")
    print(f"written to {target} ({machine})")
