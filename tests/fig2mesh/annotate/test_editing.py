"""Annotation: messages between page and server, saved files, and access to the server."""

from __future__ import annotations

import json
import struct
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from fig2mesh.annotate.editing import STANDING, AnnotatedPicture, begin, packed, standing, unpacked
from fig2mesh.annotate.job import main_command
from fig2mesh.annotate.server import HEADER, annotation_server
from fig2mesh.errors import FigureError, InputError
from fig2mesh.parse.annotation import Annotation, on_whole_picture, write_annotation
from fig2mesh.parse.read import read_figure
from fig2mesh.skeleton import JOINT, JOINT_NAMES, LABEL_COLOURS, PART_NAMES
from tests.browser import serving
from tests.drawn import DrawnFiles, write_figure


@pytest.fixture
def files(tmp_path: Path) -> DrawnFiles:
    return write_figure(tmp_path)


def some(seed: int, height: int = 12, width: int = 9) -> tuple[AnnotatedPicture, Annotation]:
    random = np.random.default_rng(seed)
    mask = random.random((height, width)) < 0.6
    labels = np.where(mask, random.integers(0, len(PART_NAMES), mask.shape), 0).astype(np.uint8)
    joints = (random.random((21, 2)) * [width, height]).astype(np.float32)
    subject = AnnotatedPicture("some", "some.png", np.zeros((height, width, 4), np.uint8), (0, 0), (width, height))
    return subject, Annotation(mask, joints, random.random(21) < 0.5, labels, {"l_leg": "behind"})


def same(a: Annotation, b: Annotation) -> bool:
    fields = ("mask", "joints_px", "visible", "part_labels")
    arrays = all(np.array_equal(getattr(a, name), getattr(b, name)) for name in fields)
    return arrays and dict(a.depth_order) == dict(b.depth_order)


@given(st.integers(0, 2**32 - 1))
def test_what_is_sent_comes_back(seed: int) -> None:
    subject, annotation = some(seed)
    assert same(unpacked(packed(subject, annotation), subject), annotation)


@given(st.integers(0, 2**32 - 1), st.integers(0, 4000), st.integers(1, 255), st.booleans())
@settings(max_examples=300)
def test_damaged_messages_are_rejected_or_harmless(seed: int, place: int, flip: int, cut: bool) -> None:
    subject, annotation = some(seed)
    message = bytearray(packed(subject, annotation))
    place %= len(message)
    message[place] ^= flip
    try:
        found = unpacked(bytes(message[:place] if cut else message), subject)
    except InputError:
        return
    found.figure("", subject.rgba)  # checks itself
    assert (found.joints_px <= [9, 12]).all()


def test_saved_files_read_back_as_they_were(files: DrawnFiles, tmp_path: Path) -> None:
    _, start = begin(files.image, files.mask, files.keypoints, None, None)
    labels = np.where(start.mask, np.uint8(17), np.uint8(0))
    annotation = Annotation(start.mask, start.joints_px + np.float32(0.25), ~start.visible, labels, {"r_arm": "front"})
    folder = tmp_path / "deep" / "saved"
    write_annotation(folder, annotation, "drawn.png")
    figure = read_figure(
        files.image,
        mask=folder / "mask.png",
        keypoints=folder / "keypoints.json",
        part_labels=folder / "part_labels.png",
    )
    again = Annotation(figure.mask, figure.joints_px, figure.visible, figure.part_labels, figure.depth_order)
    assert same(again, annotation)
    with Image.open(folder / "part_labels.png") as image:
        assert json.loads(image.info["legend"])["17"] == "prop"
        x, y = figure.joints_px[JOINT["thorax"]].astype(int).tolist()
        assert image.convert("RGB").getpixel((x, y)) == LABEL_COLOURS[17]
    with pytest.raises(InputError, match="already exists"):
        write_annotation(folder, start, "drawn.png")
    assert read_figure(files.image, keypoints=folder / "keypoints.json").depth_order == {"r_arm": "front"}


