"""Joints files: any JSON at all, and any value in any place of a sound file, is read or refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fig2mesh.errors import FigureError
from fig2mesh.parse.joint_writers import WRITERS
from fig2mesh.parse.keypoints import read_keypoints
from fig2mesh.skeleton import JOINT_NAMES

NUMBERS = st.floats() | st.integers()
KEYS = st.sampled_from(
    [
        "keypoints",
        "annotations",
        "categories",
        "images",
        "shapes",
        "objects",
        "points",
        "exterior",
        "nodes",
        "loc",
        "label",
        "width",
        "height",
        "size",
        "depth_order",
        "id",
        "l_arm",
        *JOINT_NAMES,
    ]
) | st.text(max_size=5)
ANYTHING = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=6),
    max_leaves=30,
)
POINTS = np.arange(42, dtype=np.float32).reshape(21, 2)
SOUND = [write(POINTS, np.ones(21, np.bool_), (100, 100), "figure.png") for write in WRITERS.values()]
QUICK = settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


def read(path: Path, document: Any) -> None:
    path.write_text(json.dumps(document))
    message = ""
    try:
        assert np.isfinite(read_keypoints(path, "figure.png").points_px).all()
    except FigureError as error:
        message = str(error)
    assert message.isprintable()


@given(ANYTHING)
@QUICK
def test_any_document(tmp_path: Path, document: Any) -> None:
    read(tmp_path / "joints.json", document)


@given(st.data())
@QUICK
def test_anything_in_any_place(tmp_path: Path, data: st.DataObject) -> None:
    document = [json.loads(json.dumps(data.draw(st.sampled_from(SOUND))))]
    where, key = document, 0
    for _ in range(data.draw(st.integers(1, 6))):
        inner = where[key]
        if not isinstance(inner, dict | list) or not inner:
            break
        where, key = inner, data.draw(st.sampled_from(sorted(inner) if isinstance(inner, dict) else range(len(inner))))
    where[key] = data.draw(ANYTHING)
    read(tmp_path / "joints.json", document[0])


@pytest.mark.parametrize("name", WRITERS)
def test_the_sound_ones_are_read(tmp_path: Path, name: str) -> None:
    (tmp_path / "joints.json").write_text(json.dumps(dict(zip(WRITERS, SOUND, strict=True))[name]))
    assert np.abs(read_keypoints(tmp_path / "joints.json", "figure.png").points_px - POINTS).max() < 0.01
