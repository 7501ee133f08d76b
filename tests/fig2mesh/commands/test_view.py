"""`fig2mesh view`: what it refuses, and its server."""

from __future__ import annotations

import http.client
import threading
import urllib.request
from collections.abc import Iterator
from http.server import ThreadingHTTPServer
from pathlib import Path

import pytest

from fig2mesh.commands.main import main
from fig2mesh.view.server import address_of, page_server
from tests.drawn import write_figure

Output = pytest.CaptureFixture[str]


@pytest.fixture
def server(tmp_path: Path) -> Iterator[http.client.HTTPConnection]:
    """A server of the page "hällo" and of a folder, and a connection to it."""
    (tmp_path / "secret.txt").write_text("secret")
    shared = tmp_path / "shared"
    (shared / "deep").mkdir(parents=True)
    (shared / "deep" / "a b.js").write_text("1;")
    (shared / "link.txt").symlink_to(tmp_path / "secret.txt")
    with page_server("hällo", folders={"cesium": shared}) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        connection = http.client.HTTPConnection(*running.server_address[:2], timeout=10)
        yield connection
        connection.close()
        running.shutdown()
        thread.join()


def answer(connection: http.client.HTTPConnection, path: str, method: str = "GET") -> tuple[int, str, bytes]:
    connection.request(method, path)
    response = connection.getresponse()
    body = response.read()
    connection.close()
    return response.status, response.headers.get("Content-Type", ""), body


def test_the_server_answers_with_page_and_folder(server: http.client.HTTPConnection) -> None:
    assert answer(server, "/") == (200, "text/html; charset=utf-8", "hällo".encode())
    assert answer(server, "/index.html?x=1")[2] == "hällo".encode()
    assert answer(server, "/cesium/deep/a%20b.js") == (200, "text/javascript", b"1;")
    assert server.host == "127.0.0.1"


@pytest.mark.parametrize(
    "path",
    [
        "/other",
        "/cesium",
        "/cesium/",
        "/cesium/deep",
        "/cesium/../secret.txt",
        "/cesium/%2e%2e/secret.txt",
        "/cesium/link.txt",
        "/cesium/a%00b",
        "/../secret.txt",
        "//etc/passwd",
        "/cesium//etc/passwd",
    ],
)
def test_the_server_gives_nothing_else(server: http.client.HTTPConnection, path: str) -> None:
    status, _, body = answer(server, path)
    assert status == 404
    assert b"secret" not in body.replace(path.encode(), b"")


def test_the_server_takes_no_orders(server: http.client.HTTPConnection) -> None:
    assert answer(server, "/", "POST")[0] == 501


def test_a_page_is_shown_until_interrupted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    files = write_figure(tmp_path)
    pages = []

    def open_page(address: str) -> None:
        # As a browser would; then as the user's Ctrl-C would.
        thread = threading.Thread(target=lambda: pages.append(urllib.request.urlopen(address, timeout=60).read()))
        thread.start()

    class Shown(ThreadingHTTPServer):
        def service_actions(self) -> None:
            if pages:
                raise KeyboardInterrupt

    monkeypatch.setattr("fig2mesh.view.server.ThreadingHTTPServer", Shown)
    monkeypatch.setattr("webbrowser.open", open_page)
    options = ["--keypoints", str(files.keypoints), "--quality", "draft", "--parts", "outline", "-q"]
    assert main(["view", str(files.image), *options]) == 0
    assert capsys.readouterr().out.startswith("http://127.0.0.1:")
    assert b'id="figure"' in pages[0]


def test_unusable_requests_are_one_line(tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    files = write_figure(tmp_path)
    figure = [str(files.image), "--keypoints", str(files.keypoints)]
    (tmp_path / "there.html").write_text("mine")
    monkeypatch.chdir(tmp_path)
    with page_server("") as taken:
        port = address_of(taken).rsplit(":")[-1].strip("/")
        cases = (
            (["-o", "there.html"], "there.html: already exists; use --overwrite or choose another name"),
            (["-o", "page.png"], "ends in .html"),
            (["-o", "nowhere/page.html"], "no such directory nowhere"),
            (["--effects", "light,glow"], "unknown effect 'glow'"),
            (["--port", port], f"--port: {port} cannot be used"),
            (["--cesium", "."], "requires --lonlat"),
            (["--lonlat", "8", "47", "--cesium", "."], "no CesiumJS in ."),
            (["--lonlat", "8", "47"], "npm install cesium"),
            (["--lonlat", "8", "97", "-o", "page.html"], "latitude 97"),
            (["--altitude", "3", "-o", "page.html"], "add --lonlat"),
            (["--textures", "none"], "view requires textures, not none"),
        )
        for options, expected in cases:
            assert main(["view", *figure, "--no-open", *options]) == 2, options
            out, err = capsys.readouterr()
            assert expected in err, options
            assert err.count("\n") == 1
            assert out == ""
    assert sorted(path.name for path in tmp_path.glob("*.html")) == ["there.html"]
    assert (tmp_path / "there.html").read_text() == "mine"


def test_pages_are_replaced_with_overwrite(tmp_path: Path) -> None:
    files, page = write_figure(tmp_path), tmp_path / "page.html"
    page.write_text("mine")
    options = ["--keypoints", str(files.keypoints), "--quality", "draft", "--parts", "outline", "-q", "-o", str(page)]
    assert main(["view", str(files.image), *options, "--overwrite", "--effects", "light,ao"]) == 0
    assert '"effects":["light","ao"]' in page.read_text()
