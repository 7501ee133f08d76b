"""The process that reads damaged files: it may hang, crash or run out of memory without harm to anybody else.

`python -m tests.fuzz.worker READER SEED FIRST LAST FOLDER` reads the inputs FIRST to LAST - 1, which only reader, seed
and number decide, and writes a line of JSON for each finding and a last one with counts. The number of the input at
hand stands in FOLDER/at, for whoever outlives this process.
"""

from __future__ import annotations

import faulthandler
import hashlib
import json
import mmap
import os
import random
import resource
import signal
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

from georef.errors import InputError
from tests.fuzz.mutate import mutated
from tests.fuzz.readers import READERS, Reader, assert_one_line
from tests.fuzz.seeds import Input

CPU_S = 10.0
"""Longest time that a small file may take, of the processor: machines may be busy with other things."""

WALL_S = 30.0
"""Longest wait, which a file that never ends needs no processor for."""


class Hang(BaseException):
    """Not an Exception, or a reader's handling of damaged files would take it for one."""


def input_of(reader: str, seed: int, number: int, intact: list[Input]) -> Input:
    """The damaged input of a number."""
    digest = hashlib.blake2b(f"{reader}/{seed}/{number}".encode(), digest_size=8).digest()
    rng = random.Random(int.from_bytes(digest, "little"))
    base = rng.choice(intact)
    return Input(base.main, mutated(base.files, base.main, rng))


def outcome(reader: Reader, path: Path) -> str:
    """ "" for an accepted file, "refused", or what is wrong."""
    try:
        reader.read(path)
    except InputError as error:
        try:
            assert_one_line(str(error))
        except AssertionError as problem:
            return f"refusal: {problem}"
        return "refused"
    except Hang:
        return f"hang: {_where()}"
    except BaseException as error:
        return f"{type(error).__name__}: {' '.join(str(error).split())[:160]} @ {_where()}"
    return ""


def _where() -> str:
    """The last line of our packages in a traceback, and the very last line."""
    frames = traceback.extract_tb(sys.exc_info()[2])
    own = [f for f in frames if any(f"/{part}/" in f.filename for part in ("georef", "exporters", "fig2mesh"))]
    shown = [*own[-1:], *frames[-1:]]
    return " ".join(dict.fromkeys(f"{'/'.join(f.filename.split('/')[-2:])}:{f.name}" for f in shown))


def limit(reader: Reader) -> None:
    """From now on this process gets so much more memory and no more."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + (reader.memory_mb << 20)
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))


def arm() -> None:
    """Make the alarms raise `Hang`."""

    def ring(*_: Any) -> None:
        raise Hang

    signal.signal(signal.SIGPROF, ring)
    signal.signal(signal.SIGALRM, ring)


def timed(reader: Reader, path: Path) -> tuple[str, float]:
    """Outcome of a file, and seconds of processor time."""
    start = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, CPU_S)
    signal.setitimer(signal.ITIMER_REAL, WALL_S)
    try:
        found = outcome(reader, path)
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
    except Hang:
        found = "hang: at the very end"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
    return found, time.process_time() - start


def main(name: str, seed: int, first: int, last: int, folder: Path, seconds: float) -> None:
    """Read the inputs and report on the standard output."""
    faulthandler.enable()
    warnings.simplefilter("ignore")
    out = os.fdopen(os.dup(1), "w")
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, 1)  # libraries write where they like
    reader = READERS[name]
    intact = list(reader.seeds())
    if not os.environ.get("FUZZ_VERBOSE"):
        os.dup2(quiet, 2)
    room = folder / "input"
    room.mkdir(exist_ok=True)
    for each in intact:
        for old in sorted(room.rglob("*"), reverse=True):
            old.unlink() if not old.is_dir() else old.rmdir()
        found = outcome(reader, each.put(room))
        if found:
            print(json.dumps({"number": -1, "finding": f"an intact {each.main} is not accepted: {found}"}), file=out)
    with (folder / "at").open("r+b") as stream:
        place = mmap.mmap(stream.fileno(), 8)
    limit(reader)
    arm()
    counts: dict[str, Any] = {"accepted": 0, "refused": 0, "slowest": 0.0, "slowest_number": -1}
    end = time.monotonic() + seconds
    number = first
    for number in range(first, last):
        place[:8] = number.to_bytes(8, "little")
        case = input_of(name, seed, number, intact)
        path = case.put(room)
        found, used = timed(reader, path)
        if used > counts["slowest"]:
            counts |= {"slowest": used, "slowest_number": number}
        if found in ("", "refused"):
            counts["refused" if found else "accepted"] += 1
        else:
            print(json.dumps({"number": number, "finding": found}), file=out, flush=True)
        # What the next input does not write must not be this one's.
        for extra in [p for p in room.rglob("*") if p.is_file() and p.name not in case.files]:
            if extra.relative_to(room).as_posix() not in case.files:
                extra.unlink()
        if set(case.files) != {case.main}:
            for file in case.files:
                (room / file).unlink(missing_ok=True)
        else:
            path.unlink(missing_ok=True)
        if number % 200 == 0:
            print(json.dumps({"number": number, "counts": counts}), file=out, flush=True)
        if time.monotonic() > end:
            break
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    print(json.dumps({"number": number, "counts": counts, "peak_mb": peak, "done": True}), file=out, flush=True)
    os._exit(0)  # libraries that were hurt may not leave in peace


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]), Path(sys.argv[5]), float(sys.argv[6]))
