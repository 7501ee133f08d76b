"""Attributes of the kinds of errors."""

from __future__ import annotations

import pytest

from exporters.errors import ExportError
from fig2mesh.errors import FigureError, InputError, OutputError
from georef.errors import PlacementError

KINDS = (InputError, FigureError, OutputError, PlacementError, ExportError)


@pytest.mark.parametrize("kind", KINDS)
def test_only_an_unusable_figure_fails_again_as_long_as_it_is_the_same(kind: type[InputError]) -> None:
    assert kind("a", "b", "c").permanent == (kind is FigureError)


@pytest.mark.parametrize("kind", KINDS)
def test_no_handler_of_wrong_values_takes_an_unusable_input_for_one(kind: type[InputError]) -> None:
    assert not issubclass(kind, ArithmeticError | LookupError | TypeError | ValueError)
