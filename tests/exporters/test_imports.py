"""Importing the exporters is cheap: what is heavy is imported by the function that needs it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import exporters
from tests.node import ROOT

HEAVY = ("torch", "open3d", "pxr", "trimesh", "pygltflib", "scipy", "pyproj", "pyogrio", "PIL", "fig2mesh")


def test_importing_every_module_imports_nothing_heavy() -> None:
    folder = Path(exporters.__path__[0])
    modules = sorted(".".join(path.relative_to(folder).with_suffix("").parts) for path in folder.rglob("[a-z]*.py"))
    code = "".join(f"import exporters.{module}\n" for module in modules)
    code += f"import sys; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"
