"""Scores that Schnürer et al. 2024 report, each with its table in the paper."""

from __future__ import annotations

from typing import Final

# fmt: off
POSE_SCORES: Final = {
    (16, True): (42.23, 96.83), (16, False): (46.68, 95.10), (21, True): (48.82, 95.63), (21, False): (54.85, 93.30),
}
# fmt: on
"""(joints, perspective) → RMSE in mm and PCK150 in percent; table 1, "ours, ours"."""

# fmt: off
VARIANT_SCORES: Final = {
    "one-stream": (0.063, 47.80), "one-stream-pose": (0.051, 52.63),
    "two-stream": (0.063, 47.79), "two-stream-pose": (0.050, 53.31),
}
# fmt: on
"""Variant → RMSE and IoU in percent for hands; table 2."""

# fmt: off
PART_RMSE: Final = {
    "torso": 0.014, "head": 0.011, "upper_arm": 0.024, "lower_arm": 0.029, "hand": 0.050, "upper_leg": 0.015,
    "lower_leg": 0.013, "foot": 0.019,
}
# fmt: on
"""Kind → RMSE of the signed distance; table 3."""

# fmt: off
PART_IOU: Final = {
    "torso": 87.01, "head": 93.01, "upper_arm": 80.42, "lower_arm": 74.23, "hand": 53.31, "upper_leg": 87.65,
    "lower_leg": 83.66, "foot": 81.19,
}
# fmt: on
"""Kind → intersection over union in percent; table 3."""

UV_SCORES: Final = {False: (0.014, 0.042), True: (0.011, 0.031)}
"""Part masks as an input → MAE and RMSE of texture coordinates; table 4."""
