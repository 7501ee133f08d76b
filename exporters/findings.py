"""What a check can say about a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import NDArray

from exporters.solid import measure_topology

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
    findings = [
        Finding("error", code, f"{count} {what}", where) for code, (count, what) in counts.items() if count
    ]  # fmt: skip
    if found.solid and found.volume <= 0:
        findings.append(Finding("error", "INSIDE_OUT", f"encloses {found.volume:.3g} cubic metres", where))
    return findings
