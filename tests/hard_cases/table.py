"""Run the hard cases and write the table of them: `python -m tests.hard_cases.table docs/hard_cases.md`."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.hard_cases.case import Case

HERE = Path(__file__).parent

SECTIONS = {
    "test_fields": "Distance fields and sphere tracing",
    "test_pose": "Joints",
    "test_silhouettes": "Silhouettes",
    "test_pictures": "Pictures",
    "test_colours": "Colours",
    "test_georeference": "Places on the earth",
    "test_determinism": "Determinism",
}

# fmt: off
ELSEWHERE = (
    ("Poles, antimeridian, ±1e-9°, −500 m to 100 km: longitude, latitude, height ↔ ECEF within 1e-8 m",
     "tests/georef/test_geodesy.py", "test_geodetic_round_trip"),
    ("Both names of the antimeridian are one place", "tests/georef/test_geodesy.py",
     "test_both_names_of_the_antimeridian_are_one_place"),
    ("At a pole the axes follow the longitude exactly", "tests/georef/test_geodesy.py",
     "test_poles_follow_the_longitude_exactly"),
    ("The nose points where the geodesic says, at any place and heading", "tests/georef/test_geodesy.py",
     "test_the_nose_points_along_the_geodesic"),
    ("Bearings of any finite number, −1e-20 and −0.0 included", "tests/georef/test_placement.py",
     "test_bearings_are_normalized_once_and_keep_their_direction"),
    ("Geoid grids close at the antimeridian and hold at the poles", "tests/georef/test_heights.py",
     "test_a_world_grid_closes_at_the_antimeridian_and_holds_at_the_poles"),
    ("Grids of random numbers are never crossed unseen", "tests/fig2mesh/field/test_trace.py",
     "test_random_grids_are_never_crossed_unseen"),
    ("A limb on a grid line, 0.3 cells thick, is seen along its whole length", "tests/fig2mesh/field/test_trace.py",
     "test_thin_limb_is_seen_along_its_whole_length"),
    ("A part cut by its cube ends there", "tests/fig2mesh/field/test_trace.py",
     "test_a_part_cut_by_its_cube_ends_there"),
    ("Limbs in any pose, crossing and stretched, are one closed solid", "tests/fig2mesh/parts/test_any_pose.py",
     "test_every_figure_is_one_closed_solid_with_the_drawn_silhouette"),
)
# fmt: on
"""(what, file, test): hard cases that the suites of the packages hold already."""


@dataclass
class Row:
    """One case over all its inputs; outcome : "passed", "xfailed" or "failed"; note : why it may fail."""

    module: str
    name: str
    case: Case
    inputs: int = 0
    worst: float | None = None
    outcome: str = "passed"
    note: str = ""


class Collector:
    """A pytest plugin that gathers rows from the reports."""

    def __init__(self) -> None:
        self.rows: dict[tuple[str, str], Row] = {}
        self.outcomes: dict[str, tuple[str, str]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call":
            expected = hasattr(report, "wasxfail")
            self.outcomes[report.nodeid] = ("xfailed" if expected else report.outcome, getattr(report, "wasxfail", ""))
        for key, value in report.user_properties if report.when == "teardown" else ():
            if key != "hard_case":
                continue
            name, case, worst = value
            module = Path(report.nodeid.partition("::")[0]).stem
            row = self.rows.setdefault((module, name), Row(module, name, Case(**case)))
            row.inputs += 1
            row.worst = max((w for w in (row.worst, worst) if w is not None), default=None)
            outcome, note = self.outcomes.get(report.nodeid, ("failed", ""))
            if outcome != "passed":
                row.outcome, row.note = outcome, note


def number(value: float) -> str:
    return "0" if value == 0 else f"{value:.2g}" if abs(value) < 1e5 else f"{value:.1e}"


def cells(row: Row) -> list[str]:
    unit = f" {row.case.unit}" if row.case.unit else ""
    tolerance = "exact" if row.case.tolerance is None else number(row.case.tolerance) + unit
    if row.outcome == "xfailed":
        measured = f"fails: {row.note}"
    elif row.worst is None:
        measured = "holds"
    else:
        measured = number(row.worst) + unit
    name = row.name.removeprefix("test_").replace("_", " ")
    title = name + (f" ({row.inputs} inputs)" if row.inputs > 1 else "")
    return [title, row.case.given, row.case.holds, tolerance, row.case.why, measured]


def table(rows: list[Row]) -> str:
    """The document, from finished rows."""
    lines = [
        "# Hard cases",
        "",
        "Written by `python -m tests.hard_cases.table docs/hard_cases.md`, which runs `tests/hard_cases`; the last",
        "column is what that run measured, the largest value over all inputs. Lengths are figure units (a figure is",
        "1.79 high) where no other unit is named.",
    ]
    for module, title in SECTIONS.items():
        lines += ["", f"## {title}", "", f"`tests/hard_cases/{module}.py`", ""]
        lines += ["| case | input | holds | tolerance | why | measured |", "|---|---|---|---|---|---|"]
        for row in rows:
            if row.module == module:
                lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells(row)) + " |")
    lines += ["", "## Held by other suites", ""]
    lines += [f"- {what}: `{file}::{test}`" for what, file, test in ELSEWHERE]
    return "\n".join(lines) + "\n"


def main(arguments: list[str]) -> int:
    if len(arguments) != 1:
        print("usage: python -m tests.hard_cases.table PATH", file=sys.stderr)
        return 2
    collector = Collector()
    code = pytest.main([str(HERE), "-q", "-p", "no:cacheprovider"], plugins=[collector])
    rows = list(collector.rows.values())
    if code != 0 or any(row.outcome not in ("passed", "xfailed") for row in rows):
        print("hard cases fail; no table written", file=sys.stderr)
        return 1
    Path(arguments[0]).write_text(table(rows), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
