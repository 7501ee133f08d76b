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
    "depth": {"depth"},
    "normals": {"depth", "normals"},
    "colour": {"colour"},
    "all": {"colour", "depth", "normals", "parts"},
}


INTRODUCTION = """\
Written by `python -m tests.benchmarks.frames`. Medians over a turntable of {views} orthographic views, best of
{runs} runs each; the figure's height fills the frame, close-ups show {close:.0%} of it. *Colour* has normals, drawing,
plain pictures and their blend; *all* adds depth, parts and normals as pictures. *Embree* is Open3D's `RaycastingScene`
with the same rays on the isosurface of the same field, in turn with ours; the ratio is ours over Embree's, median of
pairs. The isosurface's grid has nodes {spacing} units apart, less where limbs are thin. *Processor ms* is the time of
all cores together, which other work on the machine changes less.
"""


@dataclass(frozen=True)
class Subject:
    """body, colours : what frames are made of."""

    name: str
    body: Any
    colours: Any


def subjects() -> list[Subject]:
    """The analytic mannequin in made-up colours, and two drawn examples."""
    from fig2mesh.field.analytic import mannequin
    from fig2mesh.field.body import Body
    from fig2mesh.image_frame import ImageFrame
    from fig2mesh.render.surface_colours import surface_colours
    from fig2mesh.texture.sources import Sources

    body = Body(mannequin(64))
    rows, columns = np.mgrid[0:1000, 0:1000].astype(np.float32)
    plain = {part: np.full((500, 500, 3), 16.0 * part, np.float32) for part in range(1, 15)}
    sources = Sources(np.stack([rows % 255, columns % 255, 128 + 0 * rows], axis=-1), plain, 0.5)
    colours = surface_colours(body, sources, ImageFrame((500.0, 500.0), 0.002))
    return [Subject("mannequin", body, colours), drawn("farmer"), drawn("market_woman")]


def drawn(name: str) -> Subject:
    """An example of the repository at standard quality."""
    from fig2mesh.conversion.convert import run_stages
    from fig2mesh.image_frame import image_frame
    from fig2mesh.parse.read import read_figure
    from fig2mesh.render.surface_colours import surface_colours
    from fig2mesh.settings import PRESETS
    from fig2mesh.stages.body import body
    from fig2mesh.stages.textures import textures

    figure = read_figure(FIGURES / name / "image.png", keypoints=FIGURES / name / "keypoints.json")
    done = run_stages(figure, PRESETS["standard"], (body, textures))
    colours = surface_colours(done.results[body], done.results[textures], image_frame(done.figure))
    return Subject(name.replace("_", " "), done.results[body], colours)


def measure(subject: Subject, size: int, close: bool = False, views: int = VIEWS) -> dict[str, float]:
    """Median seconds of a frame for each of `WANTS` and Embree, and counts, over the turntable."""
    import open3d as o3d

    from fig2mesh.field.camera import framing
    from fig2mesh.render.frame import FrameCamera, render_frame

    scene = _scene(subject)
    times: dict[str, list[float]] = {name: [] for name in (*WANTS, "embree")}
    counts, shares, spent = [], [], []
    for yaw in np.arange(views) * (360.0 / views):
        centre, height = framing(subject.body.bounds(), (size, size), yaw, margin=MARGIN)
        camera = FrameCamera(yaw, size=(size, size), height=height * (CLOSE if close else 1.0), centre=centre)
        rays = camera.rays()
        packed = o3d.core.Tensor.from_numpy(np.concatenate([rays.origins, rays.directions], axis=1))
        frame = None
        for name, want in WANTS.items():
            take = partial(render_frame, subject.body, camera, colours=subject.colours, want=want)
            busy = time.process_time()
            seconds, frame = _timed(take)
            times[name].append(seconds)
            if name == "colour":
                spent.append((time.process_time() - busy) / RUNS)
        times["embree"].append(_timed(partial(scene.cast_rays, packed))[0])
        counts.append((frame.counts.cells / max(frame.counts.rays, 1), frame.counts.rays / size**2))
        shares.append(np.isfinite(frame.depth).mean())
    result = {name: statistics.median(some) for name, some in times.items()}
    result["ratio"] = statistics.median(a / b for a, b in zip(times["colour"], times["embree"], strict=True))
    result["ratio_normals"] = statistics.median(a / b for a, b in zip(times["normals"], times["embree"], strict=True))
    result["cells"] = statistics.mean(cells for cells, _ in counts)
    result["processor"] = statistics.median(spent)
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
    """Seconds until the first coloured frame in a fresh process: kernels compiled, and kernels from disk."""
    import tempfile

    script = (
        "import time; from tests.benchmarks.frames import quick; "
        "body, colours = quick(); start = time.perf_counter(); "
        "from fig2mesh.render.frame import FrameCamera, render_frame; "
        "render_frame(body, FrameCamera(0, size=(64, 64)), colours=colours()); print(time.perf_counter() - start)"
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


def quick() -> tuple[Any, Callable[[], Any]]:
    """A body, and how its colours are made."""
    from fig2mesh.field.analytic import mannequin
    from fig2mesh.field.body import Body
    from fig2mesh.image_frame import ImageFrame
    from fig2mesh.render.surface_colours import surface_colours
    from fig2mesh.texture.sources import Sources

    body = Body(mannequin(32))
    sources = Sources(np.zeros((50, 50, 3), np.float32), {1: np.zeros((50, 50, 3), np.float32)}, 1.0)
    return body, lambda: surface_colours(body, sources, ImageFrame((25.0, 25.0), 0.04))


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
        "colours": subject.colours.megabytes,
    }


def report(views: int) -> str:
    """The whole page."""
    load = [os.getloadavg()[0]]
    everything = subjects()
    lines = [
        "# Frames a second",
        "",
        INTRODUCTION.format(views=views, runs=RUNS, close=CLOSE, spacing=SPACING),
        f"{platform.machine()}, {len(os.sched_getaffinity(0))} cores, Python {platform.python_version()}.",
        "",
        "| figure | size | filled | depth /s | normals /s | colour /s | all /s | Embree /s | colour : Embree "
        "| normals : Embree | colour, processor ms | cells a ray |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
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
    lines += ["", "| figure | triangles of the isosurface | preparation s | grids MB | empty space MB | pictures MB |"]
    lines += ["|---|---|---|---|---|---|"]
    for subject in everything:
        made = preparation(subject)
        lines.append(
            f"| {subject.name} | {_scenes[subject.name][1]:,} | {made['seconds']:.2f} | {made['grids']:.1f} | "
            f"{made['space']:.1f} | {made['colours']:.1f} |"
        )
    cold, warm = first_use()
    lines += [
        "",
        f"First coloured frame of a process: {cold:.1f} s while kernels are compiled, {warm:.1f} s from then on.",
    ]
    load.append(os.getloadavg()[0])
    lines += [f"Load of the machine on the way: {', '.join(f'{one:.1f}' for one in load)}; ours alone makes at most 2."]
    return "\n".join(lines) + "\n"


def _row(label: str, size: int, found: dict[str, float]) -> str:
    rates = " | ".join(f"{1 / found[name]:.0f}" for name in ("depth", "normals", "colour", "all", "embree"))
    return (
        f"| {label} | {size}² | {found['filled']:.0%} | {rates} | {found['ratio']:.2f} | {found['ratio_normals']:.2f} "
        f"| {1e3 * found['processor']:.1f} | {found['cells']:.1f} |"
    )


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/frames.md")
    page = report(int(sys.argv[2]) if len(sys.argv) > 2 else VIEWS)
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page)
    print(page)
