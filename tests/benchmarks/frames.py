"""Measure frames a second on a turntable: `python -m tests.benchmarks.frames [OUT.md [VIEWS]]`.

Writes a Markdown table, by default docs/frames.md. Embree (Open3D's RaycastingScene) casts the same rays at the
isosurface mesh of the same field, frame by frame in turn with ours. Machines differ and are noisy: compare ratios
within one run.
"""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

FIGURES = Path(__file__).parents[2] / "examples" / "figures"
SIZES = (256, 512, 1024)
VIEWS = 36
"""Of the turntable."""
MARGIN = 0.01
"""Free border, share of the picture: the figure's height fills the frame."""
CLOSE = 0.45
"""Height of the close-up relative to that."""
CLOSE_SIZE = 512
RUNS = 3
"""Of each frame, the first to warm the caches."""
SPACING = 0.01
"""Of the isosurface, FIGURE units: what the run benchmark uses."""
WANTS = {
    "depth": {},
    "normals": {"with_normals": True},
}


INTRODUCTION = """\
Written by `python -m tests.benchmarks.frames`. Medians over a turntable of {views} orthographic views, best of
{runs} runs each; the figure's height fills the frame, close-ups show {close:.0%} of it. Frames are the geometry that
`fig2mesh render` colours and lights, which [effects.md](effects.md) measures: all have depth, *normals* adds those.
*Embree* is Open3D's `RaycastingScene` with the same rays on the isosurface of the same field, in turn with ours; the
ratio is ours over Embree's, median of pairs. The isosurface's grid has nodes {spacing} units apart, less where limbs
are thin.
"""


@dataclass(frozen=True)
class Subject:
    """body : what frames are made of."""

    name: str
    body: Any


def subjects() -> list[Subject]:
    """The analytic mannequin, and two drawn examples."""
    from fig2mesh.field.analytic import mannequin
    from fig2mesh.field.body import Body

    return [Subject("mannequin", Body(mannequin(64))), drawn("farmer"), drawn("market_woman")]


def drawn(name: str) -> Subject:
    """An example of the repository at standard quality."""
    from fig2mesh.conversion.convert import run_stages
    from fig2mesh.parse.read import read_figure
    from fig2mesh.settings import PRESETS
    from fig2mesh.stages.body import body

    figure = read_figure(FIGURES / name / "image.png", keypoints=FIGURES / name / "keypoints.json")
    done = run_stages(figure, PRESETS["standard"], (body,))
    return Subject(name.replace("_", " "), done.results[body])


def measure(subject: Subject, size: int, close: bool = False, views: int = VIEWS) -> dict[str, float]:
    """Median seconds of a frame for each of `WANTS` and Embree, and counts, over the turntable."""
    import open3d as o3d

    from fig2mesh.field.camera import Camera, framing
    from fig2mesh.render.frame import render_frame

    scene = _scene(subject)
    times: dict[str, list[float]] = {name: [] for name in (*WANTS, "embree")}
    counts, shares = [], []
    for yaw in np.arange(views) * (360.0 / views):
        centre, height = framing(subject.body.bounds(), (size, size), yaw, margin=MARGIN)
        camera = Camera(yaw, size=(size, size), height=height * (CLOSE if close else 1.0), centre=centre)
        rays = camera.rays()
        packed = o3d.core.Tensor.from_numpy(np.concatenate([rays.origins, rays.directions], axis=1))
        frame = None
        for name, want in WANTS.items():
            take = partial(render_frame, subject.body, camera, **want)
            seconds, frame = _timed(take)
            times[name].append(seconds)
        times["embree"].append(_timed(partial(scene.cast_rays, packed))[0])
        counts.append(frame.cells / max(frame.rays, 1))
        shares.append(np.isfinite(frame.depth).mean())
    result = {name: statistics.median(some) for name, some in times.items()}
    result["ratio"] = statistics.median(a / b for a, b in zip(times["normals"], times["embree"], strict=True))
    result["cells"] = statistics.mean(counts)
    result["filled"] = float(np.mean(shares))
    return result


_scenes: dict[str, Any] = {}


def _scene(subject: Subject) -> Any:
    import open3d as o3d

    from fig2mesh.mesh.isosurface import isosurface

    if subject.name not in _scenes:
        mesh = isosurface(subject.body, spacing=SPACING)
        scene = o3d.t.geometry.RaycastingScene()
        vertices = o3d.core.Tensor.from_numpy(np.array(mesh.vertices))
        scene.add_triangles(vertices, o3d.core.Tensor.from_numpy(mesh.faces.astype(np.uint32)))
        _scenes[subject.name] = (scene, len(mesh.faces))
    return _scenes[subject.name][0]


