"""`--verbose` twice, in whatever form, shows tracebacks; once it does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from fig2mesh.commands.main import main, verbosity


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr("fig2mesh.conversion.outputs.check_request", fail)


@pytest.mark.parametrize("words", [["-vv"], ["-v", "-v"], ["--verbose", "--verbose"], ["-v", "--verbose"], ["-qvv"]])
def test_twice_shows_the_traceback(broken: None, tmp_path: Path, words: list[str]) -> None:
    with pytest.raises(ZeroDivisionError, match="planted"):
        main([str(tmp_path / "a.png"), *words])


@pytest.mark.parametrize("words", [[], ["-v"], ["--verbose"], ["-q"]])
def test_once_is_one_line(broken: None, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    assert main([str(tmp_path / "a.png"), *words]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_only_whole_options_count() -> None:
    assert verbosity(["a.png", "-o", "-vvv.glb", "--visible-from", "--verbos"]) == 0
