"""Figures with columns of a table, for the tests of indexes."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import strategies as st

from exporters.placed_figure import PlacedFigure, plain_attributes
from fig2mesh.batch.collections.rows import MAX_INTEGER
from georef.placement import GeoPlacement
from tests.georef.strategies import headings, heights, latitudes, longitudes

text = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)
awkward_text = st.one_of(
    st.text(max_size=12), st.sampled_from(["", "=1+1", "+41", "-5", "@sum", "NULL", "1893", "true", "1e5", "Ä\n\t'\""])
)
borders = st.sampled_from([0, 2**53, 2**63, MAX_INTEGER])
# fmt: off
whole_numbers = st.builds(
    lambda border, step, sign: sign * min(border + step, MAX_INTEGER),
    borders, st.integers(-3, 3), st.sampled_from([1, -1]),
)
# fmt: on
values = st.one_of(
    st.none(), st.booleans(), st.integers(), whole_numbers, st.integers(-(2**63), 2**63 - 1), st.floats(), awkward_text
)
column_names = st.one_of(
    st.sampled_from(["artist", "Year", "year", "fid", "geom", "name", "NAME", "name_2", "model", "rowid", "title", ""]),
    st.text(max_size=8),
)
# fmt: off
places = st.builds(
    GeoPlacement, longitudes, latitudes, heights, st.sampled_from(["ellipsoid", "egm96"]), headings,
    altitude_mode=st.sampled_from(["absolute", "clamp"]),
)
# fmt: on


@st.composite
def tables(draw: st.DrawFn) -> list[PlacedFigure]:
    """Figures of one table: any columns, the same for all."""
    columns = draw(st.lists(column_names, max_size=5))
    rows = draw(st.lists(st.tuples(text, places, st.tuples(*(values for _ in columns))), max_size=6))
    return [figure(name, place, zip(columns, row, strict=True)) for name, place, row in rows]


def figure(name: str, place: GeoPlacement, attributes: object = ()) -> PlacedFigure:
    """A figure of one file, `<name>/<name>.glb`."""
    return PlacedFigure(
        name,
        place,
        (0.0, 0.0, 0.0),
        (1.0, 1.0, 1.0),
        (f"{name}/{name}.glb",),
        (0.0,),
        "a b.png",
        "© A & B",
        ("head", "torso"),
        (),
        0.25,
        plain_attributes(attributes),  # type: ignore[arg-type]
    )


def many(count: int) -> Iterator[PlacedFigure]:
    """Figures all over the earth with a year and an artist, every hundredth of them on the terrain."""
    for number in range(count):
        mode = "clamp" if number % 100 == 7 else "absolute"
        place = GeoPlacement(
            (number * 137.508) % 360 - 180, (number * 7919) % 170 - 85.0, float(number), altitude_mode=mode
        )
        artist = None if number % 3 == 0 else f"=artist {number % 11}"
        yield figure(f"figure {number}", place, {"year": 1600 + number % 400, "artist": artist})
