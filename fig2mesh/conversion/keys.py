"""Keys of results: digests of everything they are made from, that is input, settings, code, weights and libraries."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

import exporters
import georef
from fig2mesh.conversion.libraries import PACKAGES, version
from fig2mesh.records import Figure
from fig2mesh.settings import Settings
from fig2mesh.stages.stage import Stage

NO_RESULTS: Final = ("annotate", "globe", "tradeoff", "training", "view")
"""Folders of code that no figure's files depend on."""

OTHER_LIBRARIES: Final = ("pillow", "pyvips", "pyproj")


@cache
def fingerprint() -> str:
    """Digest of everything besides input and settings that results depend on: code, weights and libraries."""
    digest = hashlib.sha256()
    # Not by importing fig2mesh, whose __init__ imports this module.
    folders = (Path(georef.__path__[0]), Path(exporters.__path__[0]), Path(__file__).parents[1])
    for folder in folders:
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


def stage_keys(stages: Sequence[Stage], settings: Settings, inputs: Mapping[str, str]) -> dict[str, str]:
    """Key of each stage's result, from the keys of what it needs and the settings that it reads.

    inputs : key of each input of the pipeline
    """
    keys = dict(inputs)
    for stage in stages:
        read = {name: getattr(settings, name) for name in stage.reads}
        keys[stage.name] = key_of(stage=stage.name, needs=[keys[name] for name in stage.needs], settings=read)
    return {stage.name: keys[stage.name] for stage in stages}


def figure_digest(figure: Figure) -> str:
    """Digest of a figure's arrays, 64 hexadecimal digits; its name and its position in the picture do not count."""
    digest = hashlib.sha256()
    for array in (figure.rgba, figure.mask, figure.joints_px, figure.visible, figure.part_labels):
        digest.update(str(array.shape).encode() + array.tobytes())
    digest.update(repr(sorted(figure.depth_order.items())).encode())
    return digest.hexdigest()
