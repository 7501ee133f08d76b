"""`fig2mesh batch` from end to end with worker processes of this machine."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pystac
import pytest

from exporters.tiles.tileset import VISIBLE_RANGE_PER_ERROR
from exporters.validate import validate
from fig2mesh.batch.ledger import WORK
from fig2mesh.batch.tasks import FORMATS
from fig2mesh.commands.main import main
from tests.benchmarks.batch import convert
from tests.exporters.walk import contents
from tests.fig2mesh.batch.small import QUICK, events, manifest, tree, write_csv, write_pictures

pytestmark = pytest.mark.slow

BAD = {
    "missing": {"figure": "nobody.png"},
    "outside": {"figure": "/etc/hostname"},
    "nowhere": {"lat": ""},
    "far": {"lat": 147.4},
    "odd": {"quality": "superb"},
}


@pytest.fixture(scope="module")
def collection(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four rows that convert, the last one with the picture of the first, and five that do not."""
    folder = tmp_path_factory.mktemp("collection")
    rows = [{**row, **QUICK, "artist": "=Anna", "year": 1890 + n} for n, row in enumerate(write_pictures(folder, 3))]
    rows.append({**rows[0], "lon": 8.7, "height-m": 3, "name": "once more"})
    rows[2:2] = [{**rows[0], "name": name, **change} for name, change in BAD.items()]
    return write_csv(folder / "people.csv", rows)


