"""The commands of the pages, run one after the other in one folder, as a reader does who follows them."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import pytest

from exporters.validate import validate
from fig2mesh.commands.main import cli, main
from tests.test_docs import ROOT

PAGES = ("README.md", "docs/command_line.md", "docs/batch.md", "docs/pictures.md")
BLOCK = re.compile(r"^ {4}fig2mesh ((?:.*\\\n)*.*)", re.MULTILINE)
STANDS_FOR_ANOTHER = re.compile(
    r"[A-Z]{2,}(?![\w:]*\d)|…|\b(?:people|sheet|visitor|plan|map)\.\w+|models/|farmer\.json"
)
"""Words of a command that stand for the reader's own: capitals, and files that the repository does not have."""
DIRECTIONS = re.compile(r"--facing [A-Z]+")
INTERACTIVE = ("annotate",)
DRAFT = ("make", "batch", "render", "view")
"""Commands that take --quality: they are run at draft quality."""


def runnable(page: str) -> list[list[str]]:
    """Words of the commands of a page that need nothing but the repository, in their order."""
    lines = [line.replace("\\\n", " ") for line in BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))]
    lines = [line.partition(" #")[0] for line in lines]
    lines = [line for line in lines if not STANDS_FOR_ANOTHER.search(DIRECTIONS.sub("", line))]
    return [shlex.split(line) for line in dict.fromkeys(lines)]


def completed(words: list[str], cesium: Path, number: int) -> list[str]:
    """Words with what makes a command quick and lets it end: draft quality, a page instead of a server."""
    name = words[0] if words[0] in cli.commands else "make"
    words = [*words, "--quality", "draft"] if name in DRAFT and not words[1].endswith(".glb") else words
    if name == "view":
        return [*words, "-o", f"view_{number}.html"]
    return [*words, "--cesium", str(cesium), "-o", f"globe_{number}"] if name == "globe" else words


def test_pages_have_commands_to_run() -> None:
    assert [len(runnable(page)) > 0 for page in PAGES] == [True] * len(PAGES)
    assert len(runnable("README.md")) >= 3


@pytest.mark.slow
def test_commands_of_the_pages_work_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cesium: Path) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    codes: dict[str, int] = {}
    for page in PAGES:
        for words in runnable(page):
            if words[0] not in INTERACTIVE:
                codes[f"{page}: {shlex.join(words)}"] = main(completed(words, cesium, len(codes)))
    assert {command: code for command, code in codes.items() if code} == {}
    made = [*tmp_path.glob("*.glb"), *tmp_path.glob("*.usdz"), *tmp_path.rglob("tileset.json")]
    assert len(made) > 6
    assert [path for path in made if any(found.severity == "error" for found in validate(path))] == []
