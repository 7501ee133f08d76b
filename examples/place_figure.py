"""Place a shipped figure on the globe: GLB, 3D Tiles, USDZ and a picture of its front, side and back.

python examples/place_figure.py [OUT]
"""

from __future__ import annotations

import sys
from pathlib import Path

import fig2mesh
from fig2mesh.mesh.preview import write_preview
from fig2mesh.settings import Quality

FIGURES = Path(__file__).parent / "figures"


def run(out_dir: Path, name: str = "farmer", quality: Quality = "standard") -> list[Path]:
    """Convert one figure of `examples/figures` and return the files made."""
    out_dir.mkdir(parents=True, exist_ok=True)
    request = fig2mesh.Request(
        FIGURES / name / "image.png",
        keypoints=FIGURES / name / "keypoints.json",
        name=name,
        lonlat=(8.5417, 47.3769),
        facing="viewer",
        quality=quality,
        lods=2,
    )
    model = fig2mesh.convert(request)
    outputs = [out_dir / f"{name}.glb", out_dir / f"{name}_tiles" / "tileset.json", out_dir / f"{name}.usdz"]
    fig2mesh.write(model, *outputs, overwrite=True)
    picture = out_dir / f"{name}.png"
    write_preview(model.asset.mesh, picture)
    return [*outputs, picture]


if __name__ == "__main__":
    try:
        for path in run(Path(sys.argv[1] if len(sys.argv) > 1 else "build/demo")):
            print(path)
    except fig2mesh.InputError as error:
        raise SystemExit(str(error)) from None
