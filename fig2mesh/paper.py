"""Constants of Schnürer et al. 2024, each with its place in the paper."""

from __future__ import annotations

from typing import Final

FIGURE_HEIGHT: Final = 1.79
"""Height of every figure, units (and metres unless asked otherwise); §4.1, "uniformly to 1.79m"."""
