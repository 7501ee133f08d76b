"""Files that rows name stay inside of the collection's folder."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from fig2mesh.batch.row_files import Roots, digest_of, sheet_files
from fig2mesh.errors import InputError


@pytest.fixture
def roots(tmp_path: Path) -> Roots:
    """tmp_path/all/collection is the collection's folder; outside of it are secret.png and other/."""
    (tmp_path / "all" / "collection" / "pictures").mkdir(parents=True)
    (tmp_path / "all" / "collection" / "pictures" / "a.png").write_bytes(b"a")
    (tmp_path / "all" / "secret.png").write_bytes(b"s")
    base = tmp_path / "all" / "collection"
    return Roots(base, base.resolve())


def test_files_inside_are_found_by_any_way_to_write_them(roots: Roots) -> None:
    inside = roots.base / "pictures" / "a.png"
    for text in ("pictures/a.png", "./pictures/../pictures/a.png", str(inside)):
        assert roots.resolve("figure", Path(text)).samefile(inside)


@pytest.mark.parametrize("text", ["../secret.png", "pictures/../../secret.png", "/etc/passwd", "../nothing.png"])
def test_paths_that_lead_out_are_rejected(roots: Roots, text: str) -> None:
    with pytest.raises(InputError, match="leads out of") as caught:
        roots.resolve("figure", Path(text))
    assert "--root" in str(caught.value)


def test_links_that_lead_out_are_rejected_whether_of_files_or_folders(roots: Roots) -> None:
    (roots.base / "link.png").symlink_to(roots.base.parent / "secret.png")
    (roots.base / "up").symlink_to(roots.base.parent)
    for text in ("link.png", "up/secret.png"):
        with pytest.raises(InputError, match="is a link out of"):
            roots.resolve("figure", Path(text))


def test_links_inside_and_a_wider_root_are_taken(roots: Roots) -> None:
    (roots.base / "same.png").symlink_to("pictures/a.png")
    assert roots.resolve("figure", Path("same.png")).read_bytes() == b"a"
    wide = Roots(roots.base, roots.root.parent)
    assert wide.resolve("figure", Path("../secret.png")).read_bytes() == b"s"


def test_names_that_no_file_can_have_are_rejected(roots: Roots) -> None:
    (roots.base / "loop").symlink_to("loop")
    for text in ("a\0b.png", "loop", "x" * 5000, "pictures", "missing.png", ""):
        with pytest.raises(InputError) as caught:
            roots.resolve("figure", Path(text))
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 600


def test_messages_are_without_the_folder(roots: Roots) -> None:
    assert roots.shorten(f"{roots.base}/pictures/a.png: bad") == "pictures/a.png: bad"


def test_what_belongs_to_a_sheet(tmp_path: Path) -> None:
    for name in ("map.tif", "map.tfw", "map.prj", "map.tif.points", "map2.tif", "MAP.PRJ"):
        (tmp_path / name).touch()
    found = {path.name for path in sheet_files(tmp_path / "map.tif")}
    assert found == {"map.tif", "map.tfw", "map.prj", "map.tif.points", "MAP.PRJ"}


def test_digests_follow_the_content(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"one")
    first = digest_of(file)
    assert digest_of(file) == first
    file.write_bytes(b"other")
    assert digest_of(file) != first


@pytest.mark.parametrize("text", [r"pictures\a.png", r".\pictures\a.png", "pictures//./a.png"])
def test_separators_of_windows_lead_to_the_same_file(roots: Roots, text: str) -> None:
    assert roots.resolve("figure", Path(text)).samefile(roots.base / "pictures" / "a.png")


def test_urls_of_files_are_paths(roots: Roots) -> None:
    (roots.base / "pictures" / "my ä.png").write_bytes(b"b")
    uri = (roots.base / "pictures" / "my ä.png").as_uri()
    for text in (uri, uri.replace("file:///", "file:/"), uri.replace("file:///", "file://localhost/")):
        assert roots.resolve("figure", Path(text)).read_bytes() == b"b"
    with pytest.raises(InputError, match="leads out of"):
        roots.resolve("figure", Path((roots.base.parent / "secret.png").as_uri()))


@pytest.mark.parametrize(("stored", "written"), [("NFC", "NFD"), ("NFD", "NFC")])
def test_names_may_be_composed_in_another_way_than_on_the_disk(roots: Roots, stored: str, written: str) -> None:
    folder = roots.base / unicodedata.normalize(stored, "Zürich")
    folder.mkdir()
    (folder / unicodedata.normalize(stored, "Müller.png")).write_bytes(b"m")
    text = unicodedata.normalize(written, "Zürich/Müller.png")
    assert roots.resolve("figure", Path(text)).read_bytes() == b"m"


def test_a_backslash_in_a_name_stays(roots: Roots) -> None:
    (roots.base / r"pictures\a.png").write_bytes(b"own")
    assert roots.resolve("figure", Path(r"pictures\a.png")).read_bytes() == b"own"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (r"C:\maps\a.png", "is a path of Windows, with a drive or a server; give the path relative to the folder"),
        ("D:/maps/a.png", "is a path of Windows"),
        ("file:///C:/maps/a.png", "is a path of Windows"),
        (r"\\server\share\a.png", "is a path of Windows"),
        ("https://example.org/a.png", "is a web address; download the file, and give its path"),
        ("~/a.png", "begins with ~, which is not expanded in tables"),
        ("pictures/b.png", "pictures/b.png: No such file or directory; check the path"),
        ("pictures/A.PNG", "check the path (did you mean pictures/a.png?)"),
        ("pictures/%61.png", "check the path (did you mean pictures/a.png?)"),
        ("../nothing.png", ", and does not exist; check the path"),
    ],
)
def test_other_paths_are_refused_for_the_true_reason(roots: Roots, text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        roots.resolve("figure", Path(text))
    assert message in str(caught.value)
    assert str(caught.value).startswith("column figure: ")


def test_the_folder_to_allow_is_named_and_works(roots: Roots) -> None:
    secret = roots.base.parent / "secret.png"
    with pytest.raises(InputError) as caught:
        roots.resolve("figure", secret)
    wider = Path(str(caught.value).rpartition("--root ")[2])
    assert wider == roots.base.parent.resolve()
    assert Roots(roots.base, wider).resolve("figure", secret).samefile(secret)


def test_a_table_outside_of_the_root_has_its_own_folder_named(tmp_path: Path) -> None:
    base, root = tmp_path / "tables", tmp_path / "project"
    base.mkdir()
    (root / "pictures").mkdir(parents=True)
    (root / "pictures" / "a.png").touch()
    with pytest.raises(
        InputError, match=r"b\.png does not exist; paths are relative to the folder of the table"
    ) as caught:
        Roots(base, root).resolve("figure", Path("pictures/b.png"))
    assert str(base) in str(caught.value)
    with pytest.raises(InputError, match=r"it is in .*project, but paths are relative"):
        Roots(base, root).resolve("figure", Path("pictures/a.png"))
