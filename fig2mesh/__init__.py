"""Drawn human figures from pictorial maps as closed, textured, georeferenced 3D models.

    import fig2mesh

    request = fig2mesh.Request("farmer.png", lonlat=(8.5417, 47.3769), quality="draft")
    model = fig2mesh.convert(request)
    fig2mesh.write(model, "farmer.glb")

Everything below is imported on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from fig2mesh.conversion.libraries import __version__

if TYPE_CHECKING:
    from exporters.validate import validate
    from fig2mesh.conversion.convert import Conversion, convert
    from fig2mesh.conversion.outputs import write
    from fig2mesh.conversion.request import Request
    from fig2mesh.errors import InputError
    from fig2mesh.parse.read import read_figure
    from fig2mesh.parse.sheet import find_figures
    from fig2mesh.records import Figure
    from fig2mesh.settings import Settings

__all__ = [
    "Conversion",
    "Figure",
    "InputError",
    "Request",
    "Settings",
    "__version__",
    "convert",
    "find_figures",
    "read_figure",
    "validate",
    "write",
]

_MODULES = {
    "Conversion": "fig2mesh.conversion.convert",
    "Figure": "fig2mesh.records",
    "InputError": "fig2mesh.errors",
    "Request": "fig2mesh.conversion.request",
    "Settings": "fig2mesh.settings",
    "convert": "fig2mesh.conversion.convert",
    "find_figures": "fig2mesh.parse.sheet",
    "read_figure": "fig2mesh.parse.read",
    "validate": "exporters.validate",
    "write": "fig2mesh.conversion.outputs",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
