"""Names of results that say what they were made from: digests of input, settings, code, weights and libraries."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from contextlib import suppress
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any, Final

import exporters
import fig2mesh
import georef
from fig2mesh.libraries import PACKAGES, version
from fig2mesh.settings import FIRST_USE, STAGES, Settings

NO_RESULTS: Final = ("annotate", "globe", "tradeoff", "training", "view")
"""Folders of code that no figure's files depend on."""

OTHER_LIBRARIES: Final = ("pillow", "pyvips", "pyproj")


@cache
def fingerprint() -> str:
    """Digest of everything besides input and settings that results depend on: our code, the weights, libraries."""
    digest = hashlib.sha256()
    for package in (georef, exporters, fig2mesh):
        folder = Path(package.__path__[0])
        for file in sorted(folder.rglob("*")):
            inner = file.relative_to(folder)
            if file.suffix in (".py", ".safetensors", ".tif") and inner.parts[0] not in NO_RESULTS and file.is_file():
                digest.update(inner.as_posix().encode() + file.read_bytes())
    for name in (*PACKAGES.values(), *OTHER_LIBRARIES):
        with suppress(importlib.metadata.PackageNotFoundError):
            digest.update(f"{name} {version(name)}".encode())
    return digest.hexdigest()


def key_of(**facts: Any) -> str:
    """Digest of facts and of the code, 64 hexadecimal digits."""
    text = json.dumps({**facts, "code": fingerprint()}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def stage_keys(figure: str, settings: Settings, normals: bool) -> dict[str, str]:
    """The key of each stage's result.

    figure : digest of the figure, see `fig2mesh.convert.stage_file.figure_digest`; normals : whether the model has them
    """
    values: dict[str, Any] = {**asdict(settings), "normals": normals}
    keys = {}
    for number, stage in enumerate(STAGES):
        matter = {name: values[name] for name, first in FIRST_USE.items() if STAGES.index(first) <= number}
        keys[stage] = key_of(stage=stage, figure=figure, device=settings.device, settings=matter)
    return keys
