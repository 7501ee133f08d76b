"""HTML page of a globe with models; CesiumJS and the files are separate."""

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
from georef.untrusted.damage import DamagedFile
from georef.untrusted.picture_header import read_header

PACKAGE = "fig2mesh.globe"
SCRIPTS = ("shows.js", "colours.js", "ground.js", "page.js")

POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; worker-src 'self' blob:; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self' data: blob:; font-src 'self'"
)
"""Content security policy: the page fetches nothing from other sites, whatever the files refer to.

CesiumJS needs 'unsafe-eval' for its WebAssembly and for styles.
"""


@dataclass(frozen=True)
class Overlay:
    """A picture draped over the ground, north up.

    image : its file
    west, south, east, north : outer edges of the picture, degrees (not pixel centres)
    """

    image: Path
    west: float
    south: float
    east: float
    north: float

    def __post_init__(self) -> None:
        lon_ok = all(-180 <= lon <= 180 for lon in (self.west, self.east)) and self.west < self.east
        if not lon_ok or not -90 <= self.south < self.north <= 90:
            finding = f"{self.west:g} {self.south:g} {self.east:g} {self.north:g} is not a rectangle W S E N"
            raise InputError("--overlay", finding, "give degrees, west before east and south before north")
        if not self.image.is_file():
            raise InputError("--overlay", f"no such file {self.image}", "check the path")
        if self.image.suffix.lower() not in (".png", ".jpg", ".jpeg", ".webp"):
            raise InputError("--overlay", f"{self.image} is not a PNG, JPEG or WebP file", "convert it to PNG or JPEG")
        try:
            turned = read_header(self.image).orientation != 1
        except (DamagedFile, OSError):
            raise InputError("--overlay", f"{self.image} cannot be read", "give an intact PNG or JPEG") from None
        if turned:  # browsers turn it, or not, by where the file says so
            raise InputError("--overlay", f"{self.image} is rotated by its EXIF orientation", "save it upright")


def globe_page(assets: tuple[GlobeAsset, ...], overlays: tuple[Overlay, ...] = ()) -> str:
    """HTML page; it loads CesiumJS from cesium/ and the files from the URLs of `page_files`."""
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
        # "</" would end the script element, and "<!--" would change the parsing of its end.
        "facts": json.dumps(facts, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c"),
        "offline": asset("offline_viewer.js"),
        "style": asset("page.css", PACKAGE),
        "scripts": "\n".join(asset(name, PACKAGE) for name in SCRIPTS),
    }
    return filled("page.html", values, PACKAGE)


def page_files(assets: tuple[GlobeAsset, ...], overlays: tuple[Overlay, ...] = ()) -> dict[str, Path]:
    """URL → file, for everything that the page loads except CesiumJS."""
    found = {_address(index, name): each.folder / name for index, each in enumerate(assets) for name in each.files}
    return found | {_overlay(index, each): each.image for index, each in enumerate(overlays)}


def _address(index: int, name: str) -> str:
    address = posixpath.normpath(f"assets/{index}/{name}")
    if not address.startswith(f"assets/{index}/"):
        raise InputError(name, "lies outside of its tileset's folder", "put all files of a tileset into one folder")
    return address


def _overlay(index: int, overlay: Overlay) -> str:
    return f"overlays/{index}{overlay.image.suffix.lower()}"
