"""Files of one figure that do not fit together are refused with a guess, or become doubts."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from fig2mesh.errors import FigureError
from fig2mesh.parse.read import Given, read_given, read_parsed
from fig2mesh.skeleton import JOINT_NAMES, PART
from tests.drawn import JOINTS, DrawnFiles, write_figure

WIDE, HIGH = 640, 720
LEFT, TOP = 200, 80
"""Size of a picture, and the corner at which the figure of 400 × 600 px stands in it."""


@pytest.fixture
def files(tmp_path: Path) -> DrawnFiles:
    """A figure that leans, off the middle of its picture, so that no change of it is another picture of it."""
    drawn = write_figure(tmp_path)
    figure = Image.open(drawn.image)
    ImageDraw.Draw(figure).rectangle((4, 250, 30, 330), fill=(40, 160, 60, 255))  # a thing in its right hand
    picture = Image.new("RGB", (WIDE, HIGH), "white")
    picture.paste(figure, (LEFT, TOP), figure)
    picture.save(drawn.image)
    mask = Image.new("L", (WIDE, HIGH))
    mask.paste(figure.getchannel("A"), (LEFT, TOP))
    mask.save(drawn.mask)
    drawn.keypoints.write_text(json.dumps(keypoints(lambda points: points)))
    return drawn


def keypoints(change: Callable[[NDArray[Any]], Any], **other: Any) -> dict[str, Any]:
    places = np.array([JOINTS[name] for name in JOINT_NAMES], float) * 2 + [LEFT, TOP]
    points = {name: [*map(float, xy), 1] for name, xy in zip(JOINT_NAMES, change(places), strict=True)}
    return {"keypoints": points, **other}


def given(files: DrawnFiles, **other: Any) -> Given:
    return read_given(files.image, **{"mask": files.mask, "keypoints": files.keypoints, **other})


def test_what_fits_has_no_doubts(files: DrawnFiles) -> None:
    assert given(files).doubts == ()


JOINT_FAULTS: dict[str, tuple[Callable[[NDArray[Any]], Any], str]] = {
    "normalised": (lambda p: p / [WIDE, HIGH], "from 0 to 1"),
    "normalised from -1": (lambda p: p / [WIDE, HIGH] * 2 - 1, "from 0 to 1"),
    "per cent": (lambda p: p / [WIDE, HIGH] * 100, "in per cent"),
    "half": (lambda p: p / 2, "320×360 px. scale them by 2"),
    "a quarter": (lambda p: p / 4, "160×180 px. scale them by 4"),
    "double": (lambda p: p * 2, "1280×1440 px. scale them by 0.5"),
    "of the cut-out": (lambda p: p - [LEFT, TOP], r"shifted. add about (18|19|20)\d to x and [6-8]\d to y"),
    "exchanged": (lambda p: p[:, ::-1], "x and y exchanged"),
    "y upwards": (lambda p: [0, HIGH] + p * [1, -1], "y upwards"),
    "negative y": (lambda p: p * [1, -1], "y upwards"),
    "mirrored": (lambda p: [WIDE, 0] + p * [-1, 1], "of the mirrored picture"),
    "one point": (lambda p: p * 0 + 300, "within 0 px of one point"),
    "elsewhere": (lambda p: p * [0.2, 1] + [10, 0], "joints lie in the silhouette"),
}


@pytest.mark.parametrize("fault", JOINT_FAULTS)
def test_joints_that_are_not_of_the_silhouette(files: DrawnFiles, fault: str) -> None:
    change, guess = JOINT_FAULTS[fault]
    files.keypoints.write_text(json.dumps(keypoints(change)))
    with pytest.raises(FigureError, match=guess) as caught:
        given(files)
    assert "\n" not in str(caught.value)


def test_joints_in_a_box(files: DrawnFiles) -> None:
    files.keypoints.write_text(json.dumps(keypoints(lambda points: points - [LEFT, TOP])))
    box = (LEFT - 20, TOP - 20, LEFT + 400, TOP + 600)
    with pytest.raises(FigureError, match=r"add 180 to x and 60 to y|add about \d+ to x and \d+ to y"):
        given(files, bbox=box)


@pytest.mark.parametrize(
    ("size", "guess"),
    [
        ((320, 360), "scale them by 2, with width and height"),
        ((1280, 1440), "scale them by 0.5"),
        ((HIGH, WIDE), "before the picture was turned"),
        ((300, 300), "pass the joints that belong to this picture"),
    ],
)
def test_joints_of_a_picture_of_another_size(files: DrawnFiles, size: tuple[int, int], guess: str) -> None:
    content = keypoints(lambda points: points, width=size[0], height=size[1])
    files.keypoints.write_text(json.dumps(content))
    with pytest.raises(FigureError, match=guess):
        given(files)


def test_exchanged_sides_are_a_doubt(files: DrawnFiles) -> None:
    """The figure may show its back, so they are not refused."""
    content = keypoints(lambda points: points)
    swapped = {{"l": "r", "r": "l"}[n[0]] + n[1:] if n[1] == "_" else n: xy for n, xy in content["keypoints"].items()}
    files.keypoints.write_text(json.dumps({"keypoints": swapped}))
    (doubt,) = given(files).doubts
    assert "faces the viewer" in doubt
    swapped["eyes"][2] = 0
    files.keypoints.write_text(json.dumps({"keypoints": swapped}))
    assert given(files).doubts == ()


MASK_FAULTS: dict[str, tuple[Callable[[NDArray[Any]], Any], str]] = {
    "white": (lambda m: m | True, "covers 100.0% of the picture"),
    "black": (lambda m: m & False, "the silhouette is empty"),
    "inverted": (lambda m: ~m, "inverted"),
    "mirrored": (lambda m: m[:, ::-1], "of the mirrored picture"),
    "upside down": (lambda m: m[::-1], "upside down"),
    "shifted": (
        lambda m: np.roll(m, (-80, -200), (0, 1)),
        r"move it by about (198|20[02]) px in x and (78|8[02]) px",
    ),
}


@pytest.mark.parametrize("fault", MASK_FAULTS)
def test_silhouettes_that_are_not_of_the_picture(files: DrawnFiles, fault: str) -> None:
    change, guess = MASK_FAULTS[fault]
    mask = change(np.asarray(Image.open(files.mask)) > 127)
    Image.fromarray(np.where(mask, np.uint8(255), np.uint8(0))).save(files.mask)
    with pytest.raises(FigureError, match=guess):
        given(files, keypoints=None)


def test_a_picture_that_is_almost_opaque(files: DrawnFiles, tmp_path: Path) -> None:
    picture = Image.open(files.image).convert("RGBA")
    picture.putpixel((0, 0), (0, 0, 0, 0))
    picture.save(tmp_path / "card.png")
    with pytest.raises(FigureError, match=r"covers 100\.0% of the picture"):
        read_given(tmp_path / "card.png", keypoints=files.keypoints)


def labels(files: DrawnFiles) -> NDArray[np.uint8]:
    """Upper half torso, the rest by side."""
    mask = np.asarray(Image.open(files.mask)) > 127
    out = np.where(mask, np.uint8(PART["torso"]), np.uint8(0))
    for side in "lr":
        for part, start, end in (
            ("upper_arm", "shoulder", "elbow"),
            ("lower_arm", "elbow", "wrist"),
            ("upper_leg", "hip", "knee"),
            ("lower_leg", "knee", "ankle"),
        ):
            x, y = (np.add(JOINTS[f"{side}_{start}"], JOINTS[f"{side}_{end}"]) + [LEFT, TOP]).astype(int)
            out[y - 9 : y + 9, x - 9 : x + 9] = PART[f"{side}_{part}"]
    return np.where(mask, out, 0).astype(np.uint8)


def test_part_labels_of_another_figure(files: DrawnFiles, tmp_path: Path) -> None:
    path = tmp_path / "labels.png"
    Image.fromarray(labels(files)).save(path)
    assert given(files, part_labels=path).doubts == ()
    Image.fromarray(labels(files)[:, ::-1]).save(path)
    with pytest.raises(FigureError, match="of the part labels lie in the silhouette; of the mirrored picture"):
        given(files, part_labels=path)


def test_part_labels_of_the_other_side(files: DrawnFiles, tmp_path: Path) -> None:
    found = labels(files)
    exchanged = np.where((found > 2) & (found < 15), ((found - 1) ^ 1) + 1, found).astype(np.uint8)
    Image.fromarray(exchanged).save(tmp_path / "labels.png")
    (doubt,) = given(files, part_labels=tmp_path / "labels.png").doubts
    assert "those of the other side; mirrored?" in doubt


EXAMPLES = Path("examples/figures")


@pytest.mark.parametrize("name", ["farmer", "footballer", "market_woman"])
def test_the_examples_have_no_doubts(name: str) -> None:
    folder = EXAMPLES / name
    assert read_given(folder / "image.png", keypoints=folder / "keypoints.json").doubts == ()


def test_missing_joints_are_inferred_and_the_others_kept(tmp_path: Path) -> None:
    content = json.loads((EXAMPLES / "farmer" / "keypoints.json").read_text())
    truth = {name: content["keypoints"][name] for name in ("l_hip", "r_ankle")}
    content["keypoints"] |= {"l_hip": None, "r_ankle": None}
    path = tmp_path / "joints.json"
    path.write_text(json.dumps(content))
    figure = read_parsed(EXAMPLES / "farmer" / "image.png", keypoints=path).figure
    points = dict(zip(JOINT_NAMES, figure.joints_px.tolist(), strict=True))
    for name, value in content["keypoints"].items():
        if value is not None:
            assert points[name] == pytest.approx(value[:2])
    for name, value in truth.items():
        assert np.linalg.norm(np.subtract(points[name], value[:2])) < 0.06 * 900
    assert figure.score is None
    assert any("l_hip, r_ankle inferred" in doubt for doubt in figure.doubts)


@pytest.mark.parametrize("name", ["l_wrist", "r_foot", "head"])
def test_a_single_joint_far_from_the_figure_is_a_doubt(files: DrawnFiles, name: str) -> None:
    def stray(points: NDArray[Any]) -> NDArray[Any]:
        points[JOINT_NAMES.index(name)] = [4, HIGH // 2]
        return points

    files.keypoints.write_text(json.dumps(keypoints(stray)))
    (doubt,) = given(files).doubts
    assert f"far outside the silhouette: {name} (" in doubt
