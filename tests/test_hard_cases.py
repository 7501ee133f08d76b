"""docs/hard_cases.md is the output of a run of the hard cases that are there now."""

from __future__ import annotations

import importlib
import inspect
from pathlib import Path

import pytest

from tests.hard_cases.case import Case
from tests.hard_cases.table import ELSEWHERE, SECTIONS, Row, cells

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("module", SECTIONS)
def test_every_case_is_in_the_table_as_it_is(module: str) -> None:
    document = (ROOT / "docs" / "hard_cases.md").read_text(encoding="utf-8")
    loaded = importlib.import_module(f"tests.hard_cases.{module}")
    tests = {name: test for name, test in inspect.getmembers(loaded, callable) if name.startswith("test_")}
    assert tests
    for name, test in tests.items():
        case: Case = next(mark.args[0] for mark in test.pytestmark if mark.name == "hard_case")
        title, *texts, _ = cells(Row(module, name, case))
        assert f"| {title}" in document
        for cell in texts:
            assert f"| {cell} |" in document, f"{name} has changed: write the table again"


@pytest.mark.parametrize(("file", "test"), [(file, test) for _, file, test in ELSEWHERE])
def test_cases_held_elsewhere_are_there(file: str, test: str) -> None:
    assert f"def {test}(" in (ROOT / file).read_text(encoding="utf-8")
