"""Names of files are portable, and keep what scripts need."""

from __future__ import annotations

import unicodedata
from pathlib import PurePosixPath, PureWindowsPath

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from exporters.file_names import MAX_NAME_BYTES, MAX_NAME_CHARACTERS, figure_name, safe_name


@pytest.mark.parametrize(
    "name",
    [
        "रवि",
        "रवी",
        "ธิดา",
        "กำ",
        "שָׁלוֹם",
        "مُحَمَّد",
        "Nguyễn",
        "한글",
        "山田太郎",
        "Ολυμπία",
        "ﷴ",
        "தமிழ்",
        "👑",
        "a-b.c_d",
        "አበበ",
    ],
)
def test_names_of_all_scripts_are_kept(name: str) -> None:
    composed = unicodedata.normalize("NFC", name)
    assert safe_name(name) == composed
    assert safe_name(unicodedata.normalize("NFD", name)) == composed


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("CON", "CON_"),
        ("nul", "nul_"),
        ("aux.txt", "aux_.txt"),
        ("LPT1", "LPT1_"),
        ("COM¹", "COM¹_"),
        ("lpt².tar.gz", "lpt²_.tar.gz"),
        ("-CON", "CON_"),
        ("prn. ", "prn_._"),
        ("Conrad", "Conrad"),
        ("com10", "com10"),
        ("a. . .", "a._._"),
        ("name...", "name"),
        ("x" * 70 + "...", "x" * 60),
        ("-rf", "rf"),
        ("../../etc/passwd", "_.._etc_passwd"),
        ('<a>:"b"/\\|?*', "_a_b_"),
        ("a\x00b\x1fc\x7fd\u0085e", "a_b_c_d_e"),
        ("\u202egpj.exe\u202c", "gpj.exe"),
        ("می\u200cخواهم", "میخواهم"),
        ("क्\u200dष", "क्ष"),
        ("👩\u200d🌾", "👩🌾"),
        ("❤\ufe0f", "❤"),
        ("\u0308", "_\u0308"),
        ("\u200b\u2060", "figure"),
        ("", "figure"),
        ("\udcfc", "_"),
        ("Müller & Söhne", "Müller_Söhne"),
    ],
)
def test_what_some_file_system_cannot_hold_is_replaced(name: str, expected: str) -> None:
    assert safe_name(name) == expected


@given(st.text(max_size=200) | st.text(st.characters(categories=["M", "L", "So", "Cf"]), max_size=200))
@example("CON." + "." * 80)
@example("a" + "\u0301" * 300)
@example("𒀀" * 100)
@settings(max_examples=200)
def test_safe_names_are_portable_and_do_not_change_again(name: str) -> None:
    found = safe_name(name)
    assert safe_name(found) == found
    assert found == unicodedata.normalize("NFC", found)
    assert found[0] not in ".-"
    assert found[-1] not in ". "
    assert not PureWindowsPath(found).is_reserved()
    assert PurePosixPath(found).name == PureWindowsPath(found).name == found
    assert not set('<>:"/\\|?*') & set(found)
    assert found.isprintable()
    assert len(found) <= MAX_NAME_CHARACTERS
    assert len(f"{found}_1000000_lod4.stac.json".encode()) <= MAX_NAME_BYTES + 30 < 255


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("farmer.png", "farmer"),
        ("farmer/image.png", "farmer"),
        ("a/monk/IMG-20240501_1.jpg", "monk"),
        ("nun/DSC01234.JPG", "nun"),
        ("nun/Scan 3.tif", "nun"),
        ("nun/0001.png", "nun"),
        ("nun/picture (2).png", "nun"),
        ("images/image.png", "image"),
        ("image.png", "image"),
        ("../image.png", "image"),
        ("/image.png", "image"),
        ("nun/imagery.png", "imagery"),
        ("nun/figaro.png", "figaro"),
    ],
)
def test_a_picture_with_a_generic_name_is_named_after_its_folder(path: str, expected: str) -> None:
    assert figure_name(PurePosixPath(path)) == expected
