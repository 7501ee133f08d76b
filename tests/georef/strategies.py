"""Places, headings and transforms for the property tests, with the cases that break naive code made frequent."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from georef.frames import Frame
from georef.placement import GeoPlacement
from georef.transform import Transform

longitudes = st.one_of(
    st.floats(-180.0, 180.0),
    st.sampled_from([-180.0, -180.0 + 1e-9, -90.0, -1e-9, -0.0, 0.0, 1e-9, 90.0, 180.0 - 1e-9, 180.0]),
)
latitudes = st.one_of(
    st.floats(-90.0, 90.0),
    st.sampled_from([-90.0, -90.0 + 1e-9, -1e-9, 0.0, 1e-9, 90.0 - 1e-9, 90.0]),
)
heights = st.one_of(st.floats(-500.0, 100_000.0), st.sampled_from([-500.0, 0.0, 1e-9, 100_000.0]))
headings = st.one_of(st.floats(0.0, 360.0, exclude_max=True), st.sampled_from([0.0, 90.0, 180.0, 270.0, 360.0 - 1e-9]))

placements = st.builds(GeoPlacement, longitudes, latitudes, heights, st.just("ellipsoid"), headings)

coordinates = st.floats(-1e4, 1e4)
points = st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=5).map(np.array)


def rigid(target: Frame, source: Frame) -> st.SearchStrategy[Transform]:
    """Rotations (from quaternions) with a translation."""

    def build(quaternion: tuple[float, ...], translation: tuple[float, ...]) -> Transform:
        w, x, y, z = np.array(quaternion) / np.linalg.norm(quaternion)
        matrix = np.eye(4)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        matrix[:3, 3] = translation
        return Transform(target, source, matrix)

    part = st.floats(-1.0, 1.0)
    quaternions = st.tuples(part, part, part, part).filter(lambda q: np.linalg.norm(q) > 0.1)
    return st.builds(build, quaternions, st.tuples(coordinates, coordinates, coordinates))
