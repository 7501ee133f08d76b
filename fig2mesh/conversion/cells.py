"""Numbers, truth values and dates in the cells of tables, as spreadsheets and pandas write them."""

from __future__ import annotations

import re
from decimal import Decimal
from typing import Final

ABSENT: Final = frozenset(("nan", "NaN", "NAN", "-nan", "None", "NULL", "null", "<NA>", "NaT", r"\N"))
"""Texts that programs write for an empty cell: pandas, R, QGIS, spreadsheets and databases, in their spelling."""

TRUE: Final = ("1", "1.0", "true", "t", "yes", "y", "on", "wahr", "vrai", "vero", "verdadero")
FALSE: Final = ("0", "0.0", "false", "f", "no", "n", "off", "falsch", "faux", "falso")
"""Truth values in lower case: of programs, and of spreadsheets in English, German, French, Italian and Spanish."""

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?", re.ASCII)
_GROUPED = re.compile(r"([+-]?[0-9]{1,3})([,.' \u00a0\u202f’])([0-9]{3})((?:\2[0-9]{3})*)(?:([,.])([0-9]+))?", re.ASCII)
_POINTS = re.compile(r"[+-]?[1-9][0-9]{0,2}(\.[0-9]{3})+", re.ASCII)
_YEAR = re.compile(r"([0-9]{4})\.0*", re.ASCII)
_UNIT = re.compile(r"([+-]?[0-9]*\.?[0-9]+)\s*[^\W\d_]{1,12}\.?", re.ASCII)
_DEGREES = re.compile(
    r"(?P<before>[NSEW])?\s*(?P<sign>[+-]?)(?P<degrees>[0-9]{1,3}(\.[0-9]+)?)\s*[°º:d ]?\s*"
    r"((?P<minutes>[0-9]{1,2}(\.[0-9]+)?)\s*['′’:m ]\s*)?((?P<seconds>[0-9]{1,2}(\.[0-9]+)?)\s*(\"|″|”|''|s)?\s*)?"
    r"(?P<after>[NSEW])?",
    re.IGNORECASE | re.ASCII,
)


class NotNumber(ValueError):
    """Why a text is not a number: finding and remedy."""

    def __init__(self, finding: str, remedy: str) -> None:
        super().__init__(f"{finding}; {remedy}")
        self.finding, self.remedy = finding, remedy


def number_of(text: str, shown: str) -> float:
    """Number in a cell, with a decimal point; shown : the text for messages.

    Raises NotNumber for anything that would have to be guessed, with the number as it could be meant.
    """
    if _NUMBER.fullmatch(text):
        number = float(text)
        if number - number != 0.0:
            raise NotNumber("not a finite number", "leave it empty")
        return number
    if _NUMBER.fullmatch(text.replace(",", ".")):
        raise NotNumber(f"{shown!r} has a comma", "write a decimal point")
    if match := _GROUPED.fullmatch(text):
        whole = re.sub("[^0-9+-]", "", match[1] + match[3] + match[4])
        raise NotNumber(f"{shown!r} has separators of thousands", f"write {whole}{f'.{match[6]}' if match[6] else ''}")
    if (degrees := _degrees(text)) is not None:
        finding = f"{shown!r} is not a number"
        raise NotNumber(finding, f"give a number with a decimal point, {degrees} if these are degrees")
    if match := _UNIT.fullmatch(text):
        raise NotNumber(f"{shown!r} has a unit", f"write the number alone, {match[1]}, in the unit of the column")
    raise NotNumber(f"{shown!r} is not a number", "give a number with a decimal point")


def whole_number_of(text: str, shown: str) -> int:
    """Whole number in a cell, also as 5000.0 or 5e3. Raises NotNumber."""
    if text.lstrip("+-").isdecimal() and text.isascii() and len(text) <= 20:
        return int(text)
    if _POINTS.fullmatch(text):
        digits = text.replace(".", "")
        raise NotNumber(f"{shown!r} may be {text.split('.')[0]} or {digits}", "write it without a point")
    try:
        number_of(text, shown)
    except NotNumber as error:
        if "not a number" in error.finding:
            raise NotNumber(f"{shown!r} is not a whole number", "give a whole number") from None
        raise
    exact = Decimal(text)
    if abs(exact.adjusted()) > 20 or exact != exact.to_integral_value():
        raise NotNumber(f"{shown!r} is not a whole number", "give a whole number")
    return int(exact)


def date_of(value: object) -> str:
    """Date in a cell as text; a year that a table keeps as a number, as 1893.0, without its point."""
    text = str(value).strip()
    match = _YEAR.fullmatch(text)
    return match[1] if match else text


def _degrees(text: str) -> str | None:
    """Decimal degrees of an angle in degrees, minutes and seconds, or with a hemisphere; else None."""
    match = _DEGREES.fullmatch(text)
    if match is None or (match["before"] and match["after"]) or not re.search("[°º:dNSEW]", text, re.IGNORECASE):
        return None
    hemisphere = (match["before"] or match["after"] or "").upper()
    minutes, seconds = float(match["minutes"] or 0), float(match["seconds"] or 0)
    if minutes >= 60 or seconds >= 60 or (match["minutes"] is None and match["seconds"] is not None):
        return None
    sign = -1 if hemisphere in ("S", "W") or match["sign"] == "-" else 1
    return f"{sign * (float(match['degrees']) + minutes / 60 + seconds / 3600):.7f}".rstrip("0").rstrip(".")
