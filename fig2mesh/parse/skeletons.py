"""Names of the points that pose estimators write by number, in their order."""

from __future__ import annotations

from typing import Final

# fmt: off
COCO_17: Final = (
    "nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle",
    "right_ankle",
)
"""https://cocodataset.org/#keypoints-2020"""

HALPE_26: Final = (
    *COCO_17, "head_top", "neck", "hip", "left_big_toe", "right_big_toe", "left_small_toe", "right_small_toe",
    "left_heel", "right_heel",
)
"""https://github.com/Fang-Haoshu/Halpe-FullBody"""

WHOLE_BODY_23: Final = (
    *COCO_17, "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe", "right_heel",
)
"""https://github.com/jin-s13/COCO-WholeBody; points of face and hands follow."""

OPENPOSE_18: Final = (
    "nose", "neck", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow", "left_wrist",
    "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle", "right_eye", "left_eye",
    "right_ear", "left_ear",
)

BODY_25: Final = (
    *OPENPOSE_18[:8], "mid_hip", *OPENPOSE_18[8:], "left_big_toe", "left_small_toe", "left_heel", "right_big_toe",
    "right_small_toe", "right_heel",
)
"""https://github.com/CMU-Perceptual-Computing-Lab/openpose/blob/master/doc/02_output.md"""

MEDIAPIPE_33: Final = (
    "nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer",
    "left_ear", "right_ear", "mouth_left", "mouth_right", "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow", "left_wrist", "right_wrist", "left_pinky", "right_pinky", "left_index", "right_index",
    "left_thumb", "right_thumb", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle",
    "left_heel", "right_heel", "left_foot_index", "right_foot_index",
)
"""https://ai.google.dev/edge/mediapipe/solutions/vision/pose_landmarker"""
# fmt: on

OTHER_POINTS: Final = (
    *(name for name in MEDIAPIPE_33 if name.split("_")[-1] in ("inner", "outer", "pinky", "thumb", "heel")),
    *("mouth_left", "mouth_right", "left_small_toe", "right_small_toe"),
)
"""Names among these that stand for no joint of ours."""


def names_by_count(count: int) -> tuple[str, ...] | None:
    """Names of the points of a skeleton of COCO's family that has so many; names of the body alone."""
    named: dict[int, tuple[str, ...]] = {
        17: COCO_17,
        23: WHOLE_BODY_23,
        26: HALPE_26,
        33: MEDIAPIPE_33,
        133: (*WHOLE_BODY_23, *(f"point {index}" for index in range(23, 133))),
        136: (*HALPE_26, *(f"point {index}" for index in range(26, 136))),
    }
    return named.get(count)
