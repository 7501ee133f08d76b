"""The knobs and their values, and runs of the pipeline in separate processes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from exporters.asset import TexturedMesh
from fig2mesh.records import Figure
from fig2mesh.settings import PRESETS, Settings
from fig2mesh.skeleton import FIGURE_HEIGHT
from fig2mesh.system.processes import run_apart

FINEST: Final = replace(PRESETS["fine"], voxel=0.004, spacing=0.005, triangles=120_000)
"""Reference of errors: finer than any value of the sweep, except for the texture, which is as fine."""

KNOBS: Final[Mapping[str, tuple[Any, ...]]] = {
    "quality": ("draft", "standard", "fine"),
    "parts": ("outline",),
    "precision": ("bfloat16",),
    "part_nodes": (16, 48),
    "canvas_px": (256, 768),
    "voxel": (0.015, 0.005),
    "spacing": (0.015, 0.006),
    "mesher": ("isosurface",),
    "closing": ("fill",),
    "triangles": (2_000, 6_000, 60_000),
    "texture_size": (512, 2048),
    "textures": ("paper", "none"),
}
"""Knob → values other than the standard preset's; the other knobs stay as in that preset. "quality" changes all."""

# fmt: off
STAGES_OF: Final[Mapping[str, str]] = {
    "parts": "parts", "precision": "parts", "part_nodes": "parts", "canvas_px": "parts", "voxel": "parts",
    "spacing": "cloud", "mesher": "solid", "closing": "solid", "triangles": "simplify", "texture_size": "bake",
    "textures": "textures",
}
# fmt: on
"""Knob → the stage that it affects."""


@dataclass(frozen=True)
class Run:
    """A run of the pipeline and its result.

    knob, value : what differs from the standard preset; "" for that preset itself
    seconds : by stage; peak_mb : largest resident size of the process
    mesh : the model; None where the run failed, for the reason in `failure`
    """

    knob: str
    value: str
    seconds: Mapping[str, float]
    peak_mb: float
    mesh: TexturedMesh | None
    front_ssim: float = float("nan")
    silhouette_iou: float = float("nan")
    failure: str = ""

    @property
    def total_s(self) -> float:
        """Seconds of all stages."""
        return sum(self.seconds.values())


def requests(knobs: Sequence[str]) -> Iterator[tuple[str, str, Settings]]:
    """(knob, value, settings) of every run: the finest, the presets, then each knob's values."""
    yield "finest", "", FINEST
    yield "", "standard", PRESETS["standard"]
    for knob in knobs:
        for value in KNOBS[knob]:
            if knob == "quality":
                if value != "standard":
                    yield knob, value, PRESETS[value]
                continue
            yield knob, str(value), replace(PRESETS["standard"], **{knob: value})


def run(figure: Figure, knob: str, value: str, settings: Settings) -> Run:
    """Run the pipeline and time it; a FigureError is stored, not raised."""
    from fig2mesh.asset_frame import asset_from_figure, on_drawing
    from fig2mesh.conversion.convert import run_stages
    from fig2mesh.conversion.observer import Observer, peak_mb
    from fig2mesh.errors import FigureError
    from fig2mesh.image_frame import image_frame
    from fig2mesh.measure.model import front_similarity, silhouette_iou
    from fig2mesh.stages.lift import lift
    from fig2mesh.stages.model import model
    from fig2mesh.stages.simplify import simplify

    observer = Observer()
    try:
        done = run_stages(figure, settings, (lift, simplify, model), height_m=FIGURE_HEIGHT, observer=observer)
    except FigureError as error:
        return Run(knob, value, observer.seconds, peak_mb(), None, failure=str(error))
    peak = peak_mb()
    mesh = done.results[model][0]
    transform = asset_from_figure(done.results[lift], done.results[simplify][0].vertices, FIGURE_HEIGHT)
    pixel, origin = on_drawing(image_frame(done.figure), transform)
    ssim = float("nan")
    if mesh.texture is not None:
        found = front_similarity(mesh, done.figure.rgba, done.figure.mask, metres_per_pixel=pixel, origin_px=origin)
        ssim = found.ssim
    iou = silhouette_iou(mesh, done.figure.mask, metres_per_pixel=pixel, origin_px=origin)
    return Run(knob, value, observer.seconds, peak, mesh, ssim, iou)


def sweep(paths: Mapping[str, Path | None], knobs: Sequence[str]) -> Iterator[Run]:
    """Yield every run, each in a fresh process, one at a time, so that no run profits from the caches of another.

    paths : keyword arguments of `read_figure`, the picture as "path"
    """
    for knob, value, settings in requests(knobs):
        yield run_apart(_in_process, dict(paths), knob, value, settings)


def _in_process(paths: dict[str, Any], knob: str, value: str, settings: Settings) -> Run:
    from fig2mesh.parse.read import read_figure

    figure = read_figure(paths.pop("path"), **paths)
    warm_up()
    return run(figure, knob, value, settings)


def warm_up() -> None:
    """Load compiled kernels and libraries, whose cost is the same for every run and not measured."""
    import open3d
    import torch

    from fig2mesh.field.analytic import mannequin
    from fig2mesh.field.body import Body
    from fig2mesh.field.camera import orthographic
    from fig2mesh.field.trace import trace

    assert open3d.__version__
    assert torch.__version__
    body = Body(mannequin(16))
    trace(body, orthographic(0.0, size=(16, 16), height=2.0))
    body.project(np.zeros((4, 3), np.float32))
