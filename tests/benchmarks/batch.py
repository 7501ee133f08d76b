"""Throughput of `fig2mesh batch`: `python -m tests.benchmarks.batch [--rows N] [--grow N ...] [--dry N ...] OUT.json`.

The rows are the shipped figures over and over, each with a seed of its own, so that every row is converted but for its
reading; or (--grow, --dry) with nothing but a different place, which shows the overhead of a row.
"""

from __future__ import annotations

import argparse
import csv
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

FIGURES = Path(__file__).parents[2] / "examples" / "figures"
NAMES = ("farmer", "footballer", "market_woman")


PARENT = """
import json, resource, sys
from fig2mesh.commands.main import main
code = main(sys.argv[1:])
print(json.dumps({"event": "memory", "kb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss}))
raise SystemExit(code)
"""
"""The command line, and after it the largest resident size of its process alone, without workers."""


def write_rows(path: Path, count: int, quality: str, seeds: bool) -> Path:
    """A collection of `count` rows; seeds : each with a conversion of its own, else with a place of its own only."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["name", "figure", "keypoints", "lon", "lat", "quality", "seed", "parts", "textures"])
        for number in range(count):
            folder = FIGURES / NAMES[number % len(NAMES)]
            place = (round(8 + number % 100 / 1000, 6), round(47 + number // 100 / 1000, 6))
            rest = (number, "network", "network") if seeds else (0, "outline", "none")
            table.writerow([f"f{number}", folder / "image.png", folder / "keypoints.json", *place, quality, *rest])
    return path


def convert(collection: Path, out: Path, jobs: int, *more: str) -> dict[str, Any]:
    """Convert a collection; seconds as a whole, figures a minute of all and of those after each worker's first."""
    words = [
        "batch",
        str(collection),
        "-o",
        str(out),
        "--jobs",
        str(jobs),
        "--root",
        FIGURES.anchor,
        "--progress",
        "json",
        "-q",
        *more,
    ]
    command = [sys.executable, "-c", PARENT, *words]
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    events = [json.loads(line) for line in process.stdout]
    if process.wait():
        raise SystemExit(f"batch ended with {process.returncode}")
    seconds = time.perf_counter() - start
    ends = [event["t"] for event in events if event["event"] == "row"]
    later = ends[jobs:]
    return {
        "rows": len(ends),
        "jobs": jobs,
        "seconds": round(seconds, 2),
        "per_minute": round(60 * len(ends) / seconds, 2),
        "warm_per_minute": round(60 * len(later) / (later[-1] - ends[jobs - 1]), 2) if later else None,
        "parent_mb": round(events[-1]["kb"] / 1024, 1),
    }


def speedup(folder: Path, rows: int, quality: str) -> dict[str, Any]:
    """One worker and two, from nothing and again with everything there."""
    collection = write_rows(folder / "seeds.csv", rows, quality, seeds=True)
    found: dict[str, Any] = {}
    for jobs in (1, 2):
        found[f"cold_{jobs}"] = convert(collection, folder / f"out{jobs}", jobs)
        found[f"rerun_{jobs}"] = convert(collection, folder / f"out{jobs}", jobs)
    found["speedup_2"] = round(found["cold_2"]["warm_per_minute"] / found["cold_1"]["warm_per_minute"], 3)
    found["speedup_2_whole"] = round(found["cold_2"]["per_minute"] / found["cold_1"]["per_minute"], 3)
    return found


def growth(folder: Path, counts: list[int], quality: str) -> list[dict[str, Any]]:
    """The same collection with more and more rows, which differ in their places."""
    found = []
    for count in counts:
        collection = write_rows(folder / f"places{count}.csv", count, quality, seeds=False)
        found.append(convert(collection, folder / f"grown{count}", 2))
        found[-1]["seconds_per_row"] = round(found[-1]["seconds"] / count, 3)
        print(json.dumps(found[-1]), flush=True)
    return found


def dry(folder: Path, counts: list[int]) -> list[dict[str, Any]]:
    """Rows that are only checked: what the parent takes, however many they are."""
    return [
        convert(write_rows(folder / f"dry{count}.csv", count, "draft", seeds=False), folder, 2, "--dry-run")
        for count in counts
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path)
    parser.add_argument("--rows", type=int, default=12)
    parser.add_argument("--grow", type=int, nargs="*", default=[])
    parser.add_argument("--dry", type=int, nargs="*", default=[])
    parser.add_argument("--quality", default="draft")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        result: dict[str, Any] = {}
        if options.rows:
            result["speedup"] = speedup(Path(name), options.rows, options.quality)
            print(json.dumps(result["speedup"], indent=1))
        if options.grow:
            result["growth"] = growth(Path(name), options.grow, options.quality)
        if options.dry:
            result["dry"] = dry(Path(name), options.dry)
            print(json.dumps(result["dry"], indent=1))
    options.output.parent.mkdir(parents=True, exist_ok=True)
    options.output.write_text(json.dumps(result, indent=2) + "\n")
