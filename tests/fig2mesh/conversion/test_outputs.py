"""Pictures as outputs, outputs that are inputs, and the summary of a conversion."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from fig2mesh.commands.main import main
from fig2mesh.conversion.summary import length, opening, place_of
from georef.placement import GeoPlacement
from tests.drawn import DrawnFiles, write_figure

QUICK = ("--quality", "draft", "--parts", "outline", "--textures", "none")


@pytest.fixture
def files(tmp_path: Path) -> DrawnFiles:
    return write_figure(tmp_path)


def test_a_picture_may_be_an_output(
    files: DrawnFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = [str(files.image), "--keypoints", str(files.keypoints), *QUICK, "--lonlat", "-67.7", "-49.3"]
    assert main([*words, "-o", "a.glb", "-o", "shown/a.JPG", "-o", "a_preview.png"]) == 0
    printed = capfd.readouterr()
    assert printed.out.split() == ["a.glb", "shown/a.JPG", "a_preview.png"]
    assert "1.79 m tall" in printed.err
    assert "at 49.300000° S 67.700000° W, facing S (180°)" in printed.err
    assert "open a.glb in Blender or any other glTF viewer; on a globe: fig2mesh globe a.glb" in printed.err
    with Image.open("shown/a.JPG") as jpeg, Image.open("a_preview.png") as png:
        assert (jpeg.format, png.format) == ("JPEG", "PNG")
        assert jpeg.size == png.size
        assert png.width > 2 * png.height


REFUSED = {
    "the figure itself": ("-o", "{image}"),
    "by another path": ("-o", "./sub/../{image}"),
    "the joints as report": ("--report", "{keypoints}"),
    "a picture twice": ("-o", "a.png", "-o", "./a.png"),
    "a part of another output": ("-o", "a.obj", "-o", "a_texture.png"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_inputs_and_other_outputs_are_never_replaced(
    files: DrawnFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    names = {"image": files.image.name, "keypoints": files.keypoints.name}
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    options = [word.format(**names) for word in REFUSED[case]]
    words = [files.image.name, "--keypoints", files.keypoints.name, *QUICK, "--overwrite", *options]
    assert main(words) == 2
    message = capfd.readouterr().err
    assert "is also an input" in message or "given twice" in message
    assert message.count("\n") == 1
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_lengths_have_few_digits() -> None:
    assert [length(metres) for metres in (6200.0, 1.79, 0.012, 0.0012)] == ["6.2 km", "1.79 m", "1.2 cm", "1.2 mm"]


def test_places_are_spelt_out() -> None:
    assert place_of(GeoPlacement(8.5417, 47.3769, heading_deg=350.0)) == (
        "at 47.376900° N 8.541700° E, facing N (350°)"
    )


def test_what_opens_the_outputs() -> None:
    assert opening(("a.png",), placed=True) is None
    assert opening(("tiles",), placed=True) == "open tiles in CesiumJS; on a globe: fig2mesh globe tiles"
    assert opening(("a.usdz", "a.glb", "b.gltf"), placed=False) == (
        "open a.usdz in Quick Look, Omniverse or Blender, a.glb and b.gltf in Blender or any other glTF viewer"
    )
