"""Is everything there that the pipeline needs?"""

from __future__ import annotations

import importlib
import importlib.metadata
from collections.abc import Iterator

SYSTEM_LIBRARIES = "apt-get install -y --no-install-recommends libgl1 libegl1 libopengl0 libusb-1.0-0"

# fmt: off
PACKAGES = {
    "numpy": "numpy", "scipy": "scipy", "numba": "numba", "torch": "torch", "open3d": "open3d-cpu",
    "pymeshlab": "pymeshlab", "fast_simplification": "fast-simplification", "xatlas": "xatlas", "trimesh": "trimesh",
    "pxr": "usd-core", "pyproj": "pyproj", "skimage": "scikit-image", "safetensors": "safetensors",
}
# fmt: on


def examine() -> Iterator[tuple[str, bool, str]]:
    """Yield (name, whether it works, version or reason) for every library."""
    for module, distribution in PACKAGES.items():
        try:
            importlib.import_module(module)
        except Exception as error:
            reason = " ".join(str(error).split())
            remedy = f"; run: {SYSTEM_LIBRARIES}" if "lib" in reason and ".so" in reason else ""
            yield distribution, False, f"{reason[:200]}{remedy}"
            continue
        yield distribution, True, version(distribution)
    yield _filters()
    yield _weights()
    yield _gpu()


def _filters() -> tuple[str, bool, str]:
    """Without libOpenGL importing pymeshlab succeeds and the filters are silently missing."""
    try:
        import pymeshlab

        usable = hasattr(pymeshlab.MeshSet(), "meshing_close_holes")
    except ImportError:
        usable = False
    return "pymeshlab filters", usable, "loaded" if usable else f"missing; run: {SYSTEM_LIBRARIES}"


def _weights() -> tuple[str, bool, str]:
    try:
        from fig2mesh.nets import figure_parser, part_size, pose_lift, weights
        from fig2mesh.skeleton import KINDS

        figure_parser.load()
        pose_lift.load()
        for kind in KINDS:
            part_size.load(kind)
            weights.load(kind)
    except Exception as error:
        return "weights", False, " ".join(str(error).split())[:200]
    megabytes = sum(path.stat().st_size for path in weights.FOLDER.glob("*.safetensors")) / 1e6
    return "weights", True, f"{megabytes:.0f} MB"


def _gpu() -> tuple[str, bool, str]:
    try:
        import torch

        found = torch.cuda.get_device_name(0) if torch.cuda.is_available() else "none (not needed)"
    except Exception as error:
        return "GPU", False, " ".join(str(error).split())[:200]
    return "GPU", True, found


def version(distribution: str) -> str:
    """Version of an installed distribution, "" where it is not installed; Open3D has two names."""
    for name in (distribution, distribution.removesuffix("-cpu")):
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return ""
