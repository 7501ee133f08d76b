"""Reading of OpenUSD files in a separate process, as damaged ones can crash it.

The USD libraries abort on layers that violate their assumptions (a text layer of a few lines is enough), which no
`except` catches. `python -m exporters.usd.process check|facts FILE` writes the result as JSON.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import traceback
from dataclasses import asdict
from pathlib import Path
from typing import Any

from exporters.errors import ExportError
from exporters.findings import Finding
from georef.errors import PlacementError
from georef.untrusted.damage import DamagedFile

TIMEOUT_S = 300
"""Limit of the run time; the validators of USD take a minute for large stages."""

MAX_MEMORY = 8 << 30
"""Limit of the process's address space, where the system supports it."""


class UsdProcessError(RuntimeError):
    """An internal error in the process that reads USD, with its traceback."""


def check_usd_isolated(path: Path) -> list[Finding]:
    """Run `exporters.usd.check.check_usd` in a separate process; a file that crashes it is unreadable."""
    try:
        return [Finding(**each) for each in _run_isolated("check", path)]
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name)]


def usd_facts_isolated(path: Path) -> dict[str, Any]:
    """Run `exporters.usd.inspect.usd_facts` in a separate process. Raises ExportError, also for a crash."""
    facts: dict[str, Any] = _run_isolated("facts", path)
    return facts


def _run_isolated(task: str, path: Path) -> Any:
    command = [sys.executable, "-m", "exporters.usd.process", task, os.path.abspath(path)]
    with tempfile.TemporaryDirectory(prefix="fig2mesh-") as folder:
        # Crash reports are written there as well.
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "TMPDIR": folder}
        try:
            run = subprocess.run(command, capture_output=True, check=False, timeout=TIMEOUT_S, env=environment)
        except subprocess.TimeoutExpired:
            raise ExportError(path, f"USD did not finish within {TIMEOUT_S} s", "simplify the stage") from None
    if run.returncode:
        cause = signal.Signals(-run.returncode).name if run.returncode < 0 else f"exit code {run.returncode}"
        raise ExportError(path, f"USD crashes on it ({cause})", "write it again")
    answer = json.loads(run.stdout)
    if "error" in answer:
        raise ExportError(path, answer["error"]["finding"], answer["error"]["remedy"])
    if "fault" in answer:
        raise UsdProcessError(f"{answer['fault']}\n{answer['where']}")
    return answer["found"]


def _answer(task: str, path: Path) -> dict[str, Any]:
    from exporters.usd.check import check_usd
    from exporters.usd.inspect import usd_facts

    try:
        found: Any = [asdict(each) for each in check_usd(path)] if task == "check" else usd_facts(path)
        return {"found": found}
    except ExportError as error:
        return {"error": {"finding": error.finding, "remedy": error.remedy}}
    except (DamagedFile, PlacementError) as error:
        return {"error": {"finding": f"damaged ({error})", "remedy": "write it again"}}
    except OSError as error:  # also for impossible offsets in a package
        return {"error": {"finding": error.strerror or "cannot be read", "remedy": "write it again"}}
    except Exception as error:
        return {"fault": f"{type(error).__name__}: {error}", "where": traceback.format_exc()}


def main() -> None:
    """Write the answer to standard output; output of libraries is redirected to standard error."""
    out = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, ValueError, OSError):
        pass  # not supported, or a lower limit is already set
    json.dump(_answer(sys.argv[1], Path(sys.argv[2])), out)
    out.flush()
    os._exit(0)  # a library may crash at exit after an error


if __name__ == "__main__":
    main()
