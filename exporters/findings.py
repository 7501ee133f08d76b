"""Findings of checks about a file."""

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

    severity : "error": the file violates its format or a guarantee of fig2mesh; "warning": viewers may show it
        wrongly; "info": for information
    code : identifier in capitals; of findings of an external validator, its own code
    message : description of the finding
    where : file and location within it
    """

    severity: Severity
    code: str
    message: str
    where: str

    def __post_init__(self) -> None:
        # Texts from the file become part of it.
        object.__setattr__(self, "message", one_line(self.message))
        object.__setattr__(self, "where", one_line(self.where))

    def __str__(self) -> str:
        return f"{self.severity}: {self.where}: {self.message} [{self.code}]"


def check_solid(vertices: NDArray[Any], faces: NDArray[Any], where: str) -> list[Finding]:
    """Check that a mesh is a closed, manifold, outward-oriented solid, as fig2mesh guarantees for every figure.

    vertices : (V, 3) float; faces : (F, 3) integer, seams undone
    """
    if not len(faces):
        return [Finding("error", "NO_TRIANGLES", "no triangles", where)]
    found = measure_topology(vertices, faces)
    counts = {
        "NOT_CLOSED": (found.boundary_edges, "edges with only one triangle"),
        "NONMANIFOLD_EDGE": (found.nonmanifold_edges, "edges with more than two triangles"),
        "MISORIENTED": (found.misoriented_edges, "edges whose triangles are oriented inconsistently"),
        "NONMANIFOLD_VERTEX": (found.nonmanifold_vertices, "surfaces that touch only in one vertex"),
        "DEGENERATE_TRIANGLE": (found.degenerate_faces, "triangles that use a vertex twice"),
    }
    findings = [Finding("error", code, f"{count} {kind}", where) for code, (count, kind) in counts.items() if count]
    if found.solid and found.volume <= 0:
        findings.append(Finding("error", "INSIDE_OUT", f"encloses {found.volume:.3g} cubic metres", where))
    return findings


def as_infos(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings with severity "info", for files without such guarantees."""
    return [replace(finding, severity="info") for finding in findings]


PLACE_TOLERANCE_M = 1e-6
"""Tolerance of a place after conversion to ECEF and back: float64 has steps of 1e-9 m at the earth's surface."""


def check_place(record: Any, where: str) -> list[Finding]:
    """Check that a record describes a valid place whose coordinates survive the conversion to ECEF and back.

    record : as made by `exporters.georeference.georeference`
    """
    if not isinstance(record, Mapping):
        return [Finding("error", "GEOREFERENCE", "not a record of a place", where)]
    try:
        place = placement_of_record(record)
        back = placement_of_tile(column_major(ecef_from_tile(place)))
    except (PlacementError, DamagedFile) as error:
        return [Finding("error", "GEOREFERENCE", str(error), where)]
    recorded = (place.lon_deg, place.lat_deg, place.height_m)
    return check_same_place(
        recorded, (back["lon_deg"], back["lat_deg"], back["height_m"]), "the conversion to ECEF and back", where
    )


def check_same_place(
    one: tuple[float, float, float], two: tuple[float, float, float], source: str, where: str
) -> list[Finding]:
    """Check that two places, each longitude and latitude in degrees and ellipsoidal height in metres, are the same."""
    apart = float(np.linalg.norm(ecef_from_geodetic(one) - ecef_from_geodetic(two)))
    if apart <= PLACE_TOLERANCE_M:
        return []
    return [Finding("error", "GEOREFERENCE", f"{source} gives a place {apart:.3g} m away", where)]
