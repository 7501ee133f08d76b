"""Place the three people of a pictorial map where it shows them, as tall on the globe as they are drawn on the map.

python examples/place_three_from_map.py [OUT]

The map's world file turns pixels into longitude and latitude; figures.csv says where the feet are. To see them stand
on it: fig2mesh globe OUT/*.glb --overlay examples/maps/lake_zurich/map.jpg 8.38 47.16 8.92 47.44
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from fig2mesh.cli import main

MAP = Path(__file__).resolve().parent / "maps" / "lake_zurich"


def run(out_dir: Path, quality: str = "standard", suffixes: tuple[str, ...] = (".glb", ".usdc")) -> list[Path]:
    """Convert the figures on the map and return the files made, one a figure and suffix."""
    out_dir = Path(out_dir)
    out_dir.mkdir(parents=True, exist_ok=True)
    dx, _, _, dy, lon, lat = map(float, (MAP / "map.jgw").read_text().split())
    outputs = []
    with (MAP / "figures.csv").open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            image = MAP / row["figure"]
            name = row["name"].replace(" ", "_")
            # The world file speaks of the middle of the first pixel, which is at +0.5.
            place = [lon + dx * (float(row["x"]) - 0.5), lat + dy * (float(row["y"]) - 0.5)]
            arguments = [str(image), "--keypoints", str(image.with_name("keypoints.json"))]
            arguments += ["--lonlat", *(f"{degrees:.9f}" for degrees in place), "--height-m", row["height-m"]]
            arguments += [
                "--facing",
                "viewer",
                "--quality",
                quality,
                "--credit",
                "fig2mesh authors, MIT",
                "--overwrite",
            ]
            made = [out_dir / f"{name}{suffix}" for suffix in suffixes]
            code = main(arguments + [word for path in made for word in ("-o", str(path))])
            if code:
                raise SystemExit(code)
            outputs += made
    return outputs


if __name__ == "__main__":
    for path in run(Path(sys.argv[1] if len(sys.argv) > 1 else "build/map")):
        print(path)