def test_a_window_is_edited_in_its_own_pixels_and_saved_in_the_picture_s(files: DrawnFiles) -> None:
    box = (10, 6, 396, 590)
    whole, all_of_it = begin(files.image, files.mask, files.keypoints, None, None)
    subject, part = begin(files.image, files.mask, files.keypoints, None, box)
    assert subject.rgba.shape[:2] == (584, 386)
    assert subject.size == whole.size == (400, 600)
    restored = on_whole_picture(part, subject.corner, subject.size)
    np.testing.assert_allclose(restored.joints_px, all_of_it.joints_px)
    assert np.array_equal(restored.mask[6:590, 10:396], all_of_it.mask[6:590, 10:396])
    assert restored.mask.sum() == part.mask.sum()


def test_without_joints_a_person_stands_in_the_silhouette() -> None:
    assert {name.split("_")[-1] for name in JOINT_NAMES} == set(STANDING)
    mask = np.zeros((400, 300), bool)
    mask[50:350, 100:200] = True
    joints = standing(mask)
    assert (joints[:, 1] >= 50).all()
    assert (joints[:, 1] <= 350).all()
    assert joints[JOINT["l_hand"], 0] > 150 > joints[JOINT["r_hand"], 0]
    np.testing.assert_allclose(joints[JOINT["l_knee"]] + joints[JOINT["r_knee"]], [300, 2 * joints[JOINT["l_knee"], 1]])
    assert np.isfinite(standing(np.zeros((3, 4), bool))).all()


def test_a_bare_picture_can_be_begun_with(tmp_path: Path) -> None:
    path = tmp_path / "bare.jpg"
    Image.new("RGB", (60, 80), "white").save(path)
    subject, start = begin(path, None, None, None, None)
    assert not start.mask.any()
    assert unpacked(packed(subject, start), subject).joints_px.shape == (21, 2)
    with pytest.raises(FigureError, match="is not inside"):
        begin(path, None, None, None, (0, 0, 61, 80))


def test_the_command_that_is_shown_names_the_files() -> None:
    assert main_command(Path("a b.png"), Path("out"), (1, 2, 3, 4)).split(" --")[0] == "fig2mesh 'a b.png'"
    assert "--bbox 1 2 3 4" in main_command(Path("a.png"), Path("out"), (1, 2, 3, 4))
    # It says where the place goes, and can be given again.
    assert main_command(Path("a.png"), Path("out"), None).endswith(" --lonlat LON LAT --overwrite")


@pytest.fixture
def address() -> Iterator[str]:
    subject, annotation = some(1)

    def save(found: Annotation) -> str:
        raise FigureError("the disk", "is full", "make room")

    with serving(annotation_server("<p>page", subject, annotation, save, lambda found: "<p>solid")) as url:
        yield url


def ask(url: str, body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    names = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        with urllib.request.urlopen(urllib.request.Request(url, body, names)) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def test_the_server_answers_its_own_page_alone(address: str) -> None:
    message = packed(*some(1))
    own = {HEADER: "1"}
    assert ask(address) == (200, b"<p>page")
    assert ask(address + "annotation") == (200, message)
    assert ask(address, Host="elsewhere.example")[0] == 403
    assert ask(address + "preview", message)[0] == 403
    assert ask(address + "preview", message, **own)[0] == 200
    assert ask(address + "preview") == (200, b"<p>solid")
    status, text = ask(address + "save", message, **own)
    assert (status, json.loads(text)["message"]) == (422, "the disk: is full; make room")
    assert ask(address + "save", struct.pack("<I", 2) + b"{}", **own)[0] == 422
    # Refused by its length, before anything of it is read.
    assert ask(address + "save", b"", Content_Length=str(3 << 20), **own)[0] == 413
    assert ask(address + "etc/passwd")[0] == 404
