"""Affine transforms tagged with their frames.

A transform reads `target_from_source`, so equal frames touch: `ecef_from_enu @ enu_from_tile @ tile_from_asset`
is an `ecef_from_asset`, and composing transforms whose frames do not match is an error instead of a misplaced figure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from georef.frames import Frame

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Transform:
    """An affine map of points in `source` to points in `target`.

    target, source : frames, see `georef.frames`
    matrix : (4, 4) float64, read-only; acts on column vectors (x, y, z, 1); last row is (0, 0, 0, 1)

    Raises ValueError for another shape, for values that are not finite and for another last row.
    """

    target: Frame
    source: Frame
    matrix: FloatArray

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=np.float64, order="C", copy=True)
        name = f"{self.target}_from_{self.source}"
        if matrix.shape != (4, 4):
            raise ValueError(f"{name}: matrix shape is {matrix.shape}, expected (4, 4)")
        if not np.isfinite(matrix).all():
            raise ValueError(f"{name}: matrix holds NaN or infinite values")
        if not np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]):
            raise ValueError(f"{name}: last row of the matrix is {matrix[3].tolist()}, expected [0, 0, 0, 1]")
        matrix.flags.writeable = False
        object.__setattr__(self, "matrix", matrix)

    def __repr__(self) -> str:
        return f"Transform({self.target} from {self.source}, {self.matrix.tolist()})"

    def __matmul__(self, other: Transform) -> Transform:
        """`a_from_b @ b_from_c`: the transform a_from_c. Raises ValueError where the inner frames differ."""
        if not isinstance(other, Transform):
            return NotImplemented
        if self.source != other.target:
            raise ValueError(
                f"cannot join {self.target}_from_{self.source} with {other.target}_from_{other.source}: "
                f"{self.source} is not {other.target}"
            )
        return Transform(self.target, other.source, self.matrix @ other.matrix)

    def inverse(self) -> Transform:
        """Return the transform source_from_target. Raises ValueError where the matrix is singular."""
        matrix = np.eye(4)
        try:
            # The 3x3 block alone: with an ECEF translation of 6e6 m a 4x4 solve would lose digits of the rotation.
            matrix[:3, :3] = np.linalg.inv(self.matrix[:3, :3])
        except np.linalg.LinAlgError as error:
            raise ValueError(f"{self.target}_from_{self.source}: matrix has no inverse") from error
        matrix[:3, 3] = -matrix[:3, :3] @ self.matrix[:3, 3]
        return Transform(self.source, self.target, matrix)

    def apply(self, points: ArrayLike) -> FloatArray:
        """Transform points from `source` to `target`.

        points : (N, 3) or (3,), any real dtype, source frame; not changed
        returns : same shape, float64, target frame
        """
        return self.apply_vectors(points) + self.matrix[:3, 3]

    def apply_vectors(self, vectors: ArrayLike) -> FloatArray:
        """Transform directions or differences from `source` to `target`, without the translation.

        vectors : (N, 3) or (3,), any real dtype, source frame; not changed. Surface normals may be
            transformed this way only if the transform preserves angles.
        returns : same shape, float64, target frame
        """
        array = np.asarray(vectors, dtype=np.float64)
        if array.ndim not in (1, 2) or array.shape[-1] != 3:
            raise ValueError(f"{self.source}: shape is {array.shape}, expected (N, 3) or (3,)")
        result: FloatArray = array @ self.matrix[:3, :3].T
        return result


def column_major(transform: Transform) -> list[float]:
    """Return the 16 numbers of a transform column by column, as in glTF `matrix` and 3D Tiles `transform`.

    https://docs.ogc.org/cs/22-025r4/22-025r4.html#core-tile-transforms
    """
    # Adding zero turns -0.0 into 0.0: equal transforms must be written identically.
    return [float(value) + 0.0 for value in transform.matrix.T.ravel()]
