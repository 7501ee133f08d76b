"""`--report`: what was made, how long it took, and how good it is by measures taken on the result itself."""

from __future__ import annotations

import platform
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from exporters.asset import Asset
from exporters.file_digest import sha256_of
from exporters.sampling import observed_shares
from fig2mesh import __version__
from fig2mesh.asset_frame import asset_from_figure, on_drawing
from fig2mesh.image_frame import image_frame
from fig2mesh.libraries import PACKAGES, version
from fig2mesh.measure.model import front_similarity, shape_measures, silhouette_iou
from fig2mesh.settings import Settings
from fig2mesh.skeleton import PART_NAMES


@dataclass(frozen=True)
class Timing:
    """seconds of wall clock for one stage; peak_mb: largest resident size of the process until its end, MiB;
    why : it was run, or not."""

    name: str
    seconds: float
    peak_mb: float
    why: str
    runs: bool = True

    def as_dict(self) -> dict[str, Any]:
        return {
            "stage": self.name,
            "seconds": round(self.seconds, 4),
            "peak_mb": round(self.peak_mb, 1),
            "run": self.runs,
            "why": self.why,
        }


def make_report(
    inputs: list[Path],
    outputs: list[Path],
    asset: Asset,
    results: dict[str, Any],
    settings: Settings,
    height_m: float,
) -> dict[str, Any]:
    """Everything but the timings; inputs and outputs with their hashes, the figure first.

    The silhouette and the front view are measured on the finest textured mesh as it goes to the exporters, rendered
    orthographically at the drawing's resolution.
    """
    return {
        "fig2mesh": __version__,
        "figure": {"file": inputs[0].name, "pieces": results["pieces"]},
        "inputs": {str(path): sha256_of(path) for path in inputs},
        "outputs": {str(path): sha256_of(path) for path in outputs},
        "settings": asdict(settings),
        "placement": asdict(asset.placement) if asset.placement else None,
        "measures": model_measures(asset, results, height_m),
        "lods": [
            {"triangles": len(m.faces), "mean_deviation_m": m.deviation_m[0], "max_deviation_m": m.deviation_m[1]}
            for m in asset.lods
        ],
        "meshing": asdict(results["solid"].how),
        "versions": {name: version(name) for name in PACKAGES.values()},
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
    }


def model_measures(asset: Asset, results: dict[str, Any], height_m: float) -> dict[str, Any]:
    """How good a model is, by measures taken on the asset that goes to the exporters.

    results : of the pipeline: figure, pieces, lift, simplify, model
    """
    figure = results["figure"]
    frame = image_frame(figure)
    transform = asset_from_figure(results["lift"], results["simplify"][0].vertices, height_m)
    pixel, origin_px = on_drawing(frame, transform)
    front = front_similarity(asset.mesh, figure.rgba, figure.mask, metres_per_pixel=pixel, origin_px=origin_px)
    iou = silhouette_iou(asset.mesh, figure.mask, metres_per_pixel=pixel, origin_px=origin_px)
    shares = observed_shares(results["model"][0])
    observed: dict[str, Any] = {}
    if shares is not None:
        observed = {"front_psnr_db": front.psnr_db, "front_ssim": front.ssim, "observed": _by_name(shares)}
    return {
        **shape_measures(asset.mesh),
        "pieces_drawn": results["pieces"],
        "silhouette_iou": iou,
        **observed,
    }


def _by_name(shares: dict[int, float]) -> dict[str, float]:
    return {PART_NAMES[label]: share for label, share in shares.items()}
