"""The page of a globe with models on it: one HTML text, CesiumJS and the files beside it."""

from __future__ import annotations

import html
import json
import posixpath
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fig2mesh.errors import InputError
from fig2mesh.globe.assets import GlobeAsset
from fig2mesh.view.cesium import CESIUM
from fig2mesh.view.template import asset, filled

PACKAGE = "fig2mesh.globe"
SCRIPTS = ("shows.js", "colours.js", "ground.js", "page.js")

POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; worker-src 'self' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self' data: blob:; font-src 'self'"
)
"""Browsers keep the page to it: nothing is fetched from elsewhere, whatever the files name.

CesiumJS needs 'unsafe-eval' for what it brings along as WebAssembly and for styles.
"""


@dataclass(frozen=True)
class Overlay:
    """A picture that lies on the ground, north up.

    image : its file
    west, south, east, north : degrees; of the outer edges of the picture, not of pixel centres
    """

    image: Path
    west: float
    south: float
    east: float
    north: float

    def __post_init__(self) -> None:
        lon_fine = all(-180 <= lon <= 180 for lon in (self.west, self.east)) and self.west < self.east
        if not lon_fine or not -90 <= self.south < self.north <= 90:
            finding = f"no rectangle W S E N: {self.west:g} {self.south:g} {self.east:g} {self.north:g}"
            raise InputError("--overlay", finding, "give degrees, west before east and south before north")
        if not self.image.is_file():
            raise InputError("--overlay", f"{self.image} is not there", "check the name")
        if self.image.suffix.lower() not in (".png", ".jpg", ".jpeg", ".webp"):
            raise InputError("--overlay", f"browsers show no {self.image.suffix or 'such file'}", "give PNG or JPEG")


def globe_page(assets: tuple[GlobeAsset, ...], overlays: tuple[Overlay, ...] = ()) -> str:
    """The page; it finds CesiumJS at cesium/ and the files at the addresses of `page_files`."""
    facts: dict[str, Any] = {
        "assets": [
            {"kind": each.kind, "url": quote(_address(index, each.main)), **each.facts}
            for index, each in enumerate(assets)
        ],
        "overlays": [
            {"url": quote(_overlay(index, each)), "rectangle": [each.west, each.south, each.east, each.north]}
            for index, each in enumerate(overlays)
        ],
        "cesium": f"{CESIUM}/",
    }
    names = list(dict.fromkeys(each.facts["name"] for each in assets))
    title = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    values = {
        "title": html.escape(title),
        "policy": html.escape(POLICY),
        "cesium": f"{CESIUM}/",
        # "</" would end the script element, and "<!--" change how its end is looked for.
        "facts": json.dumps(facts, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c"),
        "offline": asset("offline_viewer.js"),
        "style": asset("page.css", PACKAGE),
        "scripts": "\n".join(asset(name, PACKAGE) for name in SCRIPTS),
    }
    return filled("page.html", values, PACKAGE)


def page_files(assets: tuple[GlobeAsset, ...], overlays: tuple[Overlay, ...] = ()) -> dict[str, Path]:
    """Address → file, for all that the page loads except CesiumJS."""
    found = {_address(index, name): each.folder / name for index, each in enumerate(assets) for name in each.files}
    return found | {_overlay(index, each): each.image for index, each in enumerate(overlays)}


def _address(index: int, name: str) -> str:
    address = posixpath.normpath(f"assets/{index}/{name}")
    if not address.startswith(f"assets/{index}/"):
        raise InputError(name, "lies outside of its tileset's folder", "put all files of a tileset into one folder")
    return address


def _overlay(index: int, overlay: Overlay) -> str:
    return f"overlays/{index}{overlay.image.suffix.lower()}"
