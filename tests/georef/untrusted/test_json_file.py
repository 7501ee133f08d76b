"""JSON from elsewhere: what is let through is what arithmetic, recursion and writing can use."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from georef.errors import MAX_CHARACTERS, InputError, PlacementError, one_line
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import MAX_DEPTH, parse_json, read_json

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**64), 2**64)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), inner),
    max_leaves=20,
)


@given(VALUES, st.booleans(), st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-32"]))
def test_every_document_comes_back(value: Any, ascii_only: bool, coding: str) -> None:
    assert parse_json(json.dumps(value, ensure_ascii=ascii_only).encode(coding)) == value


@given(st.text(alphabet='[]{}":,\\ 1a\u00e9\n', max_size=60))
def test_brackets_in_texts_are_not_counted(text: str) -> None:
    deep = "[" * MAX_DEPTH + json.dumps(text) + "]" * MAX_DEPTH
    assert json.dumps(parse_json(deep)).replace(" ", "") == deep.replace(" ", "") or " " in text
    with pytest.raises(DamagedFile, match="nested too deeply"):
        parse_json(f"[{deep}]")


@given(st.binary(max_size=200))
def test_any_bytes_are_a_document_or_a_one_line_error(data: bytes) -> None:
    message = ""
    try:
        parse_json(data)
    except DamagedFile as error:
        message = str(error)
    assert "\n" not in message


@pytest.mark.parametrize(
    ("text", "finding"),
    [
        ("[NaN]", "NaN is not a number"),
        ("-Infinity", "-Infinity is not a number"),
        ("[1e999]", "beyond the range of float64"),
        ("1" + "0" * 5000, "larger than 2\\^64"),
        ('{"a": 1, "b": {"a": 1}, "a": 2}', "duplicate key 'a'"),
        ('["\\ud800"]', "a lone surrogate"),
        ("[" * 100_000, "nested too deeply"),
        ('{"a":[' * 100_000, "nested too deeply"),
        ("", "not JSON: Expecting value at line 1, column 1"),
        (b"\xff\xff\xff", "not UTF-8 text"),
        (b"\xff\xfe\x00", "not UTF-16 text"),
    ],
)
def test_invalid_documents(text: str | bytes, finding: str) -> None:
    with pytest.raises(DamagedFile, match=finding):
        parse_json(text)


def test_pairs_of_surrogates_are_characters() -> None:
    assert parse_json('"\\ud83d\\ude00"') == "\U0001f600"
    assert math.copysign(1, parse_json("-0.0")) == -1


def test_invalid_files(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    (tmp_path / "round").symlink_to(tmp_path / "round")
    (tmp_path / "large").write_bytes(b" " * 101)
    for name, finding in {
        "pipe": "not a regular file",
        "zero": "not a regular file",
        "": "a folder",
        "gone": "No such file",
        "round": "levels",
        "large": "more than the limit of 0 MB",
    }.items():
        with pytest.raises(PlacementError, match=finding) as caught:
            read_json(tmp_path / name, "give another", PlacementError, max_bytes=100)
        assert str(caught.value).endswith("; give another")


@given(st.text(max_size=3000))
def test_messages_are_one_printable_line(text: str) -> None:
    shown = str(InputError(text, text, text))
    assert shown.isprintable()
    assert len(shown) <= 3 * (MAX_CHARACTERS + 3)
    shown.encode()  # lone surrogates, as in file names that are not Unicode, are gone


def test_paths_and_plain_texts_are_unchanged() -> None:
    assert one_line("C:\\a  b\\ä.png: 3×4 px") == "C:\\a  b\\ä.png: 3×4 px"
    assert one_line("a\n\tb\x1b[2J") == "a b\ufffd[2J"
