"""Looking into OpenUSD files in a process of its own: damaged ones can end it.

Its libraries abort where a layer breaks what they take for granted (a text layer of a few lines is enough), which no
`except` sees. `python -m exporters.usd.process check|facts FILE` writes what was found as JSON.
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
"""Of large stages the validators of USD take a minute."""

MAX_MEMORY = 8 << 30
"""Of the process's addresses, where the system can limit them."""


class UsdProcessError(RuntimeError):
    """A fault of ours in the process that reads USD, with the place where it was raised."""


def check_usd_isolated(path: Path) -> list[Finding]:
    """As `exporters.usd.check.check_usd`; a file that ends the process is unreadable."""
    try:
        return [Finding(**each) for each in _run_isolated("check", path)]
    except ExportError as error:
        return [Finding("error", "UNREADABLE", error.finding, path.name)]


def usd_facts_isolated(path: Path) -> dict[str, Any]:
    """As `exporters.usd.inspect.usd_facts`. Raises ExportError, also for a file that ends the process."""
    facts: dict[str, Any] = _run_isolated("facts", path)
    return facts


def _run_isolated(question: str, path: Path) -> Any:
    command = [sys.executable, "-m", "exporters.usd.process", question, os.path.abspath(path)]
    with tempfile.TemporaryDirectory(prefix="fig2mesh-") as folder:
        # Reports of crashes go there as well.
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "TMPDIR": folder}
        try:
            run = subprocess.run(command, capture_output=True, check=False, timeout=TIMEOUT_S, env=environment)
        except subprocess.TimeoutExpired:
            raise ExportError(path, f"USD is not done within {TIMEOUT_S} s", "simplify the stage") from None
    if run.returncode:
        how = signal.Signals(-run.returncode).name if run.returncode < 0 else f"exit code {run.returncode}"
        raise ExportError(path, f"USD breaks down on it ({how})", "write it again")
    answer = json.loads(run.stdout)
    if "error" in answer:
        raise ExportError(path, answer["error"]["finding"], answer["error"]["remedy"])
    if "fault" in answer:
        raise UsdProcessError(f"{answer['fault']}\n{answer['where']}")
    return answer["found"]


def _answer(question: str, path: Path) -> dict[str, Any]:
    from exporters.usd.check import check_usd
    from exporters.usd.inspect import usd_facts

    try:
        found: Any = [asdict(each) for each in check_usd(path)] if question == "check" else usd_facts(path)
        return {"found": found}
    except ExportError as error:
        return {"error": {"finding": error.finding, "remedy": error.remedy}}
    except (DamagedFile, PlacementError) as error:
        return {"error": {"finding": f"damaged ({error})", "remedy": "write it again"}}
    except OSError as error:  # also of places in a package that no file can have
        return {"error": {"finding": error.strerror or "cannot be read", "remedy": "write it again"}}
    except Exception as error:
        return {"fault": f"{type(error).__name__}: {error}", "where": traceback.format_exc()}


def main() -> None:
    """Answer on the standard output; what libraries write there goes nowhere."""
    out = os.fdopen(os.dup(1), "w", encoding="ascii")
    os.dup2(2, 1)
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, ValueError, OSError):
        pass  # another system, or one with lower limits already
    json.dump(_answer(sys.argv[1], Path(sys.argv[2])), out)
    out.flush()
    os._exit(0)  # a library that is hurt may not leave in peace


if __name__ == "__main__":
    main()