def _timed(job: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of the best of `RUNS` runs, and the result."""
    best, result = float("inf"), None
    for _ in range(RUNS):
        start = time.perf_counter()
        result = job()
        best = min(best, time.perf_counter() - start)
    return best, result


def first_use() -> tuple[float, float]:
    """Processor seconds until the first frame in a fresh process: kernels compiled, and kernels from disk."""
    import tempfile

    script = (
        "import time; from tests.benchmarks.frames import quick; "
        "body, camera = quick(); start = time.process_time(); "
        "from fig2mesh.render.frame import render_frame; "
        "render_frame(body, camera, with_parts=True, with_normals=True); print(time.process_time() - start)"
    )
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        cold, warm = (
            float(
                subprocess.run([sys.executable, "-c", script], env=environment, check=True, capture_output=True).stdout
            )
            for _ in range(2)
        )
    return cold, warm


def quick() -> tuple[Any, Any]:
    """A body and a camera."""
    from fig2mesh.field.analytic import mannequin
    from fig2mesh.field.body import Body
    from fig2mesh.field.camera import Camera

    return Body(mannequin(32)), Camera(0, size=(64, 64))


def preparation(subject: Subject) -> dict[str, float]:
    """Seconds and megabytes of what is made once for a body."""
    from fig2mesh.field.body import Body

    body = Body(subject.body.parts, subject.body.smooth, subject.body.fillets)
    _ = body.grids
    start = time.perf_counter()
    space = body.empty_space
    return {
        "seconds": time.perf_counter() - start,
        "grids": sum(array.nbytes for array in body.grids) / 1e6,
        "space": sum(array.nbytes for array in space) / 1e6,
    }


def report(views: int) -> str:
    """The whole page."""
    load = [os.getloadavg()[0]]
    everything = subjects()
    lines = [
        "# Frames per second",
        "",
        INTRODUCTION.format(views=views, runs=RUNS, close=CLOSE, spacing=SPACING),
        f"{platform.machine()}, {len(os.sched_getaffinity(0))} cores, Python {platform.python_version()}.",
        "",
        "| figure | size | filled | depth /s | normals /s | Embree /s | normals : Embree | cells a ray |",
        "|---|---|---|---|---|---|---|---|",
    ]
    per_size: dict[tuple[int, bool], list[dict[str, float]]] = {}
    for close in (False, True):
        load.append(os.getloadavg()[0])
        for size in SIZES if not close else (CLOSE_SIZE,):
            for subject in everything:
                found = measure(subject, size, close, views)
                per_size.setdefault((size, close), []).append(found)
                label = f"{subject.name}{', close' if close else ''}"
                lines.append(_row(label, size, found))
                print(lines[-1], file=sys.stderr)
            keys = per_size[size, close][0]
            median = {key: statistics.median(one[key] for one in per_size[size, close]) for key in keys}
            lines.append(_row(f"**median{', close' if close else ''}**", size, median))
    lines += ["", "| figure | triangles of the isosurface | preparation s | grids MB | empty space MB |"]
    lines += ["|---|---|---|---|---|"]
    for subject in everything:
        made = preparation(subject)
        lines.append(
            f"| {subject.name} | {_scenes[subject.name][1]:,} | {made['seconds']:.2f} | {made['grids']:.1f} | "
            f"{made['space']:.1f} |"
        )
    cold, warm = first_use()
    lines += [
        "",
        f"First frame of a process: {cold:.1f} s of CPU time while kernels are compiled, {warm:.1f} afterwards.",
    ]
    load.append(os.getloadavg()[0])
    lines += [
        f"Load of the machine during the run: {', '.join(f'{one:.1f}' for one in load)}; ours alone makes at most 2."
    ]
    return "\n".join(lines) + "\n"


def _row(label: str, size: int, found: dict[str, float]) -> str:
    rates = " | ".join(f"{1 / found[name]:.0f}" for name in ("depth", "normals", "embree"))
    return f"| {label} | {size}² | {found['filled']:.0%} | {rates} | {found['ratio']:.2f} | {found['cells']:.1f} |"


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/frames.md")
    page = report(int(sys.argv[2]) if len(sys.argv) > 2 else VIEWS)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page)
    print(page)
