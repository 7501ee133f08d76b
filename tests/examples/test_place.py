"""The example script and the commands of the README work."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from examples.place_figure import run
from exporters.inspect import inspect
from exporters.validate import validate
from fig2mesh.commands.main import main

ROOT = Path(__file__).parents[2]


def readme_commands() -> list[list[str]]:
    """Arguments of every fig2mesh command in the README's code blocks."""
    text = (ROOT / "README.md").read_text(encoding="utf-8").replace("\\\n", " ")
    found = re.findall(r"^ {4}fig2mesh (.+)$", text, flags=re.MULTILINE)
    return [shlex.split(words) for words in found]


@pytest.mark.parametrize("name", ["farmer", "footballer", "market_woman"])
@pytest.mark.slow
def test_shipped_figures_become_valid_models(tmp_path: Path, name: str) -> None:
    *outputs, picture = run(tmp_path, name, quality="draft")
    for output in outputs:
        assert [f for f in validate(output) if f.severity in ("error", "warning")] == []
        facts = inspect(output)
        assert facts["watertight"]
        assert facts["components"] == 1
    with Image.open(picture) as image:
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
    assert len(np.unique(pixels // 32, axis=0)) > 20, "a picture of a coloured figure"


@pytest.mark.slow
def test_readme_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    commands = readme_commands()
    assert "batch" in {words[0] for words in commands}
    assert len(commands) >= 3
    for words in commands:
        draft = [] if words[0] in ("inspect", "validate", "doctor", "globe") else ["--quality", "draft", "-q"]
        # Small pictures; and a page that is written, not served until it is stopped.
        draft += {"render": ["--size", "60", "80"], "view": ["-o", "page.html"]}.get(words[0], [])
        if words[0] == "annotate":
            # The page is made; answering it until Ctrl-C is left out.
            monkeypatch.setattr("fig2mesh.annotate.job.show", lambda server, open_: server.server_close())
            draft = ["-q"]
        if words[0] == "globe":
            draft += ["-q", "-o", "globe", "--cesium", str(request.getfixturevalue("cesium"))]
        assert main([*words, *draft]) == 0, words
