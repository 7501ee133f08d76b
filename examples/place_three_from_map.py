"""Place the three people of a pictorial map where it shows them, as tall on the globe as they are drawn on the map.

python examples/place_three_from_map.py [OUT]

The map's world file says where its pixels are; figures.csv says where on it the feet are. One tileset holds all three.
To see them stand on it: fig2mesh globe OUT/tiles --overlay examples/maps/lake_zurich/map.jpg 8.38 47.16 8.92 47.44
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from fig2mesh.cli import main

MAP = Path(__file__).resolve().parent / "maps" / "lake_zurich"


def run(out_dir: Path, quality: str = "standard", suffixes: tuple[str, ...] = (".glb", ".usdc")) -> list[Path]:
    """Convert the figures on the map; return the files made, one a figure and suffix, and the tileset of all."""
    out_dir = Path(out_dir)
    out_dir.mkdir(parents=True, exist_ok=True)
    outputs = []
    with (MAP / "figures.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            image = MAP / row["figure"]
            made = [out_dir / f"{row['name'].replace(' ', '_')}{suffix}" for suffix in suffixes]
            _fig2mesh(
                image, "--keypoints", image.with_name("keypoints.json"), "--name", row["name"],
                "--map", MAP / row["map"], "--at", row["x"], row["y"], "--height-m", row["height-m"],
                "--quality", quality, "--credit", "fig2mesh authors, MIT", "--overwrite",
                *(word for path in made for word in ("-o", path)),
            )  # fmt: skip
            outputs += made
    tiles = out_dir / "tiles"
    models = [path for path in outputs if path.suffix == ".glb"]
    _fig2mesh("tileset", *models, "-o", tiles, "--visible-from", 500_000, "--overwrite")
    return [*outputs, tiles / "tileset.json"]


def _fig2mesh(*words: object) -> None:
    code = main([str(word) for word in words])
    if code:
        raise SystemExit(code)


if __name__ == "__main__":
    for path in run(Path(sys.argv[1] if len(sys.argv) > 1 else "build/map")):
        print(path)
