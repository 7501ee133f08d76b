"""Few combinations of options in which every two values that can go together do so at least once."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

Choice = dict[str, Any]


def pairwise(options: Mapping[str, Sequence[Any]], allowed: Callable[[Choice], bool]) -> list[Choice]:
    """Combinations, one value for each option, that cover all pairs of values of two options.

    options : values by name; few enough that all their combinations can be looked at
    allowed : whether a combination makes sense; pairs that only occur in others are not covered
    """
    names = list(options)
    every = [dict(zip(names, values, strict=True)) for values in itertools.product(*options.values())]
    left = {id(choice): _pairs(choice, names, options) for choice in every if allowed(choice)}
    chosen = []
    uncovered = set().union(*left.values())
    candidates = [choice for choice in every if id(choice) in left]
    while uncovered:
        best = max(candidates, key=lambda choice: len(left[id(choice)] & uncovered))
        chosen.append(best)
        uncovered -= left[id(best)]
    return chosen


def _pairs(choice: Choice, names: list[str], options: Mapping[str, Sequence[Any]]) -> set[tuple[str, int, str, int]]:
    place = {name: options[name].index(choice[name]) for name in names}
    return {(one, place[one], two, place[two]) for one, two in itertools.combinations(names, 2)}
