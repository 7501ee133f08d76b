"""Clients that several folders of tests look at pages with."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import Look, browser, cesium_js


@pytest.fixture(scope="session")
def look() -> Look:
    """Open an address in headless Chromium and act there; Playwright drives it."""
    return browser()


@pytest.fixture(scope="session")
def cesium() -> Path:
    """CesiumJS as built for pages."""
    return cesium_js()
