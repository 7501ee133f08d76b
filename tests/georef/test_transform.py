"""Laws of frames and transforms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given

from georef.frames import ASSET, ECEF, ENU, FRAMES, IMAGE, TILE
from georef.transform import Transform, column_major
from tests.georef.strategies import points, rigid

# Coordinates reach 3e4 m after two translations, a float64 step there is 4e-12 m; a few dozen roundings.
STEP_M = 1e-9


def test_the_table_names_every_frame_once():
    assert list(FRAMES) == ["IMAGE", "FIGURE", "PART", "ASSET", "TILE", "ENU", "ECEF", "GEODETIC", "MAP"]
    for name, frame in FRAMES.items():
        assert frame.name == str(frame) == name
        assert (frame.handedness == "right") == (len(frame.axes) == 3)


@given(rigid(ECEF, ENU), rigid(ENU, TILE), rigid(TILE, ASSET), points)
def test_composition_is_application_in_turn_and_associates(a, b, c, p):
    one_by_one = a.apply(b.apply(c.apply(p)))
    for joined in ((a @ b) @ c, a @ (b @ c)):
        assert (joined.target, joined.source) == (ECEF, ASSET)
        np.testing.assert_allclose(joined.apply(p), one_by_one, rtol=0, atol=STEP_M)


@given(rigid(ENU, TILE), points)
def test_inverse_undoes_and_swaps_the_frames(a, p):
    back = a.inverse()
    assert (back.target, back.source) == (TILE, ENU)
    np.testing.assert_allclose(back.apply(a.apply(p)), p, rtol=0, atol=STEP_M)
    np.testing.assert_allclose((a @ back).matrix, np.eye(4), rtol=0, atol=STEP_M)


@given(rigid(ENU, TILE), points)
def test_vectors_are_differences_of_points(a, p):
    np.testing.assert_allclose(a.apply_vectors(p), a.apply(p) - a.apply(np.zeros(3)), rtol=0, atol=STEP_M)


def test_joining_frames_that_differ_names_both():
    a, b = Transform(ECEF, ENU, np.eye(4)), Transform(TILE, ASSET, np.eye(4))
    with pytest.raises(ValueError, match=r"ECEF_from_ENU with TILE_from_ASSET: ENU is not TILE"):
        a @ b


def test_a_transform_is_frozen_and_keeps_its_own_matrix():
    matrix = np.eye(4)
    transform = Transform(ENU, TILE, matrix)
    matrix[0, 3] = 5.0
    assert transform.matrix[0, 3] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        transform.matrix[0, 0] = 2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        transform.matrix = matrix


@pytest.mark.parametrize(
    ("matrix", "finding"),
    [
        (np.eye(3), r"shape is \(3, 3\)"),
        (np.diag([1.0, np.nan, 1.0, 1.0]), "NaN"),
        (np.diag([1.0, 1.0, 1.0, 2.0]), "last row"),
    ],
)
def test_bad_matrices_are_named(matrix, finding):
    with pytest.raises(ValueError, match=f"ENU_from_TILE: .*{finding}"):
        Transform(ENU, TILE, matrix)


def test_flat_transforms_have_no_inverse():
    with pytest.raises(ValueError, match="ENU_from_TILE: matrix has no inverse"):
        Transform(ENU, TILE, np.diag([1.0, 1.0, 0.0, 1.0])).inverse()


def test_apply_computes_in_float64_and_leaves_its_input_alone():
    shift = np.eye(4)
    shift[:3, 3] = 4e6
    p = np.array([[1e-3, 0, 0]], np.float32)
    moved = Transform(ECEF, ENU, shift).apply(p)
    assert moved.dtype == np.float64
    assert moved[0, 0] == 4e6 + float(np.float32(1e-3))
    assert p[0, 0] == np.float32(1e-3)
    with pytest.raises(ValueError, match=r"IMAGE: shape is \(4, 2\)"):
        Transform(ENU, IMAGE, shift).apply(np.zeros((4, 2)))


def test_column_major_runs_down_the_columns_and_knows_no_negative_zero():
    matrix = np.eye(4)
    matrix[:3, 3] = (1.0, 2.0, 3.0)
    matrix[0, 1], matrix[1, 0] = -0.0, 7.0
    numbers = column_major(Transform(ECEF, TILE, matrix))
    assert numbers == [1, 7, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]
    assert "-0" not in str(numbers)
