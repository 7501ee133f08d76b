"""Joints in files of other programs: the one figure that is meant, by the picture's name and its bounding box.

Each format has one reader in `FORMATS`; this module chooses among the figures that it finds.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np

from fig2mesh.errors import FigureError
from fig2mesh.parse.annotation_tools import TOOL_FORMATS
from fig2mesh.parse.joint_names import KNOWN, Point, Repeated, canonical, meanings
from fig2mesh.parse.labelled_points import LabelledPoints, NotThisFormat, listed
from fig2mesh.parse.pose_estimators import POSE_FORMATS

Box = tuple[float, float, float, float]

FORMATS = (*TOOL_FORMATS, *POSE_FORMATS)
"""Readers of all formats; the first that knows a file's structure reads it."""

MAX_SHARE = 2.0
"""Largest coordinate of a normalised file: MediaPipe puts limbs that the picture cuts off outside of 0 to 1."""


@dataclass(frozen=True)
class NamedPoints:
    """Points of one figure, as read from a file.

    points : canonical name → (2,) float64, IMAGE; visible : the same names → whether it is visible
    size : (width, height) of the picture, None where the file does not state it
    unknown : names that stand for no joint; picture : file name of another picture that the file names instead
    """

    points: dict[str, Point]
    visible: dict[str, bool]
    size: tuple[int, int] | None
    unknown: tuple[str, ...] = ()
    picture: str | None = None


def named_points(
    content: Any, path: Path, picture: str, bbox: Box | None, size: tuple[int, int] | None = None
) -> NamedPoints | None:
    """Points of the one figure in a file; None for a file of none of these formats.

    content : the parsed JSON, or the root element of an XML file
    picture : file name of the drawing, by which one of several pictures is chosen
    bbox : x0, y0, x1, y1, IMAGE, by which one of several figures is chosen: the one with most points inside
    size : (width, height) of the drawing, for formats with normalised coordinates

    Raises FigureError for a damaged file, or one in which the figure is ambiguous.
    """
    for read in FORMATS:
        try:
            people = read(content, path)
        except NotThisFormat:
            continue
        people, other = _of_picture(people, path, picture)
        figures = [_figure(person, path, size, other) for person in people]
        return _meant(figures, people, path, bbox)
    return None


def file_name(written: str) -> str:
    """File name of a path or URL as other programs write it: without folders, query and percent-encoding.

    Label Studio's prefix of eight hexadecimal digits is removed.
    """
    text = written.strip()
    if re.match(r"^[a-z][a-z0-9+.-]+://", text, re.IGNORECASE):
        parts = urlsplit(text)
        text = unquote(parts.path) or text
    elif text.startswith("/data/"):  # Label Studio: /data/upload/1/…, /data/local-files/?d=folder/…
        text = unquote(text.split("?d=")[-1].split("?")[0])
    elif "%" in text:
        text = unquote(text)
    name = PureWindowsPath(text).name
    return re.sub(r"^[0-9a-f]{8}-(?=.)", "", name)


def same_picture(written: str, picture: str) -> bool:
    """Whether two file names mean one picture: case, Unicode form and suffix do not matter."""

    def plain(name: str) -> str:
        text = unicodedata.normalize("NFC", name).casefold()
        return re.sub(r"\.[a-z0-9]{2,5}$", "", text)

    def exact(name: str) -> str:
        return PureWindowsPath(unquote(name)).name

    # Roboflow: image_png.rf.0f3a….jpg
    short = re.sub(r"_(png|jpe?g|webp|tiff?)\.rf\.[0-9a-z]+", "", plain(written), flags=re.IGNORECASE)
    names = {plain(written), plain(file_name(written)), short, plain(exact(written))}
    return bool(names & {plain(picture), plain(file_name(picture))})


def _of_picture(people: Sequence[LabelledPoints], path: Path, picture: str) -> tuple[list[LabelledPoints], str | None]:
    """Figures in a file that belong to the picture; and the other picture that the file names, None if it fits.

    A figure without the name of a picture may belong to any.
    """
    named = [person for person in people if person.picture]
    if not picture or not named:
        return list(people), None
    exact = [person for person in named if file_name(str(person.picture)) == picture]
    matching = exact or [person for person in named if same_picture(str(person.picture), picture)]
    if matching:
        return matching, None
    others = list(dict.fromkeys(file_name(str(person.picture)) for person in named))
    rest = [person for person in people if not person.picture]
    if rest:
        return rest, None
    if len(others) > 1:
        found = f"about {len(others)} pictures ({listed(others, 3)}), none of them {picture}"
        raise FigureError(path, found, "pass the joints of this picture, or write its file name into the file")
    return list(people), others[0]


def _meant(figures: list[NamedPoints], people: Sequence[LabelledPoints], path: Path, bbox: Box | None) -> NamedPoints:
    found = [figure for figure in figures if figure.points]
    if not found:
        names = list(dict.fromkeys(name for person in people for name, *_ in person.points))
        written = f" ({listed(names, 4)})" if names else ""
        finding = f"no joints with known names{written}"
        raise FigureError(path, finding, "name them head, neck, left_shoulder, … as in docs/command_line.md")
    if len(found) > 1 and bbox is not None:
        inside = [sum(_inside(point, bbox) for point in figure.points.values()) for figure in found]
        if not max(inside):
            finding = f"none of its {len(found)} figures is inside --bbox"
            raise FigureError(path, finding, "give a box round the one that is meant, in pixels of the whole picture")
        found = [figure for figure, count in zip(found, inside, strict=True) if count == max(inside)]
    if len(found) > 1:
        raise FigureError(path, f"{len(found)} figures", "pass --bbox X0 Y0 X1 Y1 round the one that is meant")
    return found[0]


def _inside(point: Point, bbox: Box) -> bool:
    x0, y0, x1, y1 = bbox
    return bool(x0 <= point[0] <= x1 and y0 <= point[1] <= y1)


def _figure(
    person: LabelledPoints, path: Path, size: tuple[int, int] | None = None, picture: str | None = None
) -> NamedPoints:
    try:
        annotated = [point for point in person.points if point[1] is not None]
        empty = [name for name, place, _ in person.points if place is None]
        chosen, unknown = meanings([name for name, *_ in annotated], empty)
    except Repeated as error:
        raise FigureError(path, f"{error} twice", "keep one of each, or give each figure a group") from None
    points: dict[str, Point] = {}
    visible: dict[str, bool] = {}
    for point, index in chosen.items():
        _, value, shown = annotated[index]
        points[point], visible[point] = position(value, point, path), shown
    if person.normalised and points and max(np.abs(value).max() for value in points.values()) <= MAX_SHARE:
        scale = person.size or size
        if scale is None:
            raise FigureError(path, "coordinates from 0 to 1", "give the size of the picture beside them")
        points = {name: value * np.array(scale, np.float64) for name, value in points.items()}
    unknown = tuple(name for name in unknown if canonical(name) not in KNOWN and name not in person.ignored)
    return NamedPoints(points, visible, person.size, unknown, picture)


def position(value: Any, name: str, path: Path) -> Point:
    """(2,) position of a point. Raises FigureError unless it is two finite numbers."""
    try:
        point = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        point = np.full(2, np.nan)
    if point.shape != (2,) or not (np.abs(point) < 1e9).all():
        raise FigureError(path, f"{name} is {str(value)[:60]}", "give x and y as finite numbers")
    return point
