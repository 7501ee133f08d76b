"""Samples and training on a machine that has only NumPy and torch."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from fig2mesh.training.bodies.pack import save_pack
from tests.fig2mesh.training.figures import capsule_pack

SCRIPT = """
import sys


class Bare:
    def find_spec(self, name, path=None, target=None):
        top = name.split(".")[0]
        if top in BLOCKED:
            raise ModuleNotFoundError(f"No module named {top!r}", name=top)

BLOCKED = {"scipy", "open3d", "trimesh", "numba", "PIL", "skimage", "matplotlib", "anny", "click", "rich", "pymeshlab"}
sys.meta_path.insert(0, Bare())

from pathlib import Path
import numpy as np
from fig2mesh.nets.disn import DisnShape
from fig2mesh.training.samples.build import BuildOptions, build
from fig2mesh.training.networks.schedule import Schedule
from fig2mesh.training.networks.train_parts import PartSampling, train_parts

folder = Path(sys.argv[1])
build(folder / "pack.npz", folder / "data", BuildOptions(bodies=1, valid=0))
shape, few = DisnShape("hand"), PartSampling(points=64)
scores = train_parts(folder / "data", "hand", shape, folder / "run", Schedule(batch=4), few, epochs=1)
assert np.isfinite(scores["loss"]), scores
assert not BLOCKED & {name.split(".")[0] for name in sys.modules}
print("done")
"""


@pytest.mark.slow
def test_samples_and_a_training_step_need_only_numpy_and_torch(tmp_path: Path) -> None:
    save_pack(capsule_pack(), tmp_path / "pack.npz")
    done = subprocess.run([sys.executable, "-c", SCRIPT, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "done", done.stderr[-2000:]
