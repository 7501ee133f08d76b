"""Names of rows, and their spool."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from fig2mesh.batch.collections.rows import Row
from fig2mesh.batch.tasks import MAX_NAME, TAKEN, read_spool, tasks_of, write_spool


def _rows(*values: dict[str, object]) -> list[Row]:
    return [Row(number, f"line {number + 1}", value) for number, value in enumerate(values, start=1)]


def test_rows_without_names_are_called_like_their_pictures() -> None:
    rows = _rows({"figure": "a/farmer.png"}, {"figure": "b/farmer.jpg"}, {"figure": "FARMER.png"}, {})
    assert [task.name for task in tasks_of(rows)] == ["farmer", "farmer_2", "FARMER_3", "row_4"]


def test_a_name_given_twice_is_a_problem_of_the_second_row() -> None:
    first, second, third = tasks_of(_rows(*({"name": name, "figure": "a.png"} for name in ("Anna", "anna", "Bert"))))
    assert (first.problem, third.problem) == (None, None)
    assert str(second.problem) == "line 3: its name anna is also that of row 1; give each row a unique name"
    assert second.name != first.name


def test_names_of_our_own_files_are_not_given() -> None:
    (task,) = tasks_of(_rows({"name": TAKEN[0]}))
    assert task.problem is not None
    assert task.name != TAKEN[0]


@given(st.lists(st.fixed_dictionaries({}, optional={"name": st.text(), "figure": st.text()}), max_size=30))
@settings(max_examples=60)
def test_names_are_one_folder_each_and_stay_inside(values: list[dict[str, str]]) -> None:
    names = [task.name for task in tasks_of(_rows(*values))]
    assert len({name.casefold() for name in names}) == len(names)
    for name in names:
        assert Path(name).parts == (name,)
        assert not name.startswith(".")
        assert len(name) <= MAX_NAME + 5


@given(
    st.lists(
        st.dictionaries(
            st.text(), st.text() | st.integers() | st.booleans() | st.tuples(st.integers(), st.text()), max_size=4
        ),
        max_size=10,
    )
)
@settings(max_examples=60)
def test_the_spool_gives_back_what_went_in(tmp_path_factory: object, values: list[dict[str, object]]) -> None:
    path = tmp_path_factory.mktemp("spool") / "rows.jsonl"  # type: ignore[attr-defined]
    tasks = list(tasks_of(_rows(*values)))
    count, unknown = write_spool(tasks, path)
    assert count == len(values)
    assert list(read_spool(path)) == tasks
    assert all(column in value for column in unknown for value in [{c for v in values for c in v}])
