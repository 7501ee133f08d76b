"""Write the table of docs/clients.md, and a sheet of the pictures, from what tests/clients/test_matrix.py has measured.

python docs/make_clients_table.py [RECORDS]    RECORDS: folder of the records, build/clients unless given
"""

from __future__ import annotations

import json
import sys
from itertools import groupby
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "clients.md"
START, END = "<!-- table of clients: python docs/make_clients_table.py -->", "<!-- end of the table of clients -->"
TITLES = {
    "glb": ".glb",
    "gltf": ".gltf",
    "glb cesiumjs": ".glb `--profile cesiumjs`",
    "glb blender": ".glb `--profile blender`",
    "obj": ".obj",
    "ply": ".ply",
    "usda": ".usda",
    "usdc": ".usdc",
    "usdz": ".usdz",
    "czml": ".czml",
    "geojson": ".geojson",
    "tiles": "tileset 1.1",
    "tiles 1.0": "tileset 1.0",
    "tiles cesiumjs": "tileset `--profile cesiumjs`",
    "tiles lods": "tileset `--lods 3`",
    "six": "tileset of six, 1.1",
    "six 1.0": "tileset of six, 1.0",
    "stac": "STAC catalogue",
    "gpkg": "`index.gpkg`",
    "index": "`index.geojson`",
}
COLUMNS = 10


def records(folder: Path) -> list[dict[str, Any]]:
    """Records of all tests, in the order in which they were measured."""
    return [each for path in sorted(folder.glob("*.json")) for each in json.loads(path.read_text(encoding="utf-8"))]


def table(found: list[dict[str, Any]]) -> str:
    """Markdown: a row for each client, with the greatest error of what it opens."""
    lines = [
        "| client | version | opens | feet, mm | bearing, ° | height, % | colours, of 255 | does not open |",
        "|---|---|---|---:|---:|---:|---:|---|",
    ]
    for (client, version), group in groupby(found, key=lambda each: (each["client"], each["version"])):
        rows = list(group)
        opened = [each for each in rows if each["result"] == "opened"]
        opens = ", ".join(TITLES[each["output"]] for each in opened) or "–"
        refused = "; ".join(f"{TITLES[each['output']]} ({_short(each['note'])})" for each in rows if each not in opened)
        numbers = [
            _worst(opened, "place_m", 1000.0),
            _worst(opened, "bearing_deg"),
            _worst(opened, "height_percent"),
            _worst(opened, "colours"),
        ]
        lines.append(f"| {client} | {version} | {opens} | {' | '.join(numbers)} | {refused or '–'} |")
    return "\n".join(lines)


def _worst(rows: list[dict[str, Any]], name: str, scale: float = 1.0) -> str:
    # Figures of a group are too small in the picture for their colours.
    counted = [each for each in rows if name != "colours" or not each["output"].startswith("six")]
    values = [scale * each[name] for each in counted if each[name] is not None]
    return "–" if not values else f"{max(values):.1f}" if name in ("place_m", "colours") else f"{max(values):.2f}"


def _short(note: str) -> str:
    return note.replace("|", "/").replace("\n", " ")[:120]


def sheet(folder: Path) -> None:
    """Write montage.png from the pictures."""
    paths = sorted(folder.glob("*.png"))
    paths = [path for path in paths if path.name != "montage.png"]
    if not paths:
        return
    width, height = Image.open(paths[0]).size
    rows = -(-len(paths) // COLUMNS)
    result = Image.new("RGB", (COLUMNS * width, rows * (height + 20)), "#ddd")
    pen = ImageDraw.Draw(result)
    for index, path in enumerate(paths):
        left, top = index % COLUMNS * width, index // COLUMNS * (height + 20)
        with Image.open(path) as image:
            result.paste(image.convert("RGB"), (left, top + 20))
        pen.text((left + 2, top + 4), path.stem[-38:], fill="black")
    result.save(folder / "montage.png")


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "clients"
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(START)
    _, _, after = rest.partition(END)
    PAGE.write_text(f"{before}{START}\n\n{table(records(folder))}\n\n{END}{after}", encoding="utf-8")
    sheet(folder)


if __name__ == "__main__":
    main()
