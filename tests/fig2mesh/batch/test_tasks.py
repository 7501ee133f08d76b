"""Names of rows, and their spool."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from exporters.file_names import MAX_NAME_CHARACTERS, name_key, safe_name
from fig2mesh.batch.collections.rows import Row
from fig2mesh.batch.tasks import TAKEN, read_spool, tasks_of, write_spool


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
        assert len(name) <= MAX_NAME_CHARACTERS + 5


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


def test_names_that_differ_only_in_case_or_composition_are_the_same_name() -> None:
    for one, other in (
        ("Müller", "Mu\u0308ller"),
        ("한글", "\u1112\u1161\u11ab\u1100\u1173\u11af"),
        ("STRASSE", "Straße"),
    ):
        first, second = tasks_of(_rows({"name": one, "figure": "a.png"}, {"name": other, "figure": "a.png"}))
        assert first.problem is None
        assert "is also that of row 1; give each row a unique name" in str(second.problem)


def test_names_that_no_folder_tells_apart_are_numbered() -> None:
    names = ("who?", "who!", "who*", "CON", "con_")
    tasks = list(tasks_of(_rows(*({"name": name, "figure": "a.png"} for name in names))))
    assert [task.problem for task in tasks] == [None] * 5
    assert [task.name for task in tasks] == ["who_", "who__2", "who__3", "CON_", "con__2"]
    assert [task.title for task in tasks] == list(names)


def test_pictures_called_image_are_named_after_their_folders() -> None:
    figures = ("farmer/image.png", r"..\maps\monk\IMG_0001.JPG", "image.png", "images/image.png", "sheet/anna.png")
    found = [task.name for task in tasks_of(_rows(*({"figure": each} for each in figures)))]
    assert found == ["farmer", "monk", "image", "image_2", "anna"]


@given(st.lists(st.text(max_size=80), max_size=12))
@settings(max_examples=60)
def test_no_two_rows_share_a_folder_on_any_file_system(names: list[str]) -> None:
    found = [task.name for task in tasks_of(_rows(*({"name": name, "figure": "a"} for name in names)))]
    assert len({name_key(name) for name in found}) == len(found)
    assert all(safe_name(name) == name or name[-1].isdigit() for name in found)


def test_further_files_of_the_tileset_are_not_names_of_figures() -> None:
    (task,) = tasks_of(_rows({"name": "Tileset_01.json", "figure": "a.png"}))
    assert "a file of the batch" in str(task.problem)
