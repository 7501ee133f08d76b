"""What a check can say about a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from exporters.georeference import placement_of_record, placement_of_tile
from exporters.solid import measure_topology
from georef.errors import PlacementError, one_line
from georef.geodesy import ecef_from_geodetic, ecef_from_tile
from georef.transform import column_major
from georef.untrusted.damage import DamagedFile

Severity = Literal["error", "warning", "info"]


@dataclass(frozen=True)
class Finding:
    """One finding about a file.

    severity : "error": the file breaks a rule of its format or a promise of ours; "warning": viewers may show it
        wrongly; "info": worth knowing
    code : identifier in capitals, the external validator's own where a finding is from there
    message : what was found
    where : file and place within it
    """

    severity: Severity
    code: str
    message: str
    where: str

    def __post_init__(self) -> None:
        # Texts out of the file become part of it.
        object.__setattr__(self, "message", one_line(self.message))
        object.__setattr__(self, "where", one_line(self.where))

    def __str__(self) -> str:
        return f"{self.severity}: {self.where}: {self.message} [{self.code}]"


def check_solid(vertices: NDArray[Any], faces: NDArray[Any], where: str) -> list[Finding]:
    """Our promise that every figure is a closed, oriented, manifold solid with its outside outside.

    vertices : (V, 3) float; faces : (F, 3) integer, seams undone
    """
    if not len(faces):
        return [Finding("error", "NO_TRIANGLES", "no triangles", where)]
    found = measure_topology(vertices, faces)
    counts = {
        "NOT_CLOSED": (found.boundary_edges, "edges with one triangle only"),
        "NONMANIFOLD_EDGE": (found.nonmanifold_edges, "edges with more than two triangles"),
        "MISORIENTED": (found.misoriented_edges, "edges whose triangles face opposite ways"),
        "NONMANIFOLD_VERTEX": (found.nonmanifold_vertices, "surfaces that touch in one vertex only"),
        "DEGENERATE_TRIANGLE": (found.degenerate_faces, "triangles that name a vertex twice"),
    }
    findings = [Finding("error", code, f"{count} {what}", where) for code, (count, what) in counts.items() if count]
    if found.solid and found.volume <= 0:
        findings.append(Finding("error", "INSIDE_OUT", f"encloses {found.volume:.3g} cubic metres", where))
    return findings


def as_infos(findings: Iterable[Finding]) -> list[Finding]:
    """The same findings as worth knowing only: for files that promise nothing of the kind."""
    return [replace(finding, severity="info") for finding in findings]


PLACE_TOLERANCE_M = 1e-6
"""How far a place may come back from where it was said to be: float64 has steps of 1e-9 m at the earth's surface."""


def check_place(record: Any, where: str) -> list[Finding]:
    """Whether the record of a place names one, and longitude, latitude and height survive the way to ECEF and back.

    record : as `exporters.georeference.georeference` makes it
    """
    if not isinstance(record, Mapping):
        return [Finding("error", "GEOREFERENCE", "is no record of a place", where)]
    try:
        place = placement_of_record(record)
        back = placement_of_tile(column_major(ecef_from_tile(place)))
    except (PlacementError, DamagedFile) as error:
        return [Finding("error", "GEOREFERENCE", str(error), where)]
    said = (place.lon_deg, place.lat_deg, place.height_m)
    return check_same_place(
        said, (back["lon_deg"], back["lat_deg"], back["height_m"]), "the way to ECEF and back", where
    )


def check_same_place(
    one: tuple[float, float, float], two: tuple[float, float, float], who: str, where: str
) -> list[Finding]:
    """Whether two places, each longitude and latitude in degrees and ellipsoidal height in metres, are one."""
    apart = float(np.linalg.norm(ecef_from_geodetic(one) - ecef_from_geodetic(two)))
    if apart <= PLACE_TOLERANCE_M:
        return []
    return [Finding("error", "GEOREFERENCE", f"{who} gives a place {apart:.3g} m away", where)]
