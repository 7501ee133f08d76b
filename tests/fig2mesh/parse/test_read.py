"""Reading figures: what is accepted, and one clear line for what is not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fig2mesh.errors import FigureError
from fig2mesh.parse.read import read_figure
from fig2mesh.skeleton import JOINT, JOINT_NAMES
from tests.drawn import JOINTS, DrawnFiles, draw_figure, keypoints, write_figure


@pytest.fixture
def files(tmp_path: Path) -> DrawnFiles:
    return write_figure(tmp_path)


def test_alpha_is_the_silhouette(files: DrawnFiles) -> None:
    figure = read_figure(files.image, keypoints=files.keypoints)
    expected = np.asarray(Image.open(files.mask)) > 127
    assert np.array_equal(figure.mask, expected)
    assert figure.name == "drawn"
    assert figure.joints_px[JOINT["pelvis"]].tolist() == [2 * c for c in JOINTS["pelvis"]]


def test_mask_replaces_alpha(files: DrawnFiles, tmp_path: Path) -> None:
    opaque = tmp_path / "opaque.jpg"
    draw_figure().convert("RGB").save(opaque)
    figure = read_figure(opaque, mask=files.mask, keypoints=files.keypoints)
    assert figure.mask.sum() == (np.asarray(Image.open(files.mask)) > 127).sum()


@pytest.mark.parametrize("mode", ["1", "L", "P", "RGB", "RGBA", "LA", "CMYK", "I;16"])
def test_picture_modes(files: DrawnFiles, tmp_path: Path, mode: str) -> None:
    source = draw_figure()
    path = tmp_path / ("mode.tif" if mode == "CMYK" else "mode.png")
    if mode == "I;16":
        Image.fromarray((np.asarray(source.convert("L")).astype(np.uint16)) * 257).save(path)
    else:
        source.convert("RGB").convert(mode).save(path) if mode in "1LPCMYKRGB" else source.convert(mode).save(path)
    assert read_figure(path, mask=files.mask, keypoints=files.keypoints).rgba.shape == (600, 400, 4)


def test_bbox_cuts_picture_and_joints(files: DrawnFiles) -> None:
    whole = read_figure(files.image, keypoints=files.keypoints)
    cut = read_figure(files.image, keypoints=files.keypoints, bbox=(10, 6, 396, 590))
    assert cut.rgba.shape[:2] == (584, 386)
    assert np.allclose(cut.joints_px, whole.joints_px - [10, 6])
    assert cut.mask.sum() == whole.mask[6:590, 10:396].sum()


def broken(files: DrawnFiles, folder: Path, case: str) -> dict[str, Path | None]:
    """Arguments for `read_figure` with one fault."""
    arguments: dict[str, Path | None] = {"path": files.image, "mask": None, "keypoints": files.keypoints}
    content = keypoints()
    joints = content["keypoints"]
    assert isinstance(joints, dict)
    if case == "no figure":
        arguments["path"] = folder / "missing.png"
    elif case == "text":
        arguments["path"] = folder / "text.png"
        arguments["path"].write_text("no picture")
    elif case == "truncated":
        arguments["path"] = folder / "cut.png"
        arguments["path"].write_bytes(files.image.read_bytes()[:900])
    elif case == "folder":
        arguments["path"] = folder
    elif case == "blank":
        arguments["path"] = folder / "blank.png"
        Image.new("RGB", (400, 600), "white").save(arguments["path"])
    elif case == "mask size":
        arguments["mask"] = folder / "small.png"
        Image.open(files.mask).resize((50, 50)).save(arguments["mask"])
    elif case == "empty mask":
        arguments["mask"] = folder / "empty.png"
        Image.new("L", (400, 600)).save(arguments["mask"])
    elif case == "not json":
        files.keypoints.write_text("{")
    elif case == "nested":
        files.keypoints.write_text("[" * 100_000)
    elif case == "list":
        files.keypoints.write_text("[]")
    elif case == "other size":
        files.keypoints.write_text(json.dumps(content | {"width": 999}))
    else:
        if case == "missing joint":
            del joints["l_knee"]
        elif case == "renamed joint":
            joints["left_knee"] = joints.pop("l_knee")
        elif case == "extra joint":
            joints["tail"] = [1, 2, 1]
        elif case == "nan":
            joints["l_knee"] = [float("nan"), 3, 1]
        elif case == "huge":
            joints["l_knee"] = [10**400, 3, 1]
        elif case == "text joint":
            joints["l_knee"] = "left"
        elif case == "outside":
            joints["l_knee"] = [405, 3, 1]
        files.keypoints.write_text(json.dumps(content))
    return arguments


CASES = {
    "no figure": "no such file",
    "text": "not a picture",
    "truncated": "cannot be read",
    "folder": "is a folder; give the picture in it",
    "blank": "no figure found; pass --bbox",
    "mask size": "50×50 px, but the figure has 400×600",
    "empty mask": "silhouette is empty",
    "not json": "not JSON",
    "nested": "nested too deeply",
    "list": "keypoints",
    "other size": "999×600",
    "missing joint": "l_knee",
    "renamed joint": "left_knee",
    "extra joint": "tail",
    "nan": "NaN is not a number",
    "huge": "larger than 2^64",
    "text joint": "l_knee",
    "outside": "l_knee at (405, 3) is outside",
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_named_in_one_line(files: DrawnFiles, tmp_path: Path, case: str) -> None:
    arguments = broken(files, tmp_path, case)
    path = arguments.pop("path")
    assert path is not None
    with pytest.raises(FigureError) as caught:
        read_figure(path, **arguments)  # type: ignore[arg-type]
    message = str(caught.value)
    assert CASES[case] in message
    assert "\n" not in message
    assert len(message) < 600


def test_bad_bbox_is_named(files: DrawnFiles) -> None:
    with pytest.raises(FigureError, match="--bbox"):
        read_figure(files.image, keypoints=files.keypoints, bbox=(10, 10, 5, 20))


def test_joint_names_are_the_papers() -> None:
    assert len(JOINT_NAMES) == 21
    assert len(set(JOINT_NAMES)) == 21


def test_depth_order_comes_from_the_joints_file(files: DrawnFiles, tmp_path: Path) -> None:
    content = keypoints() | {"depth_order": {"l_arm": "behind"}}
    path = tmp_path / "ordered.json"
    path.write_text(json.dumps(content))
    assert read_figure(files.image, keypoints=path).depth_order == {"l_arm": "behind"}
    path.write_text(json.dumps(content | {"depth_order": {"l_arm": "above"}}))
    with pytest.raises(FigureError, match=r"depth_order is .* give"):
        read_figure(files.image, keypoints=path)
