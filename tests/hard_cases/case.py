"""Metadata of a hard case: the input, the law, the tolerance, and the reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, settings


@dataclass(frozen=True)
class Case:
    """One row of the table.

    given : the input
    holds : what is asserted
    why : the reason for the tolerance
    tolerance : largest value that `worst` accepts; None where something holds or does not
    unit : of the tolerance and of what is measured
    """

    given: str
    holds: str
    why: str
    tolerance: float | None = None
    unit: str = ""


@dataclass
class Worst:
    """Call it with every value that the case measures: too large a one fails, the largest is kept for the table."""

    case: Case
    value: float | None = field(default=None)

    def __call__(self, value: Any) -> None:
        assert self.case.tolerance is not None, "a case without a tolerance measures nothing"
        measured = float(value)
        self.value = measured if self.value is None else max(self.value, measured)
        # Written so that NaN fails.
        assert measured <= self.case.tolerance, f"{measured:g} {self.case.unit} > {self.case.tolerance:g}"


def hard_case(
    given: str, holds: str, why: str, tolerance: float | None = None, unit: str = ""
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Mark a test as a hard case; the arguments are the fields of `Case`."""
    return pytest.mark.hard_case(Case(given, holds, why, tolerance, unit))


def drawn(examples: int) -> settings:
    """Settings of a property: always the same examples, so that the table can be written again, and no clock."""
    return settings(
        max_examples=examples,
        derandomize=True,
        deadline=None,
        database=None,
        # Making a failing figure smaller would take many minutes and explain little.
        phases=(Phase.explicit, Phase.generate),
        # `worst` is one for all examples of a property, which is what it is for.
        suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    )
