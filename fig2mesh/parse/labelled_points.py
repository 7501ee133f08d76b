"""Points with labels, as they stand in a file of another program; shared by the readers of all formats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

MIN_VISIBLE: Final = 0.3
"""Scores from which a point counts as visible; pose estimators give every point one, hidden ones a low one."""


class NotThisFormat(Exception):
    """The content has another structure."""


@dataclass(frozen=True)
class LabelledPoints:
    """Points of one figure as a file has them.

    points : name as written, x and y (not checked yet; None where it has not been annotated), whether it is visible
    size : (width, height) of the picture; picture : its name or path as written; None where the file does not state it
    normalised : whether coordinates up to 1 are shares of the picture by the format's convention
    ignored : names of the format that stand for no joint of ours, such as the mouth's
    """

    points: tuple[tuple[str, Any, bool], ...]
    size: tuple[int, int] | None = None
    picture: str | None = None
    normalised: bool = False
    ignored: tuple[str, ...] = ()


FormatReader = Callable[[Any, Path], list[LabelledPoints]]
"""Reader of a format: all figures in a file. Raises NotThisFormat, or FigureError for a damaged file."""


def objects(values: Any) -> list[dict[str, Any]]:
    """The objects in a list; whatever else a damaged file has there is left out."""
    return [value for value in values if isinstance(value, dict)] if isinstance(values, list) else []


def key(identifier: Any) -> str:
    """Identifier as text: the number 1 and the text "1" are the same one."""
    if isinstance(identifier, float) and identifier.is_integer():
        identifier = int(identifier)
    if isinstance(identifier, int | str) and not isinstance(identifier, bool):
        return str(identifier).strip()
    return repr(identifier)


def picture_size(width: Any, height: Any) -> tuple[int, int] | None:
    """(width, height), if both are sizes of a picture."""
    pair = [int(v) if isinstance(v, float) and v.is_integer() else v for v in (width, height)]
    usable = all(isinstance(v, int) and not isinstance(v, bool) and v > 0 for v in pair)
    return (pair[0], pair[1]) if usable else None


def text(value: Any) -> str | None:
    """A text that is not empty, or None."""
    return value if isinstance(value, str) and value.strip() else None


def triples(names: tuple[str, ...], values: list[Any], scored: bool = False) -> tuple[tuple[str, Any, bool], ...]:
    """Points of a flat list x, y, v, x, y, v, …; those of visibility 0 have not been annotated.

    v is COCO's flag (1 hidden, 2 visible) or a score from 0 to 1 (or to 100); scored : v is certainly a score
    """
    marks = values[2::3]
    numbers = [v for v in marks if isinstance(v, int | float) and not isinstance(v, bool)]
    most = max(numbers, default=0)
    scores = scored or any(v != int(v) for v in numbers) or most > 2
    limit = MIN_VISIBLE * (100 if most > 2 else 1) if scores else 2
    found: list[tuple[str, Any, bool]] = []
    for name, x, y, v in zip(names, values[0::3], values[1::3], marks, strict=False):
        if not v or (isinstance(v, int | float) and v <= 0):
            found.append((name, None, False))
            continue
        found.append((name, [x, y], isinstance(v, int | float) and v >= limit))
    return tuple(found)


def listed(names: Sequence[str], limit: int = 6) -> str:
    """First few names, and how many more there are, for messages."""
    shown = ", ".join(name[:30] for name in names[:limit])
    return shown if len(names) <= limit else f"{shown} and {len(names) - limit} more"
