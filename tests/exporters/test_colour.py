"""The curve of sRGB against its definition."""

from __future__ import annotations

import numpy as np
import pytest

from exporters.colour import linear_from_srgb, srgb_from_linear

BYTES = np.arange(256) / 255.0


def test_known_values() -> None:
    assert linear_from_srgb(np.array([0.0, 0.04045, 0.5, 1.0])) == pytest.approx([0, 0.0031308, 0.214041, 1], abs=1e-6)
    assert srgb_from_linear(np.array([0.0, 0.0031308, 0.5, 1.0])) == pytest.approx([0, 0.04045, 0.73536, 1], abs=1e-5)


def test_round_trip_of_every_byte() -> None:
    assert np.allclose(srgb_from_linear(linear_from_srgb(BYTES)), BYTES, atol=1e-7)


def test_both_are_monotone_and_keep_shape_and_precision() -> None:
    for curve in (linear_from_srgb, srgb_from_linear):
        assert (np.diff(curve(np.linspace(0, 1, 10_001))) > 0).all()
        assert curve(BYTES.reshape(4, 64)).shape == (4, 64)
        assert curve(BYTES.astype(np.float32)).dtype == np.float32
