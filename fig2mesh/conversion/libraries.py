"""Version of fig2mesh, and of the libraries that results depend on."""

from __future__ import annotations

import importlib.metadata

__version__ = "0.1.0"

# fmt: off
PACKAGES = {
    "numpy": "numpy", "scipy": "scipy", "numba": "numba", "torch": "torch", "open3d": "open3d-cpu",
    "pymeshlab": "pymeshlab", "fast_simplification": "fast-simplification", "xatlas": "xatlas", "trimesh": "trimesh",
    "pxr": "usd-core", "pyproj": "pyproj", "skimage": "scikit-image", "safetensors": "safetensors",
}
# fmt: on


def version(distribution: str) -> str:
    """Version of an installed distribution, "" where it is not installed; Open3D has two names."""
    for name in (distribution, distribution.removesuffix("-cpu")):
        try:
            return importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return ""
