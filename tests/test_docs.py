"""The pages name files, modules and links that exist, and their Python examples run."""

from __future__ import annotations

import importlib
import re
import shutil
from pathlib import Path
from typing import Any

import click
import pytest

from fig2mesh.commands.main import cli

ROOT = Path(__file__).parents[1]
PACKAGES = ("fig2mesh", "exporters", "georef")
PAGES = sorted(
    path for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")) if path.name not in ("CHANGELOG.md",)
)
IDS = [path.relative_to(ROOT).as_posix() for path in PAGES]

QUOTED = re.compile(r"`([^`\s]+)`")
PATH = re.compile(rf"(?:{'|'.join(PACKAGES)}|tests|examples)/[\w./-]*|[\w-]+(?:/[\w-]+)*/[\w-]+\.py")
NAME = re.compile(rf"(?:{'|'.join(PACKAGES)})(?:\.\w+)+")
PLACEHOLDER = re.compile(r"\bNAME\b")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
COMMAND = re.compile(r"^(?: {4}|)(fig2mesh (?:.*\\\n)*.*)|`(fig2mesh [^`]+)`", re.MULTILINE)
OPTION = re.compile(r"(?<=\s)--?[a-z][a-z-]*")


def exists(path: str) -> bool:
    """Whether a path of a page is in the repository; modules may be named from their package on."""
    return any((ROOT / start / path).exists() for start in ("", *PACKAGES))


def resolves(name: str) -> bool:
    """Whether a dotted name is a module, or an attribute of one."""
    module, _, attribute = name.rpartition(".")
    try:
        importlib.import_module(name)
    except ImportError:
        try:
            return hasattr(importlib.import_module(module), attribute)
        except ImportError:
            return False
    return True


def unknown_options(line: str) -> list[str]:
    """Options in a command line that its command does not have."""
    words = line.partition(" #")[0].split()[1:]
    command: click.Command = cli
    while isinstance(command, click.Group) and words and words[0] in command.commands:
        command = command.commands[words.pop(0)]
    if command is cli:
        command = cli.commands["make"]
    known = {name for option in command.params for name in (*option.opts, *option.secondary_opts)}
    return [name for name in OPTION.findall(" " + " ".join(words)) if name not in {*known, "-h", "--help"}]


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_commands_have_the_options_given(page: Path) -> None:
    lines = [block or inline for block, inline in COMMAND.findall(page.read_text(encoding="utf-8"))]
    assert {line: unknown for line in lines if (unknown := unknown_options(line))} == {}


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_paths_modules_and_links_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    quoted = {word.split("::")[0] for word in QUOTED.findall(text) if not PLACEHOLDER.search(word)}
    missing = [word for word in quoted if PATH.fullmatch(word) and not exists(word)]
    missing += [word for word in quoted if NAME.fullmatch(word) and not exists(word) and not resolves(word)]
    links = {link.split("#")[0] for link in LINK.findall(text) if "://" not in link}
    missing += [link for link in links if not (page.parent / link).exists()]
    assert not missing


def test_the_check_finds_what_is_missing() -> None:
    assert exists("fig2mesh/stages/table.py")
    assert exists("stages/table.py")
    assert not exists("fig2mesh/stages/nothing.py")
    assert resolves("exporters.asset.Asset")
    assert not resolves("exporters.asset.Nothing")
    assert not resolves("exporters.nothing")
    assert PATH.fullmatch("training/drawing/worn.py")
    assert unknown_options("fig2mesh a.png --lonlat 8 47 -o b.glb --nothing") == ["--nothing"]
    assert unknown_options("fig2mesh data build --pack p --bodies 3 --size-from map") == ["--size-from"]
    assert NAME.fullmatch("georef.untrusted.json_file.MAX_DEPTH")


@pytest.mark.slow
@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_python_examples_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of a page run one after the other, in a folder with the examples."""
    shutil.copytree(ROOT / "examples" / "figures", tmp_path / "examples" / "figures")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert blocks
    names: dict[str, Any] = {"__name__": "__page__"}
    for number, block in enumerate(blocks, 1):
        exec(compile(block, f"{page}, block {number}", "exec"), names)
    assert list(tmp_path.rglob("*.glb"))
