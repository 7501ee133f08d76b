"""Stills, animations and folders: read back as they were, whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from fig2mesh.errors import InputError
from fig2mesh.render.images_out import check_pictures, kind_of, write_pictures

SIZE = (16, 12)


def pictures(count: int = 3) -> list[NDArray[np.uint8]]:
    """Squares of one colour that move over a transparent ground."""
    made = []
    for index in range(count):
        picture = np.zeros((SIZE[1], SIZE[0], 4), np.uint8)
        picture[2:8, 1 + index : 6 + index] = (200, 30 * index, 40, 255)
        made.append(picture)
    return made


def frames(path: Path) -> list[NDArray[np.uint8]]:
    with Image.open(path) as image:
        count = getattr(image, "n_frames", 1)
        found = []
        for index in range(count):
            image.seek(index)
            found.append(np.asarray(image.convert("RGBA")))
        return found


def test_png_is_the_picture(tmp_path: Path) -> None:
    target = tmp_path / "a.png"
    assert write_pictures(str(target), pictures(1), 10, False) == (target,)
    assert (frames(target)[0] == pictures(1)[0]).all()


@pytest.mark.parametrize("suffix", [".webp", ".gif"])
def test_animations_hold_every_picture(tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"a{suffix}"
    write_pictures(str(target), pictures(), 12.5, False)
    found = frames(target)
    assert len(found) == 3
    # Few colours and no soft edges: even the GIF is exact where it is not transparent.
    for one, other in zip(found, pictures(), strict=True):
        solid = other[..., 3] == 255
        assert (one[..., 3] == other[..., 3]).all()
        assert (one[solid] == other[solid]).all()
    with Image.open(target) as image:
        image.load()
        assert image.info["duration"] == 80
        assert image.info["loop"] == 0


@pytest.mark.parametrize("suffix", [".png", ".webp", ".gif"])
def test_same_pictures_give_same_bytes(tmp_path: Path, suffix: str) -> None:
    noise = [np.random.default_rng(0).integers(0, 256, (40, 30, 4), dtype=np.uint8)]
    for name in "ab":
        write_pictures(str(tmp_path / f"{name}{suffix}"), noise, 10, False)
    assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_webp_of_one_picture_is_a_still(tmp_path: Path) -> None:
    write_pictures(str(tmp_path / "a.webp"), pictures(1), 10, False)
    assert (frames(tmp_path / "a.webp")[0] == pictures(1)[0]).all()


def test_folder_has_numbered_pictures(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "turn"
    written = write_pictures(str(folder), pictures(), 10, False)
    names = ["0000.png", "0001.png", "0002.png"]
    assert sorted(path.name for path in written) == names
    assert sorted(path.name for path in folder.iterdir()) == names
    (folder / "notes.txt").write_text("kept")
    # A shorter turn replaces all of the longer one and nothing else.
    write_pictures(str(folder), pictures(1), 10, True)
    assert sorted(path.name for path in folder.iterdir()) == ["0000.png", "notes.txt"]


def test_nothing_is_left_of_what_fails(tmp_path: Path) -> None:
    def broken() -> object:
        yield pictures()[0]
        raise ZeroDivisionError

    for name in ("a.gif", "turn"):
        with pytest.raises(ZeroDivisionError):
            write_pictures(str(tmp_path / name), broken(), 10, False)  # type: ignore[arg-type]
        assert list(tmp_path.iterdir()) == []


def test_suffixes_are_distinguished(tmp_path: Path) -> None:
    folder = tmp_path / "v1.2"
    folder.mkdir()
    assert [kind_of(path) for path in ("a.PNG", "a.webp", "turn", "turn.d/", str(folder))] == [
        ".png",
        ".webp",
        "",
        "",
        "",
    ]
    with pytest.raises(InputError, match=r"unknown suffix \.bmp"):
        kind_of("a.bmp")


def test_mp4_without_ffmpeg_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match="ffmpeg"):
        check_pictures(str(tmp_path / "a.mp4"), False, SIZE, False)


@pytest.fixture
def ffmpeg(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A stand-in for ffmpeg that stores its input and arguments."""
    folder = tmp_path / "bin"
    folder.mkdir()
    program = folder / "ffmpeg"
    program.write_text('#!/bin/sh\necho "$@" > "$(dirname "$0")/arguments"\nfor last; do :; done\ncat > "$last"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(folder), prepend=os.pathsep)
    return folder / "arguments"


def test_mp4_gets_every_picture_and_its_size(tmp_path: Path, ffmpeg: Path) -> None:
    target = tmp_path / "a.mp4"
    check_pictures(str(target), False, SIZE, False)
    write_pictures(str(target), pictures(), 25, False)
    assert target.read_bytes() == b"".join(picture[..., :3].tobytes() for picture in pictures())
    assert "-s 16x12 -r 25 " in ffmpeg.read_text()


def test_mp4_that_fails_is_one_line_and_no_file(tmp_path: Path, ffmpeg: Path) -> None:
    (ffmpeg.parent / "ffmpeg").write_text("#!/bin/sh\necho no such codec >&2\nexit 1\n")
    with pytest.raises(InputError, match="no such codec"):
        write_pictures(str(tmp_path / "a.mp4"), pictures(), 25, False)
    assert [path.name for path in tmp_path.iterdir()] == ["bin"]


def test_mp4_refuses_what_it_cannot_hold(tmp_path: Path, ffmpeg: Path) -> None:
    with pytest.raises(InputError, match="transparency"):
        check_pictures(str(tmp_path / "a.mp4"), False, SIZE, True)
    with pytest.raises(InputError, match="even"):
        check_pictures(str(tmp_path / "a.mp4"), False, (15, 12), False)
