"""Files of every combination of options that affect them pass all validators.

All pairs of options are covered, as faults of writers come from two things that meet.
"""

from __future__ import annotations

import itertools
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exporters.asset import Asset, TexturedMesh
from exporters.profiles import PROFILES, TILES, profile_named
from exporters.validate import validate
from exporters.write import write
from tests.exporters.analytic import PART_NAMES, RADIUS, ZURICH, asset, capsule
from tests.node import RunScript
from tests.pairwise import Choice, pairwise

OPTIONS: dict[str, list[Any]] = {
    "format": [".glb", ".gltf", ".usda", ".usdc", ".usdz", ".ply", ".obj", TILES],
    "profile": [None, *PROFILES],
    "surface": ["texture", "grey texture", "vertex colours", "bare"],
    "evidence": [True, False],
    "lit": [True, False],
    "placed": [True, False],
    "lods": [1, 2, 3],
    "credit": ["© Zürich map, CC BY 4.0", ""],
}


def _allowed(choice: Choice) -> bool:
    reads = profile_named(choice["profile"]).reads
    return (not reads or choice["format"] in reads) and (choice["placed"] or choice["format"] != TILES)


COMBINATIONS = pairwise(OPTIONS, _allowed)


def _level(choice: Choice, columns: int, rings: int, deviation: float) -> TexturedMesh:
    changes: dict[str, Any] = {"deviation_m": (deviation / 2, deviation)}
    whole = capsule(columns, rings)
    if choice["surface"] in ("vertex colours", "bare"):
        changes |= {"texture": None, "uv": None, "observed": None}
    if choice["surface"] == "vertex colours":
        ramp = np.linspace(0, 255, len(whole.vertices)).astype(np.uint8)
        changes["colors"] = np.stack([ramp, ramp[::-1], np.full_like(ramp, 90)], axis=1)
    if choice["surface"] == "grey texture":
        changes["texture"] = type(whole.texture)(whole.texture.pixels[:62, :, :1])  # no multiples of four either
    if not choice["evidence"]:
        changes |= {"parts": None, "observed": None}
    if not choice["lit"]:
        changes["normals"] = None
    return capsule(columns, rings, **changes)


def made(choice: Choice) -> Asset:
    """The asset of a combination."""
    steps = [(12, 3, 0.0), (8, 2, RADIUS / 20), (6, 2, RADIUS / 8)][: choice["lods"]]
    return asset(
        ZURICH if choice["placed"] else None,
        lods=tuple(_level(choice, *step) for step in steps),
        part_names=PART_NAMES if choice["evidence"] else {},
        copyright=choice["credit"],
        lit=choice["lit"],
    )


def test_all_pairs_are_there() -> None:
    found = Counter(
        ((one, choice[one]), (two, choice[two]))
        for choice in COMBINATIONS
        for one, two in itertools.combinations(OPTIONS, 2)
    )
    every = [dict(zip(OPTIONS, values, strict=True)) for values in itertools.product(*OPTIONS.values())]
    possible = {
        ((one, choice[one]), (two, choice[two]))
        for choice in every
        if _allowed(choice)
        for one, two in itertools.combinations(OPTIONS, 2)
    }
    assert set(found) == possible
    assert len(COMBINATIONS) < len(every) / 100


@pytest.mark.slow
def test_validators_are_clean(tmp_path: Path, node: RunScript, codecs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NODE_PATH", str(codecs))
    models: list[Path] = []
    for number, choice in enumerate(COMBINATIONS):
        folder = tmp_path / str(number)
        target = folder / ("tiles" if choice["format"] == TILES else "figure" + choice["format"])
        files = write(made(choice), target, profile=profile_named(choice["profile"]))
        worse = [finding for finding in validate(target, external=False) if finding.severity != "info"]
        assert worse == [], choice
        models += [file for file in files if file.suffix in (".glb", ".gltf")]
    assert len(models) >= 20
    for model, report in zip(models, node("validate_gltf.mjs", *models), strict=True):
        # The validator does not support KTX 2 and reports each such image twice.
        issues = [
            message
            for message in report["issues"]["messages"]
            if message["severity"] < 2 and not _about_ktx2(message, model)
        ]
        assert issues == [], COMBINATIONS[int(model.relative_to(tmp_path).parts[0])]


def _about_ktx2(message: dict[str, Any], model: Path) -> bool:
    return message.get("pointer", "").startswith("/images/0") and b"image/ktx2" in model.read_bytes()
