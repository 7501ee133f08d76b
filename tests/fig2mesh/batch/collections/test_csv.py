"""CSV as spreadsheets leave it, and as it should not be."""

from __future__ import annotations

from pathlib import Path

import pytest

from fig2mesh.batch.collections.read import columns, read_rows
from fig2mesh.batch.collections.rows import MAX_COLUMNS, MAX_RECORD
from fig2mesh.errors import InputError


def rows_of(path: Path, data: bytes | str):
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return list(read_rows(path))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.csv"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_are_counted_as_editors_do(path, end):
    text = end.join(["", "figure,note", "a.png,x", "", 'b.png,"one', "", 'two"', ",", "c.png,z", ""])
    found = rows_of(path, text)
    assert [(row.number, row.where, row.values["figure"]) for row in found] == [
        (1, "line 3", "a.png"),
        (2, "line 5", "b.png"),
        (3, "line 9", "c.png"),
    ]
    assert found[1].values["note"] == f"one{end}{end}two"


@pytest.mark.parametrize(
    "header",
    [
        "figure;note, or so;c",
        "note, or so;figure;c",
        "FIGURE ;a,b,c,d;e",
        '"lon;lat";figure;c',
        "sep=;\nfigure;a,b;c,d",
    ],
)
def test_the_separator_is_the_one_that_makes_figure_a_column(path, header):
    (row,) = rows_of(path, f"{header}\na.png;a.png;c.png\n")
    assert row.problem is None
    assert len(row.values) == 3


def test_a_single_column_is_a_table(path):
    assert [row.values for row in rows_of(path, "figure\na.png\n b;c.png \n")] == [
        {"figure": "a.png"},
        {"figure": "b;c.png"},
    ]


def test_empty_columns_of_spreadsheets_are_left_out(path):
    found = rows_of(path, "figure,,name,,\na.png,,A,,\nb.png,,B,,,,,\n,,,,\nc.png,x,C,,\n")
    assert [row.values for row in found[:2]] == [{"figure": "a.png", "name": "A"}, {"figure": "b.png", "name": "B"}]
    assert [row.problem for row in found] == [None, None, "'x' under an empty heading; name the column"]
    assert columns(path) == ("figure", "name")


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("b.png", "1 cells under 3 headings; give all cells, including empty ones"),
        ("b.png,1,2,3", "4 cells under 3 headings; quote cells that contain the separator"),
        ('b.png,"x"y,2', "quote in the middle of a cell; double quotes within quotes"),
        ('b.png,"x,2', "unclosed quote; close it, and double quotes within quotes"),
        ("b.png,\0,2", "note: NUL character; remove it"),
        ("b.png," + "x" * 70_000 + ",2", "note: more than 65,536 characters; give a shorter text"),
        ("b.png," + "x" * 200_000 + ",2", "a cell of more than 65,536 characters; close its quotes, or shorten it"),
        ("b.png," + "x" * MAX_RECORD + ",2", "more than 1,048,576 characters; close its quotes, or shorten it"),
        ("b.png," + "x" * 3 * MAX_RECORD + ",2", "more than 1,048,576 characters; close its quotes, or shorten it"),
        ('b.png,"' + "x\n" * MAX_RECORD, "a cell of more than 65,536 characters; close its quotes, or shorten it"),
    ],
)
def test_a_broken_line_is_one_row(path, line, problem):
    path.write_text(f"figure,note,size\na.png,x,1\n{line}\nc.png,z,3\n")
    found = []
    for row in read_rows(path):
        found.append(row)
        if len(found) == 3:
            break
    assert [row.where for row in found[:2]] == ["line 2", "line 3"]
    assert [row.problem for row in found[:2]] == [None, problem]
    if line.count("\n") == 0:
        assert found[2].values == {"figure": "c.png", "note": "z", "size": "3"}
        assert found[2].where == "line 4"
        assert len(list(read_rows(path))) == 3


def test_lines_after_a_quote_that_does_not_close_are_rows(path):
    found = rows_of(path, 'figure,note\na.png,"x\nb.png,y\nc.png,z\n')
    assert [(row.where, row.values.get("figure")) for row in found] == [
        ("line 2", None),
        ("line 3", "b.png"),
        ("line 4", "c.png"),
    ]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("\n \n", "empty; give a table with a column 'figure'"),
        ("sep=;\n\n", "no header line; name the columns, with figure among them"),
        ("picture,lon\na,1\n", "no column figure among picture, lon; name the column with the pictures figure"),
        ("figure,Lon,lon\n", "two columns named lon; remove or rename one of them"),
        ("figure,Lon,Longitude\n", "two columns named lon; remove or rename one of them"),
        ("figure,height-m,height_m\n", "two columns named height_m; remove or rename one of them"),
        ('figure,"lon\n', "unclosed quote in the first line; close it"),
        ("figure,\0\n", "NUL character in the first line; give a text file, as CSV UTF-8"),
        (
            "figure," + "x" * 2 * MAX_RECORD,
            f"first line longer than {MAX_RECORD:,} characters; give a table whose first line names the columns",
        ),
        ("figure" + "," * MAX_COLUMNS, "1,001 columns; give at most 1,000"),
        (b"figure,name\na.png,x\nb.png,M\xfcller\n", "line 3: byte 0xfc is not UTF-8; save the table as CSV UTF-8"),
        (b"fig\xfcre,name\n", "line 1: byte 0xfc is not UTF-8; save the table as CSV UTF-8"),
        (
            "figure\na\ud800.png\n".encode("utf-16", "surrogatepass"),
            "line 2: code unit 0xd800 is not UTF-16; save the table as CSV UTF-8",
        ),
        (
            "figure\na.png\n".encode("utf-16") + b"x",
            "line 3 or one after it is not UTF-16; save the table as CSV UTF-8",
        ),
        ("figure\na.png\n".encode("utf-16-le"), "NUL character in the first line; give a text file, as CSV UTF-8"),
    ],
)
def test_files_that_are_not_tables_are_rejected_in_one_line(path, data, message):
    with pytest.raises(InputError) as refused:
        rows_of(path, data)
    assert str(refused.value) == f"{path}: {message}"


def test_rows_before_a_broken_byte_are_read(path):
    path.write_bytes(b"figure,name\n" + b"a.png,x\n" * 5_000 + b"b.png,\xe9\n" + b"c.png,y\n" * 10)
    table = read_rows(path)
    assert sum(1 for _ in zip(range(5_000), table, strict=False)) == 5_000
    with pytest.raises(InputError, match="line 5002: byte 0xe9 is not UTF-8"):
        next(table)