@pytest.fixture(scope="module")
def converted(collection: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The collection, converted by two workers."""
    out = tmp_path_factory.mktemp("out")
    assert main(["batch", str(collection), "-o", str(out), "--jobs", "2", "-q"]) == 2
    return out


def test_bad_rows_are_named_and_the_others_are_there(converted: Path) -> None:
    rows = manifest(converted)
    assert [row["row"] for row in rows] == list(range(1, 10))
    failed = {row["name"]: row["error"] for row in rows if row["status"] == "failed"}
    assert failed.keys() == BAD.keys()
    assert failed["missing"] == "column figure: nobody.png: No such file or directory; check the path"
    assert failed["nowhere"] == "column lat: is empty; give both lon and lat"
    done = [row for row in rows if row["status"] == "done"]
    assert [row["name"] for row in done] == ["person0", "person1", "person2", "once_more"]
    for row in done:
        assert row["measures"]["watertight"]
        assert (converted / row["name"] / f"{row['name']}.glb").is_file()
    assert {path.name for path in converted.iterdir() if path.is_dir()} == {row["name"] for row in done} | {WORK}


def test_what_stands_over_all_is_valid_and_agrees(converted: Path) -> None:
    assert not [f for f in validate(converted / "tileset.json") if f.severity in ("error", "warning")]
    index = json.loads((converted / "index.geojson").read_text(encoding="utf-8"))
    assert [feature["properties"]["artist"] for feature in index["features"]] == ["=Anna"] * 4
    import pyogrio

    info = pyogrio.read_info(converted / "index.gpkg", layer="figures")
    assert info["features"] == 4
    assert {"artist", "year", "name", "model"} <= set(info["fields"])
    assert pyogrio.read_info(converted / "index.gpkg", layer="failed")["features"] == 5
    items = list(pystac.Collection.from_file(str(converted / "collection.json")).get_items())
    assert {item.id for item in items} == {"person0", "person1", "person2", "once_more"}
    for item in items:
        assert Path(item.assets["glb"].get_absolute_href() or "").is_file()


def test_a_rerun_does_no_work(collection: Path, converted: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = tree(converted), (converted / "manifest.jsonl").read_bytes()
    assert main(["batch", str(collection), "-o", str(converted), "--progress", "json", "-q"]) == 2
    end = events(capsys.readouterr().out)[-1]
    assert (end["event"], end["stages"], end["counts"]) == ("end", {}, {})
    assert {k: end["progress"][k] for k in ("converted", "unchanged", "failed")} == {
        "converted": 0,
        "unchanged": 4,
        "failed": 5,
    }
    assert (tree(converted), (converted / "manifest.jsonl").read_bytes()) == before


def test_what_a_killed_run_had_not_put_in_place_goes(collection: Path, converted: Path) -> None:
    half = [
        converted / ".fig2mesh-1-abcd.tmp" / "half.json",
        converted / WORK / "stages" / "00" / ".fig2mesh-2-ab.tmp" / "half.npz",
        converted / WORK / "records" / "00" / ".fig2mesh-3-cd.tmp" / "half.json",
    ]
    for path in half:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert main(["batch", str(collection), "-o", str(converted), "-q"]) == 2
    assert not any(path.parent.exists() for path in half)


def test_one_worker_and_another_order_of_ends_give_the_same_bytes(
    collection: Path, converted: Path, tmp_path: Path
) -> None:
    assert main(["batch", str(collection), "-o", str(tmp_path), "--jobs", "1", "-q"]) == 2
    assert tree(tmp_path) == tree(converted)


def test_a_changed_collection_changes_the_summary(collection: Path, converted: Path, tmp_path: Path) -> None:
    import shutil

    shutil.copytree(converted, tmp_path / "out")
    rows = [{**row, **QUICK} for row in write_pictures(collection.parent, 3)][1:]
    less = write_csv(collection.with_name("less.csv"), rows)
    assert main(["batch", str(less), "-o", str(tmp_path / "out"), "-q", "--title", "Less"]) == 0
    assert [row["name"] for row in manifest(tmp_path / "out")] == ["person1", "person2"]
    assert len(json.loads((tmp_path / "out" / "index.geojson").read_text())["features"]) == 2
    assert (tmp_path / "out" / "person0" / "person0.glb").is_file()  # of the earlier collection: left where it is


def test_a_dry_run_reports_all_problems_and_writes_nothing(
    collection: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["batch", str(collection), "-o", str(tmp_path / "out"), "--dry-run"]) == 2
    printed = capsys.readouterr().err
    for number, name in zip(range(3, 8), BAD, strict=True):
        assert f"row {number}, {name}: " in printed
    assert "9 rows: 4 valid, 5 invalid" in printed
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["nothing.csv", "-o", "out"], "nothing.csv"),
        (["people.csv"], "-o: no output folder; give -o DIR"),
        (["people.csv", "-o", "people.csv"], "people.csv: not a directory"),
        (["people.csv", "-o", "out", "--engine", "dask"], "--engine dask: requires --address"),
        (["people.csv", "-o", "out", "--address", "tcp://127.0.0.1:1"], "--address: requires --engine dask"),
        (["people.csv", "-o", "out", "--root", "nowhere"], "--root: no such directory nowhere"),
        (["empty.csv", "-o", "out"], "empty.csv: has no rows"),
    ],
)
def test_unusable_requests_are_one_line(
    collection: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(collection.parent)
    Path("empty.csv").write_text("figure,lon,lat\n")
    assert main(["batch", *words]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert printed.count("\n") == 1


def test_files_of_others_and_a_second_batch_are_rejected(
    collection: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from filelock import FileLock

    (tmp_path / "tileset.json").write_text("mine")
    assert main(["batch", str(collection), "-o", str(tmp_path)]) == 2
    assert "already exists, and is not from an earlier batch" in capsys.readouterr().err
    assert (tmp_path / "tileset.json").read_text() == "mine"
    (tmp_path / "tileset.json").unlink()
    (tmp_path / WORK).mkdir(exist_ok=True)
    with FileLock(tmp_path / WORK / "lock"):
        assert main(["batch", str(collection), "-o", str(tmp_path)]) == 2
    assert "another batch is writing there" in capsys.readouterr().err


SHIPPED = Path(__file__).resolve().parents[3] / "examples" / "figures" / "farmer"


@pytest.fixture
def shipped(tmp_path: Path) -> Path:
    """A collection of one shipped figure, three times, of the height of a person, a tower, and on a map."""
    rows = [
        {
            "figure": SHIPPED / "image.png",
            "keypoints": SHIPPED / "keypoints.json",
            "name": name,
            "height_m": height,
            "lon": 8.5 + height / 1e5,
            "lat": 47.4,
            **QUICK,
        }
        for name, height in (("person", 1.79), ("tower", 180.0), ("map", 1800.0))
    ]
    return write_csv(tmp_path / "people.csv", rows)


def test_formats_and_date_of_the_command_line_are_made(
    shipped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["batch", str(shipped), "--root", str(SHIPPED.anchor)]
    out = tmp_path / "out"
    assert main([*words, "-o", str(out), "--format", "ply", "--format", ".usdc", "--date", "1893-05-17"]) == 0
    capsys.readouterr()
    for row in manifest(out):
        assert set(row["outputs"]) == {f"{row['name']}/{row['name']}.{suffix}" for suffix in ("glb", "ply", "usdc")}
        assert all((out / name).stat().st_size > 1000 for name in row["outputs"])
        assert not [each for each in validate(out / row["name"] / f"{row['name']}.ply") if each.severity == "error"]
    for item in pystac.Collection.from_file(str(out / "collection.json")).get_items():
        assert item.properties["start_datetime"].startswith("1893-05-17")
    for suffix in FORMATS:
        assert main([*words, "--dry-run", "--format", suffix, "--date", "1893"]) == 0
        assert "3 rows: 3 valid, 0 invalid" in capsys.readouterr().err
    refused = (
        ("--format", "doc", "unknown format 'doc'"),
        ("--date", "around 1893", "'around 1893' is not an ISO 8601 date"),
    )
    for option, value, finding in refused:
        assert main([*words, "-o", str(tmp_path / "none"), option, value]) == 2
        printed = capsys.readouterr().err
        assert f"{option}: {finding};" in printed
        assert printed.count("\n") == 1
        assert not (tmp_path / "none").exists()


def test_figures_of_any_heights_are_drawn_from_as_far_as_their_own(
    shipped: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["batch", str(shipped), "--root", str(SHIPPED.anchor), "-o", str(tmp_path / "out")]
    assert main(words) == 0
    assert "--visible-from" not in capsys.readouterr().err
    heights = {"person": 1.79, "tower": 180.0, "map": 1800.0}
    for each in contents(tmp_path / "out"):
        height = heights[Path(each.uri).stem]
        assert 103.923 * each.errors[-2] == pytest.approx(2000 / 1.79 * height, rel=1e-4)
    root = json.loads((tmp_path / "out" / "tileset.json").read_text())
    assert 104 * root["geometricError"] > 1000 * 1800
    assert not [f for f in validate(tmp_path / "out" / "tileset.json") if f.severity in ("error", "warning")]
    assert main([*words, "--visible-from", "2000"]) == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "--visible-from" in line]
    assert "a figure 1800 m tall is not drawn" in line
    assert {each.errors[-2] for each in contents(tmp_path / "out")} == {2000.0 / VISIBLE_RANGE_PER_ERROR}


def _command(collection: Path, out: Path) -> list[str]:
    return [
        sys.executable,
        "-m",
        "fig2mesh",
        "batch",
        str(collection),
        "-o",
        str(out),
        "--jobs",
        "2",
        "--progress",
        "json",
        "-q",
    ]


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="no process groups")
def test_killed_at_any_moment_a_rerun_ends_with_the_same_bytes(
    collection: Path, converted: Path, tmp_path: Path
) -> None:
    """The whole group is killed six times, each after a random number of events: stages and ends of rows."""
    chance = random.Random(7)
    for _ in range(6):
        process = subprocess.Popen(
            _command(collection, tmp_path), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True
        )
        assert process.stdout is not None
        for _ in range(chance.randint(1, 9)):
            if not process.stdout.readline():
                break
        time.sleep(chance.random() / 5)  # not only when a message is printed
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()
    assert subprocess.run(_command(collection, tmp_path), capture_output=True).returncode == 2
    assert tree(tmp_path) == tree(converted)
    assert not list(tmp_path.rglob("*.tmp"))


def test_a_worker_that_is_killed_is_replaced_and_its_row_done(
    collection: Path, converted: Path, tmp_path: Path
) -> None:
    process = subprocess.Popen(
        _command(collection, tmp_path), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    killed: set[str] = set()
    for line in process.stdout:
        event = json.loads(line)
        if event["event"] == "stage" and not killed:
            killed.add(event["worker"])
            os.kill(int(event["worker"]), signal.SIGKILL)
    assert process.wait() == 2
    assert killed
    assert tree(tmp_path) == tree(converted)


def test_a_row_that_takes_too_long_is_given_up(collection: Path, tmp_path: Path, capsys: Any) -> None:
    rows = [{**row, **QUICK, "quality": "fine"} for row in write_pictures(collection.parent, 1)]
    slow = write_csv(collection.with_name("slow.csv"), rows)
    assert main(["batch", str(slow), "-o", str(tmp_path), "--timeout", "1"]) == 1
    assert "took more than 1 s; raise --timeout" in capsys.readouterr().err
    assert manifest(tmp_path)[0]["error"] == "took more than 1 s; raise --timeout"


def test_the_parent_needs_no_more_memory_for_more_rows(tmp_path: Path) -> None:
    rows = write_pictures(tmp_path, 1)
    peaks = {}
    for count in (100, 2000):
        table = write_csv(tmp_path / f"{count}.csv", [{**rows[0], "year": n} for n in range(count)])
        found = convert(table, tmp_path / "out", 2, "--dry-run")
        assert found["rows"] == count
        peaks[count] = found["parent_mb"]
    assert peaks[2000] < 1.1 * peaks[100]
