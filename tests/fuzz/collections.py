"""Collections and what batches keep: seeds and readers."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any

from georef.errors import InputError
from tests.fuzz.seeds import STEM, Input, alone

# fmt: off
TABLE: list[dict[str, Any]] = [
    {"figure": f"{STEM}.csv", "name": "Anna", "lon": 8.5, "lat": 47.25, "triangles": 4000, "artist": "=1+1"},
    {"figure": "b.png", "name": "Böb, \"the\" second\nline", "lon": -8.0, "lat": 1e-9, "altitude": 400.0},
    {"figure": "../c.png", "lon": 8.0, "lat": 47.0, "bbox": "1 2 30 40", "evidence": "none", "date": "1893"},
]
# fmt: on


def collections() -> Iterator[Input]:
    """The same table as every kind of collection."""
    from tests.fig2mesh.batch.collections.tables import WRITERS

    with tempfile.TemporaryDirectory() as name:
        for file, write in WRITERS.items():
            # Damage takes a .json file for one document.
            suffix = ".geojsonl" if file == "g.json" else Path(file).suffix
            path = Path(name) / f"{STEM}{suffix}"
            write(path, TABLE)
            yield alone(path.suffix, path.read_bytes())
            path.unlink()


def read_collection(path: Path) -> None:
    """Rows, their names, and what they ask for."""
    from fig2mesh.batch.collections.read import read_rows
    from fig2mesh.batch.resolved_row import ResolvedRow
    from fig2mesh.batch.row_files import Roots
    from fig2mesh.batch.task import Batch
    from fig2mesh.batch.tasks import tasks_of
    from tests.fuzz.readers import assert_one_line

    batch = Batch(Roots(path.parent, path.parent.resolve()), path.parent / "out")
    for task in islice(tasks_of(read_rows(path)), 1000):
        assert Path(task.name).parts == (task.name,)
        if task.problem is not None:
            assert_one_line(str(task.problem))
        try:
            row = ResolvedRow(batch, task)
        except InputError as error:
            assert_one_line(batch.roots.shorten(str(error)))
        else:
            assert row.request.figure.resolve().is_relative_to(batch.roots.root)


def records() -> Iterator[Input]:
    """Record of a figure in a batch."""
    from fig2mesh.batch.ledger import Ledger

    with tempfile.TemporaryDirectory() as name:
        ledger = Ledger(Path(name))
        ledger.write(STEM, {"status": "done", "key": "0" * 64, "claimed": True, "files": ["a/a.glb"], "seconds": 1.5})
        yield alone(".json", ledger.path(STEM).read_bytes())


def read_record(path: Path) -> None:
    """A record is read, or counts as one of a figure that was begun; nothing is raised."""
    from fig2mesh.batch.ledger import DAMAGED, Ledger

    ledger = Ledger(path.parent / "batch")
    target = ledger.path(STEM)
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(path, target)
    found = ledger.read(STEM)
    assert found == DAMAGED or (found is not None and found["status"] == "done")
    with suppress(OSError):
        target.unlink()
