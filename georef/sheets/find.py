"""Files of a sheet: the picture, and the georeference files next to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from georef.errors import PlacementError
from georef.sheets.agreement import picture_notes, same_map
from georef.sheets.annotation import is_annotation, read_annotation
from georef.sheets.controls import Affine, Controls
from georef.sheets.pictures import SUFFIXES, SheetPicture, read_picture
from georef.sheets.points_file import read_points_file
from georef.sheets.world_file import read_prj, read_world_file

OPTION = "--map"

SAME_MAP_TOLERANCE_PX = 0.01
"""Tolerance below which a world file and a GeoTIFF's tags are considered equal, at the corners of the picture."""


@dataclass(frozen=True)
class SheetFiles:
    """Files and georeference of a sheet.

    picture : the sheet's picture, None where there is only a georeference; size : of the picture, px
    file : the file that the georeference was read from
    georeference : control points or an affine map; crs : reference system named in any of the files
    notes : remarks about the picture and the files beside it, one line each
    """

    picture: Path | None
    size: tuple[int, int] | None
    file: Path
    georeference: Affine | Controls
    crs: str | None
    notes: tuple[str, ...] = ()


def find_georeference(sheet: Path) -> SheetFiles:
    """Find the georeference of a sheet.

    sheet : a picture with its georeference in its tags or in a file next to it, or the georeference itself: a .points
        file, an annotation, a world file

    Raises PlacementError where there is no georeference, or more than one candidate.
    """
    if not sheet.is_file():
        raise PlacementError(f"{OPTION} {sheet}", "no such file", "give the sheet's picture or its georeference")
    found, facts = _found(sheet)
    if facts is None or found.picture is None:
        return found
    own = [f"{found.picture}: {note}" for note in facts.notes]
    more = picture_notes(found.picture, facts.size, facts.original, found.georeference)
    return replace(found, notes=(*own, *more))


def _found(sheet: Path) -> tuple[SheetFiles, SheetPicture | None]:
    """Files of a sheet, and the header of its picture."""
    kind = _kind(sheet)
    if kind == "picture":
        return _of_picture(sheet)
    picture = _picture_beside(sheet)
    facts = None if picture is None else read_picture(picture)
    georeference = _read(sheet, kind)
    crs = georeference.crs or _prj_beside(sheet, picture) or (facts.crs if facts is not None else None)
    return SheetFiles(picture, None if facts is None else facts.size, sheet, georeference, crs), facts


def _kind(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix in SUFFIXES:
        return "picture"
    if suffix == ".points":
        return "points"
    if suffix in (".json", ".jsonld", ".geojson"):
        return "annotation"
    if suffix == ".wld" or (3 <= len(suffix) <= 6 and suffix.endswith("w")):
        return "world"
    finding = f"unknown suffix {path.suffix!r}"
    raise PlacementError(f"{OPTION} {path}", finding, "give a picture, .points, an annotation (.json) or a world file")


def _read(path: Path, kind: str) -> Affine | Controls:
    if kind == "world":
        return read_world_file(path)
    return read_points_file(path) if kind == "points" else read_annotation(path)


def _of_picture(sheet: Path) -> tuple[SheetFiles, SheetPicture]:
    facts = read_picture(sheet)
    world = _present(sheet, _world_suffixes(sheet.suffix))
    points = _present(sheet, (".points",))
    annotations = [path for path in _present(sheet, (".json", ".jsonld", ".geojson")) if is_annotation(path)]
    candidates = [*world, *points, *annotations]
    if facts.georeference is not None:
        # Programs write world files next to GeoTIFFs; one that equals the tags is not a second candidate.
        candidates = [path for path in candidates if path not in world or not _same_map(facts, read_world_file(path))]
        if not candidates:
            crs = facts.crs or _prj_beside(sheet, sheet)
            return SheetFiles(sheet, facts.size, sheet, facts.georeference, crs), facts
        candidates = [sheet, *candidates]
    if not candidates:
        tried = ", ".join(dict.fromkeys(sheet.stem + s for s in (*_world_suffixes(sheet.suffix), ".points", ".json")))
        raise PlacementError(f"{OPTION} {sheet}", "no georeference in its tags or next to it", f"add one of {tried}")
    if len(candidates) > 1:
        shown = " and ".join("its tags" if path == sheet else path.name for path in candidates)
        raise PlacementError(
            f"{OPTION} {sheet}", f"ambiguous georeference: {shown}", "give the one to use instead of the picture"
        )
    file = candidates[0]
    georeference = _read(file, _kind(file))
    crs = georeference.crs or _prj_beside(file, sheet) or facts.crs
    return SheetFiles(sheet, facts.size, file, georeference, crs), facts


def _world_suffixes(suffix: str) -> tuple[str, ...]:
    """Suffixes of world files, such as .png → .pgw, .pngw, .wld."""
    return (f".{suffix[1]}{suffix[-1]}w", f"{suffix}w", ".wld")


def _present(path: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """Files named like `path` with one of the suffixes in place of its own or appended, in lower or upper case."""
    names = dict.fromkeys(
        base + case for base in (path.stem, path.name) for s in suffixes for case in (s.lower(), s.upper())
    )
    found: list[Path] = []
    for name in names:
        candidate = path.with_name(name)
        # Case-insensitive file systems find the same file twice.
        if candidate != path and candidate.is_file() and not any(candidate.samefile(other) for other in found):
            found.append(candidate)
    return found


def _picture_beside(file: Path) -> Path | None:
    if Path(file.stem).suffix.lower() in SUFFIXES and file.with_name(file.stem).is_file():
        return file.with_name(file.stem)
    found = _present(file.with_name(file.stem + ".x"), SUFFIXES)
    if len(found) > 1:
        shown = " and ".join(path.name for path in found)
        raise PlacementError(f"{OPTION} {file}", f"ambiguous picture: {shown}", "keep only the sheet under this name")
    return found[0] if found else None


def _prj_beside(file: Path, picture: Path | None) -> str | None:
    for path in (file, picture):
        if path is not None and (found := _present(path, (".prj",))):
            return read_prj(found[0])
    return None


def _same_map(facts: SheetPicture, world: Affine) -> bool:
    own = facts.georeference
    return isinstance(own, Affine) and same_map(own.matrix, world.matrix, facts.size, SAME_MAP_TOLERANCE_PX)
