"""Indexes and catalogue of a collection, as other programs read them."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyogrio
import pystac
import pytest

from fig2mesh.batch.ledger import WORK
from fig2mesh.batch.request import BatchRequest
from fig2mesh.batch.row_job import convert_row
from fig2mesh.batch.summary import Collection, summarise
from fig2mesh.batch.tasks import FORMATS, write_spool
from fig2mesh.errors import InputError
from tests.fig2mesh.batch.small import QUICK, batch_of, task_of, write_pictures


@pytest.fixture(scope="module")
def collection(tmp_path_factory: pytest.TempPathFactory) -> Collection:
    """One drawing in every format, of unknown date, and once more of 1893; a third row fails."""
    folder = tmp_path_factory.mktemp("collection")
    (row,) = write_pictures(folder / "people" / "farmer", 1)
    row |= {key: f"people/farmer/{row[key]}" for key in ("figure", "keypoints")}
    tasks = [
        task_of({**row, **QUICK, "format": " ".join(FORMATS)}, "farmer", 1),
        task_of({**row, **QUICK, "date": "1893.0", "figure": str(folder / str(row["figure"]))}, "again", 2),
        task_of({**row, "figure": "nobody.png"}, "nobody", 3),
    ]
    out = tmp_path_factory.mktemp("out")
    (out / WORK).mkdir()
    batch = batch_of(folder, out)
    assert [convert_row(batch, task).status for task in tasks] == ["done", "done", "failed"]
    write_spool(tasks, out / WORK / "rows.jsonl")
    return Collection(out, out / WORK / "rows.jsonl", (), "रवि & friends", None)


@pytest.fixture
def items(collection: Collection) -> list[dict[str, Any]]:
    """Properties of the items of the catalogue."""
    assert summarise(collection).figures == 2
    return [
        json.loads((collection.folder / name / f"{name}.stac.json").read_text(encoding="utf-8"))["properties"]
        for name in ("farmer", "again")
    ]


def test_every_format_is_made(collection: Collection, items: list[dict[str, Any]]) -> None:
    for suffix in FORMATS:
        assert (collection.folder / "farmer" / f"farmer.{suffix}").stat().st_size > 100


def test_dates_are_ones_that_pandas_can_hold(items: list[dict[str, Any]]) -> None:
    unknown, known = items
    for item in items:
        assert item["datetime"] is None
        # As pandas keeps them: nanoseconds since 1970 in 64 bits.
        for end in ("start_datetime", "end_datetime"):
            moment = np.datetime64(datetime.fromisoformat(item[end]).replace(tzinfo=None), "s")
            nanoseconds = int((moment - np.datetime64("1970-01-01", "s")).astype(np.int64)) * 10**9
            assert -(2**63) < nanoseconds < 2**63
    assert (unknown["start_datetime"], unknown["end_datetime"]) == ("1678-01-01T00:00:00Z", "2261-12-31T23:59:59Z")
    assert (known["start_datetime"], known["end_datetime"]) == ("1893-01-01T00:00:00Z", "1893-12-31T23:59:59Z")


def test_the_source_is_the_picture_as_the_table_names_it(collection: Collection, items: list[dict[str, Any]]) -> None:
    assert [item["source"] for item in items] == ["people/farmer/person0.png"] * 2
    table = pyogrio.raw.read(collection.folder / "index.gpkg", layer="figures", columns=["source"], read_geometry=False)
    assert table[3][0].tolist() == ["people/farmer/person0.png"] * 2


def test_the_catalogue_links_to_its_licence(collection: Collection, items: list[dict[str, Any]]) -> None:
    found = pystac.Collection.from_file(str(collection.folder / "collection.json"))
    assert (found.id, found.license) == ("रवि-friends", "other")
    (link,) = found.get_links("license")
    assert "not stated" in Path(str(link.get_absolute_href())).read_text()
    assert len(list(found.get_items())) == 2


@pytest.mark.parametrize(
    ("license", "expected", "links"),
    [("CC-BY-4.0", "CC-BY-4.0", []), ("https://example.org/terms", "other", ["https://example.org/terms"])],
)
def test_a_licence_that_is_given(collection: Collection, license: str, expected: str, links: list[str]) -> None:
    facts = {name: getattr(collection, name) for name in collection.__dataclass_fields__}
    summarise(Collection(**{**facts, "license": license}))
    document = json.loads((collection.folder / "collection.json").read_text(encoding="utf-8"))
    assert document["license"] == expected
    assert [link["href"] for link in document["links"] if link["rel"] == "license"] == links
    assert not (collection.folder / "license.txt").exists()
    with pytest.raises(InputError, match=r"--license: 'my own' is neither"):
        BatchRequest(Path("a.csv"), dry_run=True, license="my own")


def test_the_layer_of_failures_is_there_only_with_failures(collection: Collection, items: list[dict[str, Any]]) -> None:
    path = collection.folder / "index.gpkg"
    assert pyogrio.list_layers(path)[:, 0].tolist() == ["figures", "failed"]
    with closing(sqlite3.connect(path)) as database:
        assert database.execute("PRAGMA user_version").fetchone() == (10200,)
    rows = collection.spool.read_text(encoding="utf-8").splitlines(keepends=True)
    spool = collection.spool.with_name("two.jsonl")
    spool.write_text("".join(rows[:2]), encoding="utf-8")
    facts = {name: getattr(collection, name) for name in collection.__dataclass_fields__}
    assert summarise(Collection(**{**facts, "spool": spool})).failed == 0
    assert pyogrio.list_layers(path)[:, 0].tolist() == ["figures"]
