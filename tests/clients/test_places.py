"""Agreement of CesiumJS and USD about the positions of figures, at five places on the earth."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import Look
from tests.clients.places import (
    BEARING_TOLERANCE_DEG,
    FEET_TOLERANCE_M,
    FORMATS,
    PICK_TOLERANCE_PX,
    PLACES,
    measure,
    table,
)


@pytest.mark.slow
def test_feet_and_nose_are_at_the_requested_place(tmp_path: Path, look: Look, cesium: Path) -> None:
    found = measure(tmp_path, look, cesium)
    assert [(each.place, each.format) for each in found] == [(place, kind) for place in PLACES for kind in FORMATS]
    for each in found:
        assert each.feet_m < FEET_TOLERANCE_M, each
        assert each.bearing_deg < BEARING_TOLERANCE_DEG, each
        if each.format != "USD":
            assert each.picked_px is not None, each
            assert each.picked_px < PICK_TOLERANCE_PX, each
            assert each.names == ("feet", "nose"), each
    assert table(found).count("\n| ") == len(found) + 1
