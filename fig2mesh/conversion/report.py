"""The report of `--report`: files, timings, and measures taken on the result itself."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from exporters.asset import without_outline
from exporters.file_digest import sha256_of
from exporters.sampling import observed_shares
from fig2mesh.asset_frame import asset_from_figure, on_drawing
from fig2mesh.conversion.convert import Conversion
from fig2mesh.conversion.libraries import PACKAGES, __version__, version
from fig2mesh.conversion.observer import Observer
from fig2mesh.counters import Work
from fig2mesh.image_frame import image_frame
from fig2mesh.measure.model import front_similarity, shape_measures, silhouette_iou
from fig2mesh.skeleton import PART_NAMES
from fig2mesh.stages.lift import lift
from fig2mesh.stages.model import model
from fig2mesh.stages.simplify import simplify
from fig2mesh.stages.solid import solid
from fig2mesh.system.surroundings import valid_text


def make_report(
    done: Conversion, outputs: Sequence[Path], observer: Observer, counts: Mapping[Work, int]
) -> dict[str, Any]:
    """Report of a conversion and of the files written, with digests of inputs and outputs.

    The silhouette and the front view are measured on the finest textured mesh as it goes to the exporters, rendered
    orthographically at the drawing's resolution.
    """
    asset, request = done.asset, done.request
    return {
        "fig2mesh": __version__,
        "figure": {"file": valid_text(request.figure.name), "pieces": done.run.pieces},
        "inputs": {valid_text(str(path)): sha256_of(path) for path in request.files},
        "outputs": {valid_text(str(path)): sha256_of(path) for path in outputs},
        "settings": asdict(done.settings),
        "placement": asdict(asset.placement) if asset.placement else None,
        "measures": model_measures(done),
        "lods": [
            {"triangles": len(m.faces), "mean_deviation_m": m.deviation_m[0], "max_deviation_m": m.deviation_m[1]}
            for m in asset.lods
        ],
        "meshing": asdict(done.run.results[solid].how),
        "versions": {name: version(name) for name in PACKAGES.values()},
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        "map": done.placed.map,
        "stages": [timing.as_dict() for timing in observer.timings],
        "effects": [{"effect": each.name, "run": each.runs, "why": each.why} for each in done.plan.effects],
        "counters": dict(counts),
    }


def model_measures(done: Conversion) -> dict[str, Any]:
    """Measures of a model, taken on the asset that goes to the exporters."""
    asset, figure, results = done.asset, done.run.figure, done.run.results
    transform = asset_from_figure(results[lift], results[simplify][0].vertices, done.placed.height_m)
    pixel, origin_px = on_drawing(image_frame(figure), transform)
    front = front_similarity(asset.mesh, figure.rgba, figure.mask, metres_per_pixel=pixel, origin_px=origin_px)
    iou = silhouette_iou(asset.mesh, figure.mask, metres_per_pixel=pixel, origin_px=origin_px)
    shares = observed_shares(results[model][0])
    observed: dict[str, Any] = {}
    if shares is not None:
        observed = {"front_psnr_db": front.psnr_db, "front_ssim": front.ssim, "observed": _by_name(shares)}
    return {
        **shape_measures(without_outline(asset.mesh)),
        "pieces_drawn": done.run.pieces,
        "silhouette_iou": iou,
        **observed,
    }


def _by_name(shares: dict[int, float]) -> dict[str, float]:
    return {PART_NAMES[label]: share for label, share in shares.items()}
