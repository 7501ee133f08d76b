"""The example script works."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from examples.place_figure import run
from exporters.inspect import inspect
from exporters.validate import validate


@pytest.mark.parametrize("name", ["farmer", "footballer", "market_woman"])
@pytest.mark.slow
def test_shipped_figures_become_valid_models(tmp_path: Path, name: str) -> None:
    *outputs, picture = run(tmp_path, name, quality="draft")
    for output in outputs:
        assert [f for f in validate(output) if f.severity in ("error", "warning")] == []
        facts = inspect(output)
        assert facts["watertight"]
        assert facts["components"] == 1
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
    assert len(np.unique(pixels // 32, axis=0)) > 20, "a picture of a coloured figure"
