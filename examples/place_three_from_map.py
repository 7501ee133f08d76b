"""Place the three people of a pictorial map where it shows them, as tall on the globe as they are drawn on the map.

python examples/place_three_from_map.py [OUT [QUALITY]]

A collection of three rows: figures.csv says where on the map the feet are, the map's world file where its pixels are on
the earth. A collection of thousands is converted by the same command. To see the three stand on their map:
fig2mesh globe OUT/tileset.json --overlay examples/maps/lake_zurich/map.jpg 8.38 47.16 8.92 47.44
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from fig2mesh.batch.job import run as run_batch
from fig2mesh.batch.request import BatchRequest

EXAMPLES = Path(__file__).resolve().parent
MAP = EXAMPLES / "maps" / "lake_zurich"


def run(out_dir: Path, quality: str = "standard", formats: tuple[str, ...] = ("usdc",)) -> list[Path]:
    """Convert the figures on the map; return the files made, one a figure and format, and the tileset of all."""
    request = BatchRequest(
        MAP / "figures.csv",
        output=Path(out_dir),
        root=EXAMPLES,
        formats=formats,
        title="Around Lake Zürich",
        defaults={"quality": quality, "credit": "fig2mesh authors, MIT"},
    )
    if code := run_batch(request):
        raise SystemExit(code)
    rows = map(json.loads, (Path(out_dir) / "manifest.jsonl").read_text(encoding="utf-8").splitlines())
    return [*(Path(out_dir) / name for row in rows for name in row["outputs"]), Path(out_dir) / "tileset.json"]


if __name__ == "__main__":
    for path in run(Path(sys.argv[1] if len(sys.argv) > 1 else "build/map"), *sys.argv[2:3]):
        print(path)
