"""A browser without a window, and what it shows."""

from __future__ import annotations

import base64
import io
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from fig2mesh.view.server import address_of
from tests.node import ROOT, installed, runner

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")

Look = Callable[..., dict[str, Any]]


def chromium() -> str:
    """The program."""
    program = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if program is None:
        pytest.skip(f"no browser ({', '.join(BROWSERS)}): pages not looked at; apt-get install chromium")
    return program


def browser() -> Look:
    """A function that opens an address in headless Chromium and acts there, see tests/clients/view.mjs."""
    program = chromium()
    run = runner(installed(ROOT / "build" / "browser", "playwright-core"))

    def act(url: str, *actions: dict[str, Any], size: tuple[int, int] = (256, 256)) -> dict[str, Any]:
        job = {"browser": program, "url": url, "width": size[0], "height": size[1], "actions": actions}
        return dict(run("view.mjs", stdin=job))

    return act


def cesium_js() -> Path:
    """CesiumJS as built for pages."""
    return installed(ROOT / "build" / "node", "gltf-validator", "cesium") / "cesium" / "Build" / "Cesium"


@contextmanager
def serving(server: ThreadingHTTPServer) -> Iterator[str]:
    """The address of a server that answers meanwhile."""
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield address_of(server)
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def pixels(png: str) -> NDArray[np.uint8]:
    """(H, W, 4) of a PNG in base64."""
    with Image.open(io.BytesIO(base64.b64decode(png))) as image:
        return np.asarray(image.convert("RGBA"))
