"""Place a shipped figure on the globe: GLB, 3D Tiles, USDZ and a picture of its front, side and back.

python examples/place_figure.py [OUT]
"""

from __future__ import annotations

import sys
from pathlib import Path

from fig2mesh.commands.main import main
from fig2mesh.measure.model import load_textured
from fig2mesh.mesh.preview import write_preview

FIGURES = Path(__file__).parent / "figures"


def run(out_dir: Path, name: str = "farmer", quality: str = "standard") -> list[Path]:
    """Convert one figure of `examples/figures` and return the files made."""
    out_dir.mkdir(parents=True, exist_ok=True)
    figure = FIGURES / name
    outputs = [out_dir / f"{name}.glb", out_dir / f"{name}_tiles" / "tileset.json", out_dir / f"{name}.usdz"]
    arguments = [str(figure / "image.png"), "--keypoints", str(figure / "keypoints.json")]
    arguments += ["--lonlat", "8.5417", "47.3769", "--facing", "viewer", "--quality", quality, "--overwrite"]
    arguments += ["--lods", "2", "--report", str(out_dir / f"{name}.report.json")]
    for output in outputs:
        arguments += ["-o", str(output)]
    code = main(arguments)
    if code:
        raise SystemExit(code)
    picture = out_dir / f"{name}.png"
    write_preview(load_textured(outputs[0]), picture)
    return [*outputs, picture]


if __name__ == "__main__":
    for path in run(Path(sys.argv[1] if len(sys.argv) > 1 else "build/demo")):
        print(path)
