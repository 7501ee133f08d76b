"""Transfer function of sRGB (IEC 61966-2-1): colours are stored encoded, and light is added up in linear values."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def linear_from_srgb(srgb: NDArray[np.floating[Any]]) -> NDArray[Any]:
    """Decode sRGB values to linear light, both 0-1 and of any shape, without rounding."""
    return np.asarray(np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4))


def srgb_from_linear(linear: NDArray[np.floating[Any]]) -> NDArray[Any]:
    """Encode linear light as sRGB values, both 0-1 and of any shape, without rounding."""
    return np.asarray(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))
