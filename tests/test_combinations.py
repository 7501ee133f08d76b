"""Combinations of pictures and georeferences are right, reported or refused; none is silently off."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.combinations import Choice, name_of, picture_choices, picture_outcome, sheet_choices, sheet_outcome

PICTURES, SHEETS = picture_choices(), list(sheet_choices())


def test_there_are_two_hundred() -> None:
    assert len(PICTURES) + len(SHEETS) >= 200
    assert len(PICTURES) >= 60


@pytest.mark.parametrize("choice", PICTURES, ids=name_of)
def test_pictures(tmp_path: Path, choice: Choice) -> None:
    told = choice["profile"] in ("damaged", "of CMYK") or ", " in choice["orientation"]
    assert picture_outcome(tmp_path, choice) == ("reported" if told else "right")


@pytest.mark.parametrize("choice", SHEETS, ids=name_of)
def test_georeferences(tmp_path: Path, choice: Choice) -> None:
    outcome = sheet_outcome(tmp_path, choice)
    if choice["damage"] == "none" or (choice["kind"] == "annotation" and choice["damage"] in ("halved", "doubled")):
        assert outcome == "right"
    else:
        assert outcome in ("right", "refused", "reported")
        assert outcome == "refused" or choice["damage"] not in (
            "turned by its orientation",
            "one point left",
            "source in degrees",
        )
