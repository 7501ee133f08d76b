"""A placement survives being written as plain data."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from exporters.georeference import georeference, placement_of_record
from georef.placement import GeoPlacement
from georef.untrusted.damage import DamagedFile

PLACEMENTS = st.builds(
    GeoPlacement,
    lon_deg=st.floats(-180, 180),
    lat_deg=st.floats(-90, 90),
    height_m=st.floats(-500, 1e5),
    height_datum=st.sampled_from(["ellipsoid", "egm96", "grid.tif"]),
    heading_deg=st.floats(0, 360, exclude_max=True),
    figure_height_m=st.floats(0.001, 1e6),
    altitude_mode=st.sampled_from(["absolute", "clamp"]),
)


@given(PLACEMENTS)
def test_round_trip_through_json(placement: GeoPlacement) -> None:
    assert placement_of_record(json.loads(json.dumps(georeference(placement)))) == placement


@pytest.mark.parametrize(
    "change", [{"crs": "EPSG:2056"}, {"lat_deg": 91.0}, {"altitude_mode": "float"}, {"bearing": 3.0}, {"lon_deg": "8"}]
)
def test_a_record_of_another_kind_is_refused(change: dict[str, object]) -> None:
    record = georeference(GeoPlacement(8.5, 47.4)) | change
    with pytest.raises(DamagedFile, match="georeference"):
        placement_of_record(record)
