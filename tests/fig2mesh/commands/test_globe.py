"""`fig2mesh globe`: the folder it writes, and what it refuses, in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from exporters.gltf.glb import write_glb
from exporters.tiles.tileset import write_tileset
from fig2mesh.commands.main import main
from tests.exporters.analytic import ZURICH, asset, capsule


@pytest.fixture
def cesium_like(tmp_path: Path) -> Path:
    """A folder with the layout of CesiumJS."""
    folder = tmp_path / "package" / "Build" / "Cesium"
    (folder / "Widgets").mkdir(parents=True)
    (folder / "Cesium.js").write_text("1;")
    (folder / "Widgets" / "widgets.css").write_text("")
    return tmp_path / "package"


@pytest.fixture
def farmer(tmp_path: Path) -> Path:
    path = tmp_path / "farmer.glb"
    write_glb(asset(ZURICH, lods=(capsule(6, 2),)), path)
    return path


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_a_folder_holds_all_that_the_page_needs(tmp_path: Path, farmer: Path, cesium_like: Path) -> None:
    write_tileset(asset(ZURICH), tmp_path / "tiles")
    Image.new("RGB", (4, 4)).save(tmp_path / "map.png")
    out = tmp_path / "new" / "page"
    words = ["globe", str(farmer), str(tmp_path / "tiles"), "-o", str(out), "--cesium", str(cesium_like), "-q"]
    words += ["--overlay", str(tmp_path / "map.png"), "8", "47", "9", "48"]
    assert main(words) == 0
    assert names(out) == {
        "index.html",
        "assets/0/farmer.glb",
        "assets/1/tileset.json",
        "assets/1/farmer.glb",
        "assets/1/farmer_lod1.glb",
        "assets/1/farmer_lod2.glb",
        "overlays/0.png",
        "cesium/Cesium.js",
        "cesium/Widgets/widgets.css",
    }
    page = (out / "index.html").read_text(encoding="utf-8")
    assert '"url": "assets/1/tileset.json"' in page
    assert '"rectangle": [8.0, 47.0, 9.0, 48.0]' in page
    assert [path.name for path in out.parent.iterdir()] == ["page"], "nothing is left next to it"

    # Again: only with --overwrite, and only a page of fig2mesh.
    assert main(words) == 2
    (out / "assets" / "0" / "old.glb").write_text("x")
    assert main([*words, "--overwrite"]) == 0
    assert "assets/0/old.glb" not in names(out)


def test_other_folders_are_left_alone(tmp_path: Path, farmer: Path, cesium_like: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "index.html").write_text("my page")
    for out in (tmp_path / "mine", farmer):
        assert main(["globe", str(farmer), "-o", str(out), "--cesium", str(cesium_like), "--overwrite"]) == 2
    assert (tmp_path / "mine" / "index.html").read_text() == "my page"
    assert farmer.stat().st_size > 100


@pytest.mark.parametrize(
    ("more", "finding"),
    [
        (["--cesium", "nowhere"], "--cesium: no CesiumJS in nowhere"),
        (["gone.glb"], "gone.glb: no such file"),
        (["--overlay", "map.png", "8", "47", "9", "48"], "--overlay: no such file map.png"),
        (["--overlay", "map.png", "8", "47"], "--overlay"),
    ],
)
def test_bad_input_is_reported_in_one_line(
    farmer: Path, cesium_like: Path, capsys: pytest.CaptureFixture[str], more: list[str], finding: str
) -> None:
    assert main(["globe", str(farmer), "--no-open", "--cesium", str(cesium_like), *more]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert finding in err
    assert err.count("\n") == 1


def test_models_are_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["globe"]) == 2
    assert "MODEL" in capsys.readouterr().err
