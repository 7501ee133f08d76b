"""Feed every reader with damaged files: `python -m tests.fuzz.run [--reader NAME]... [--inputs N] [--seconds S]`.

Each reader runs in a process of its own with limits on memory and time; if it dies, it resumes after the input that
killed it. The table counts the outcomes of the inputs. Findings are stored under build/fuzz, one folder per input.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.readers import READERS
from tests.fuzz.worker import WALL_S, input_of

ROOT = Path(__file__).resolve().parents[2]
STUCK_S = 4 * WALL_S
"""Native code hears no alarm: a process that is at one input for so long is ended."""

MOST_DEATHS = 40


@dataclass
class Tally:
    """Outcomes of a reader's inputs; findings : text → numbers of the inputs."""

    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    slowest_number: int = -1
    peak_mb: int = 0
    findings: dict[str, list[int]] = field(default_factory=dict)

    def add(self, text: str, number: int) -> None:
        """Findings of the same kind at the same place count as one, whatever their messages."""
        kind, place = text.partition(":")[0], text.rpartition("@")[2]
        known = next((k for k in self.findings if (k.partition(":")[0], k.rpartition("@")[2]) == (kind, place)), text)
        self.findings.setdefault(known, []).append(number)


def fuzz(name: str, seed: int, inputs: int, seconds: float) -> Tally:
    """Read that many damaged inputs, or as many as the time allows."""
    tally, start, first, deaths = Tally(), time.monotonic(), 0, 0
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        while first < inputs and deaths < MOST_DEATHS and time.monotonic() - start < seconds:
            left = seconds - (time.monotonic() - start)
            at, died = _process(name, seed, first, inputs, Path(folder), left, tally)
            first = at + 1
            deaths += bool(died)
            if died:
                tally.add(died, at)
            else:
                break
    tally.inputs = first
    tally.seconds = time.monotonic() - start
    return tally


def _process(
    name: str, seed: int, first: int, last: int, folder: Path, seconds: float, tally: Tally
) -> tuple[int, str]:
    """The number of the last input and "", or what killed the process there."""
    at = folder / "at"
    at.write_bytes(first.to_bytes(8, "little"))
    words = [
        sys.executable,
        "-m",
        "tests.fuzz.worker",
        name,
        str(seed),
        str(first),
        str(last),
        str(folder),
        str(seconds),
    ]
    environment = os.environ | {
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONPATH": str(ROOT),
        "VIPS_CONCURRENCY": "1",
        "TMPDIR": str(folder),
    }
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment)
    done = threading.Event()
    stuck: list[bool] = []

    def watch() -> None:
        latest_number, since = -1, time.monotonic()
        while not done.wait(2.0):
            number = int.from_bytes(at.read_bytes(), "little")
            if number != latest_number:
                latest_number, since = number, time.monotonic()
            elif time.monotonic() - since > STUCK_S:
                stuck.append(True)
                process.kill()
                return

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    finished, latest = False, {"accepted": 0, "refused": 0, "slowest": 0.0, "slowest_number": -1}
    assert process.stdout is not None
    for line in process.stdout:
        report = json.loads(line)
        if "finding" in report:
            tally.add(report["finding"], report["number"])
        else:
            latest = report["counts"]
            finished = report.get("done", False)
            tally.peak_mb = max(tally.peak_mb, report.get("peak_mb", 0))
    process.wait()
    done.set()
    watcher.join()
    tally.accepted += latest["accepted"]
    tally.refused += latest["refused"]
    if latest["slowest"] > tally.slowest:
        tally.slowest, tally.slowest_number = latest["slowest"], latest["slowest_number"]
    number = int.from_bytes(at.read_bytes(), "little")
    if finished:
        return number, ""
    if stuck:
        return number, f"hang: native code, ended after {STUCK_S:.0f} s"
    code = process.returncode
    if code > 0:
        raise SystemExit(f"the process that reads {name} failed with exit code {code}")
    return number, f"crash: {signal.Signals(-code).name}"


def keep(name: str, seed: int, tally: Tally, folder: Path) -> None:
    """Write one input of each finding below a folder."""
    intact = list(READERS[name].seeds())
    for count, (text, numbers) in enumerate(tally.findings.items()):
        target = folder / name / f"{count:02d}"
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir(parents=True)
        (target.parent / f"{count:02d}.txt").write_text(f"{numbers[0]}: {text}\n")
        if numbers[0] >= 0:
            input_of(name, seed, numbers[0], intact).put(target)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.run", description=__doc__)
    parser.add_argument("--reader", action="append", choices=sorted(READERS), help="repeatable; default: all")
    parser.add_argument("--inputs", type=int, default=1000, help="for a reader of weight 1")
    parser.add_argument("--seconds", type=float, default=600.0, help="most for each reader")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, default=ROOT / "build" / "fuzz", help="folder for what is found")
    options = parser.parse_args()
    print("reader        inputs  accepted  refused  findings  a second  slowest     peak")
    total = found = 0
    for name in options.reader or READERS:
        tally = fuzz(name, options.seed, int(options.inputs * READERS[name].weight), options.seconds)
        count = sum(len(numbers) for numbers in tally.findings.values())
        print(
            f"{name:<12}{tally.inputs:>8}{tally.accepted:>10}{tally.refused:>9}{count:>10}"
            f"{tally.inputs / max(tally.seconds, 1e-9):>10.0f}{tally.slowest:>7.2f} s{tally.peak_mb:>6} MB",
            flush=True,
        )
        for text, numbers in sorted(tally.findings.items(), key=lambda item: -len(item[1])):
            print(f"    {len(numbers)}x {text} [{numbers[0]}]", flush=True)
        keep(name, options.seed, tally, options.keep)
        total, found = total + tally.inputs, found + count
    print(f"{'all':<12}{total:>8}{'':>19}{found:>10}")
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
