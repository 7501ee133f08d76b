"""The same input gives the same bytes, whatever the number of threads."""

from __future__ import annotations

import pytest

from fig2mesh.field.compiled import THREADS_VARIABLE
from tests.hard_cases.case import hard_case
from tests.hard_cases.figures import Job, drawn_mask, painted


@pytest.mark.parametrize("mesher", ["ball-pivot", "isosurface"])
@hard_case(
    "the drawn figure with 1 and with 2 threads, by either mesher",
    "the same file, to the byte",
    "what is computed for a point or a ray does not depend on which thread does it",
)
def test_one_and_two_threads(job: Job, monkeypatch: pytest.MonkeyPatch, mesher: str) -> None:
    made = []
    for threads in ("1", "2"):
        monkeypatch.setenv(THREADS_VARIABLE, threads)
        outcome = job(painted(drawn_mask()), None, "--mesher", mesher, "--overwrite")
        assert outcome.code == 0, outcome.error
        made.append(outcome.output.read_bytes())
    assert made[0] == made[1]
