"""Examples that properties are tried with, and clients that several folders of tests look at pages with.

HYPOTHESIS_PROFILE=fixed, the default: always the same examples on every machine. HYPOTHESIS_PROFILE=random: others each
time, from a seed that the first line says; with HYPOTHESIS_SEED=… they are drawn again. `make test SLOW=1` sets it.
"""

from __future__ import annotations

import logging
import os
import secrets
from pathlib import Path

import pytest
from hypothesis import settings

from tests.browser import Look, browser, cesium_js

# No clock: the first example pays for loading libraries, and a busy machine is no failure. No database: what was found
# once is written down with @example, for all machines.
settings.register_profile("fixed", derandomize=True, database=None, deadline=None)
settings.register_profile("random", derandomize=False, database=None, deadline=None, print_blob=True)


@pytest.hookimpl(tryfirst=True)  # before Hypothesis reads its options
def pytest_configure(config: pytest.Config) -> None:
    """Load the profile, and draw a seed where it needs one; processes of xdist get the options with it."""
    option = config.option
    option.hypothesis_seed = option.hypothesis_seed or os.environ.get("HYPOTHESIS_SEED") or None
    profile = os.environ.get("HYPOTHESIS_PROFILE") or ("random" if option.hypothesis_seed else "fixed")
    settings.load_profile(profile)
    if profile == "random" and not option.hypothesis_seed:
        option.hypothesis_seed = str(secrets.randbits(32))


def pytest_sessionstart(session: pytest.Session) -> None:
    """Write the seed; not as `pytest_report_header`, which -q leaves out."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is not None and settings.get_current_profile_name() == "random":
        seed = session.config.option.hypothesis_seed
        reporter.write_line(f"random examples: HYPOTHESIS_SEED={seed} draws them again")


@pytest.fixture(autouse=True)
def _untouched_log() -> None:
    """Undo what the commands of earlier tests and fixtures did to the log: pytest looks for messages at its root."""
    log = logging.getLogger("fig2mesh")
    log.handlers.clear()
    log.setLevel(logging.NOTSET)
    log.propagate = True


@pytest.fixture(scope="session")
def look() -> Look:
    """Open an address in headless Chromium and act there; Playwright drives it."""
    return browser()


@pytest.fixture(scope="session")
def cesium() -> Path:
    """CesiumJS as built for pages."""
    return cesium_js()
