"""`fig2mesh data`: errors are one line with exit code 2; help imports nothing heavy."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from click.testing import CliRunner

from fig2mesh.commands.main import cli, main
from fig2mesh.training.bodies.pack import load_pack

REFUSED = {
    "pack, no assets": (
        ["data", "pack", "--assets", "nowhere", "-o", "new.npz"],
        "--assets: no such directory nowhere",
    ),
    "pack, there already": (["data", "pack", "-o", "there"], "there: already exists"),
    "pack, few poses": (["data", "pack", "--poses", "3", "-o", "new.npz"], "--poses"),
    "build, no pack": (["data", "build", "--pack", "none.npz", "-o", "data"], "none.npz: no such file"),
    "build, other file": (["data", "build", "--pack", "there", "-o", "data"], "there: not a pack"),
    "build, no output": (["data", "build", "--pack", "there"], "--output"),
    "show, no data": (["data", "show", "none", "-o", "sheet.png"], "none"),
    "show, other file": (["data", "show", "there", "-o", "sheet.png"], "there"),
    "evaluate networks, there already": (
        ["evaluate", "networks", "--pack", "p", "--data", "d", "-o", "there"],
        "there: already exists",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_are_one_line(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there").write_text("something else")
    arguments, message = REFUSED[case]
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("fig2mesh: ")
    assert printed.err.count("\n") == 1
    assert message in printed.err
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
    assert Path("there").read_text() == "something else"


@pytest.mark.parametrize("command", [[], ["pack"], ["build"], ["show"]])
def test_help(command: list[str]) -> None:
    result = CliRunner().invoke(cli, ["data", *command, "--help"])
    assert result.exit_code == 0
    assert "Usage:" in result.output


def test_help_imports_nothing_heavy() -> None:
    program = (
        "import sys\nfrom fig2mesh.commands.main import main\ncode = main(['data', 'build', '--help'])\n"
        "print(code, [n for n in ('numpy', 'torch', 'open3d', 'anny') if n in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == "0 []"


@pytest.mark.slow
@pytest.mark.skipif(find_spec("anny") is None, reason="anny is not installed")
def test_a_pack_without_assets(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "pack.npz"
    assert main(["data", "pack", "--poses", "40", "-o", str(out)]) == 0
    assert "0 characters" in capsys.readouterr().err
    pack = load_pack(out)
    assert all(garment.name.startswith("made-") for garment in pack.garments)
    assert len(pack.training_poses.clip) == 40
    # Without clips both are made; stances of one name differ by their angles.
    training, held_out = ({row.tobytes() for row in p.rotations} for p in (pack.training_poses, pack.held_out_poses))
    assert not training & held_out
