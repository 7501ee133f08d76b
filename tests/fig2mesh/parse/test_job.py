"""`fig2mesh parse`: three files that the main job reads back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.commands.main import main
from fig2mesh.parse.read import read_figure
from fig2mesh.skeleton import JOINT_NAMES, PART_NAMES
from tests.drawn import draw_figure, write_figure

FARMER = Path(__file__).parents[3] / "examples" / "figures" / "farmer" / "image.png"


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The farmer on white paper, in the corner of a larger sheet."""
    image = Image.open(FARMER).convert("RGBA")
    sheet = Image.new("RGBA", (image.width + 150, image.height + 60), "white")
    sheet.alpha_composite(image, (120, 40))
    path = tmp_path_factory.mktemp("bare") / "sheet.png"
    sheet.convert("RGB").save(path)
    return path


@pytest.fixture(scope="module")
def written(bare: Path) -> Path:
    out = bare.parent / "out"
    assert main(["parse", str(bare), "-o", str(out), "-q"]) == 0
    return out


def test_what_is_written_reads_back(bare: Path, written: Path) -> None:
    figure = read_figure(
        bare,
        mask=written / "mask.png",
        keypoints=written / "keypoints.json",
        part_labels=written / "part_labels.png",
    )
    inferred = read_figure(bare)
    assert np.array_equal(figure.mask, inferred.mask)
    assert np.allclose(figure.joints_px, inferred.joints_px, atol=0.06)
    assert np.array_equal(figure.visible, inferred.visible)
    assert (figure.part_labels[figure.mask] > 0).all()


def test_confidences_stand_beside_the_joints(written: Path) -> None:
    content = json.loads((written / "keypoints.json").read_text())
    assert list(content["confidence"]) == list(JOINT_NAMES)
    assert all(0 <= value <= 1 for value in content["confidence"].values())


def test_the_legend_names_the_labels(written: Path) -> None:
    image = Image.open(written / "part_labels.png")
    assert image.mode == "P"
    assert json.loads(image.text["legend"])["2"] == PART_NAMES[2]


@pytest.mark.parametrize("kind", ["coco", "labelme", "supervisely"])
def test_joints_in_the_files_of_annotation_tools(bare: Path, written: Path, tmp_path: Path, kind: str) -> None:
    known = ["--mask", str(written / "mask.png"), "--keypoints", str(written / "keypoints.json")]
    assert main(["parse", str(bare), *known, "-o", str(tmp_path / "out"), "--format", kind, "-q"]) == 0
    ours, theirs = (
        read_figure(bare, mask=written / "mask.png", keypoints=folder / "keypoints.json")
        for folder in (written, tmp_path / "out")
    )
    assert np.allclose(ours.joints_px, theirs.joints_px, atol=0.06)
    assert np.array_equal(ours.visible, theirs.visible)


def test_a_box_is_a_window_of_the_same_picture(bare: Path, tmp_path: Path) -> None:
    width, height = Image.open(bare).size
    box = [str(v) for v in (60, 20, width, height)]
    assert main(["parse", str(bare), "-o", str(tmp_path), "-q", "--bbox", *box]) == 0
    content = json.loads((tmp_path / "keypoints.json").read_text())
    assert (content["width"], content["height"]) == (width, height)
    mask = np.asarray(Image.open(tmp_path / "mask.png"))
    assert mask.shape == (height, width)
    assert not mask[:20].any()
    x, y, _ = content["keypoints"]["thorax"]
    assert mask[int(y), int(x)] == 255


def test_given_files_are_kept(tmp_path: Path) -> None:
    files = write_figure(tmp_path)
    opaque = tmp_path / "opaque.png"
    draw_figure().convert("RGB").save(opaque)
    out = tmp_path / "out"
    arguments = ["parse", str(opaque), "--mask", str(files.mask), "--keypoints", str(files.keypoints)]
    assert main([*arguments, "-o", str(out), "-q"]) == 0
    assert np.array_equal(np.asarray(Image.open(out / "mask.png")), np.asarray(Image.open(files.mask)))
    content, given = (json.loads(path.read_text()) for path in (out / "keypoints.json", files.keypoints))
    assert "confidence" not in content
    assert content["keypoints"]["l_knee"][:2] == given["keypoints"]["l_knee"][:2]


REFUSED = {
    "there": (["parse", "white.png", "-o", "there"], "mask.png: already exists; use --overwrite"),
    "no folder": (["parse", "white.png", "-o", "white.png"], "white.png: not a directory"),
    "no figure": (["parse", "white.png", "-o", "new"], "no figure found"),
    "no picture": (["parse", "none.png", "-o", "new"], "no such file"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals_are_one_line(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Image.new("RGB", (80, 120), "white").save("white.png")
    Path("there").mkdir()
    Path("there/mask.png").write_bytes(b"")
    arguments, message = REFUSED[case]
    assert main(arguments) == 2
    output = capsys.readouterr().err
    assert message in output
    assert len(output.strip().splitlines()) == 1
    assert not Path("new").exists()
