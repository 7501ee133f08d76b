"""Inputs that once broke a reader, and a few hundred of today's: each is read or refused in one line, soon, cheaply."""

from __future__ import annotations

import logging
import shutil
from pathlib import Path

import pytest

from tests.fuzz.readers import READERS, Reader
from tests.fuzz.seeds import Input, taken
from tests.fuzz.worker import input_of, outcome

CORPUS = Path(__file__).parent / "corpus"
KEPT = sorted(folder for folder in CORPUS.glob("*/*") if folder.is_dir())

SEED = 20261128

FEW = {"usd": 4, "tileset": 20, "gltf": 20}
"""Inputs of readers that take their time; of the others `MANY`."""

MANY = 40


@pytest.fixture(scope="module")
def intact() -> dict[str, list[Input]]:
    """Seeds, made once."""
    return {}


@pytest.mark.parametrize("folder", KEPT, ids=lambda folder: f"{folder.parent.name}/{folder.name}")
def test_what_once_broke_a_reader_is_rejected_or_read(folder: Path, tmp_path: Path) -> None:
    found = outcome(READERS[folder.parent.name], taken(folder).put(tmp_path))
    assert found in ("", "refused")


@pytest.mark.parametrize("name", READERS)
def test_damaged_files_are_rejected_or_read(
    name: str, intact: dict[str, list[Input]], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL)
    seeds = intact.setdefault(name, list(READERS[name].seeds()))
    for each in seeds:
        assert outcome(READERS[name], _fresh(tmp_path, each)) == "", f"an intact {each.main} is not accepted"
    for number in range(FEW.get(name, MANY)):
        found = outcome(READERS[name], _fresh(tmp_path, input_of(name, SEED, number, seeds)))
        assert found in ("", "refused"), f"input {number} of seed {SEED}"


def _fresh(folder: Path, case: Input) -> Path:
    room = folder / "input"
    shutil.rmtree(room, ignore_errors=True)
    room.mkdir()
    return case.put(room)


def test_the_corpus_is_small() -> None:
    assert sum(path.stat().st_size for path in CORPUS.rglob("*") if path.is_file()) < 300_000


@pytest.mark.parametrize(
    ("read", "expected"),
    [
        (lambda path: path.read_bytes()[99], "IndexError"),
        (lambda path: int(path.read_bytes()), "ValueError"),
        (lambda path: None, ""),
    ],
)
def test_the_harness_distinguishes_errors_from_refusals(read: object, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "main.txt"
    path.write_bytes(b"x")
    assert outcome(Reader(lambda: iter(()), read), path).partition(":")[0] == expected  # type: ignore[arg-type]
