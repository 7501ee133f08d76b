"""The fixture that keeps the worst value of each case, and hands it to whoever writes the table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import pytest

from tests.hard_cases.case import Case, Worst
from tests.hard_cases.figures import Job


@pytest.fixture(autouse=True)
def worst(request: pytest.FixtureRequest) -> Iterator[Worst]:
    mark = request.node.get_closest_marker("hard_case")
    assert mark is not None, "tests in this folder state what they check: @hard_case(...)"
    case: Case = mark.args[0]
    measured = Worst(case)
    yield measured
    request.node.user_properties.append(("hard_case", (request.node.originalname, asdict(case), measured.value)))


@pytest.fixture
def job(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> Job:
    return Job(tmp_path, capfd)
