"""Marks all over an area go on behind; a few details do not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fig2mesh.texture.patterns import patterned

SIZE = 120
WINDOW = 6.0

Drawn = tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.bool_]]


def area(marks: list[tuple[int, int]]) -> Drawn:
    """A square of one colour with dots of another, on nothing."""
    own = np.zeros((SIZE, SIZE), bool)
    own[10:-10, 10:-10] = True
    kind = np.zeros((SIZE, SIZE), int)
    index = kind.copy()
    for row, column in marks:
        index[row - 1 : row + 2, column - 1 : column + 2] = 1
    return index, kind, own


def test_dots_all_over_are_a_pattern() -> None:
    index, kind, own = area([(r, c) for r in range(18, 104, 10) for c in range(18, 104, 10)])
    found = patterned(index, kind, own, own, WINDOW)
    assert found[20:100, 20:100].all()
    assert not found[~own].any()


def test_a_row_of_buttons_is_none() -> None:
    index, kind, own = area([(r, 60) for r in range(18, 104, 10)])
    assert not patterned(index, kind, own, own, WINDOW).any()


def test_the_contour_is_no_mark() -> None:
    index, kind, own = area([])
    index[10:12] = index[-12:-10] = 1
    index[:, 10:12] = index[:, -12:-10] = 1
    assert not patterned(index, kind, own, own, WINDOW).any()


def test_each_area_is_judged_alone() -> None:
    """The upper half has dots, the lower another colour and none."""
    index, kind, own = area([(r, c) for r in range(18, 56, 8) for c in range(18, 104, 8)])
    kind[60:], index[60:] = 2, 2
    found = patterned(index, kind, own, own, WINDOW)
    assert found[20:50, 20:100].all()
    assert not found[62:].any()
