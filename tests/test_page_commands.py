"""The commands of the pages, run one after the other in one folder, as a reader does who follows them."""

from __future__ import annotations

import re
import shlex
import shutil
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from exporters.validate import validate
from fig2mesh.commands.main import cli, main
from tests.browser import Look, pixels, serving
from tests.test_docs import ROOT

PAGES = ("README.md", "docs/command_line.md", "docs/batch.md", "docs/pictures.md")
TUTORIAL = "docs/from_scan_to_globe.md"
"""Its commands are those of README.md, with explanations."""
BLOCK = re.compile(r"^ {4,}fig2mesh ((?:.*\\\n)*.*)", re.MULTILINE)
STANDS_FOR_ANOTHER = re.compile(r"[A-Z]{2,}(?![\w:]*\d)|…|\b(?:people|sheet|visitor|plan)\.\w+|models/|farmer\.json")
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


SHOWN = """(async () => {
  const shown = %s;
  for (const each of fig2mesh.figures) if (each.drawn) each.drawn.show = shown;
  for (let i = 0; i < (shown ? 8 : 3); i++) {
    await new Promise((done) => { fig2mesh.viewer.scene.requestRender(); requestAnimationFrame(done); });
  }
  return fig2mesh.figures.map((each) => each.name);
})()"""
WITHOUT_PANEL = "document.getElementById('panel').style.display = 'none'"
FLY = """(async () => {
  for (const each of fig2mesh.figures) if (each.drawn) each.drawn.show = true;
  await fig2mesh.look(fig2mesh.figures[%d], 0);
})()"""


def drawn_shares(folder: Path, look: Look, count: int) -> list[float]:
    """Share of the screen that changes where the figures are hidden: in the first view, and looking at each of them."""
    views: list[dict[str, Any]] = [{"evaluate": WITHOUT_PANEL}]
    for number in range(-1, count):
        fly = [{"evaluate": FLY % number}] if number >= 0 else []
        views += [*fly, {"evaluate": SHOWN % "true"}, {"screenshot": True}, {"evaluate": SHOWN % "false"}]
        views += [{"screenshot": True}]
    handler = partial(SimpleHTTPRequestHandler, directory=str(folder))
    with serving(ThreadingHTTPServer(("127.0.0.1", 0), handler)) as address:
        found = look(address, *views, size=(300, 300))
    pictures = [pixels(each["png"]).astype(int) for each in found["results"] if "png" in each]
    pairs = zip(pictures[::2], pictures[1::2], strict=True)
    return [float((abs(shown - hidden).max(axis=2) > 40).mean()) for shown, hidden in pairs]


def test_the_tutorial_has_the_commands_of_the_readme() -> None:
    assert [words for words in runnable(TUTORIAL) if words not in runnable("README.md")] == []
    assert len(runnable(TUTORIAL)) == 3


@pytest.mark.slow
def test_commands_of_the_pages_work_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cesium: Path, look: Look
) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    codes: dict[str, int] = {}
    globes: list[Path] = []
    for page in PAGES:
        for words in runnable(page):
            if words[0] not in INTERACTIVE:
                command = completed(words, cesium, len(codes))
                codes[f"{page}: {shlex.join(words)}"] = main(command)
                globes += [tmp_path / command[-1]] if words[0] == "globe" else []
    assert {command: code for command, code in codes.items() if code} == {}
    made = [*tmp_path.glob("*.glb"), *tmp_path.glob("*.usdz"), *tmp_path.rglob("tileset.json")]
    assert len(made) > 6
    assert [path for path in made if any(found.severity == "error" for found in validate(path))] == []

    # What is listed has to be on the screen: in the first view something, of each figure its share.
    town, two_farmers = globes
    assert min(drawn_shares(town, look, 3)) > 0.01
    assert min(drawn_shares(two_farmers, look, 2)) > 0.01
