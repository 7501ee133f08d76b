"""Local server for one page."""

from __future__ import annotations

import logging
import posixpath
import webbrowser
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import click

from fig2mesh.errors import InputError

log = logging.getLogger("fig2mesh")

# fmt: off
TYPES = {
    ".css": "text/css", ".czml": "application/json", ".geojson": "application/geo+json", ".gif": "image/gif",
    ".glb": "model/gltf-binary", ".gltf": "model/gltf+json", ".html": "text/html", ".jpeg": "image/jpeg",
    ".jpg": "image/jpeg", ".js": "text/javascript", ".json": "application/json", ".png": "image/png",
    ".svg": "image/svg+xml", ".wasm": "application/wasm", ".webp": "image/webp", ".xml": "application/xml",
}
# fmt: on
"""Media types by suffix; not the system's, which on some Windows machines has text/plain for scripts."""

UNKNOWN = "application/octet-stream"


def page_server(
    page: str, port: int = 0, folders: dict[str, Path] | None = None, files: dict[str, Path] | None = None
) -> ThreadingHTTPServer:
    """Make a server on the loopback address that serves the page at /; `serve_forever()` starts it.

    port : 0 for a free one
    folders : first component of a URL path → folder to serve below it
    files : whole URL path, without leading slash → file
    """
    single = files or {}
    body = page.encode("utf-8")
    shared = {name: folder.resolve() for name, folder in (folders or {}).items()}

    class PageHandler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            address = unquote(urlsplit(self.path).path)
            if address in ("/", "/index.html"):
                self._answer(body, "text/html; charset=utf-8")
                return
            plain = posixpath.normpath(address).lstrip("/")
            if plain in single and single[plain].is_file():
                self._answer(single[plain].read_bytes(), TYPES.get(single[plain].suffix.lower(), UNKNOWN))
                return
            name, _, rest = plain.partition("/")
            path = (shared[name] / rest).resolve() if name in shared and "\0" not in rest else None
            # Links and dots must not lead outside of the folder.
            if path is None or not path.is_relative_to(shared[name]) or not path.is_file():
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            self._answer(path.read_bytes(), TYPES.get(path.suffix.lower(), UNKNOWN))

        def _answer(self, content: bytes, kind: str) -> None:
            self.send_response(HTTPStatus.OK)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Cache-Control", "no-store" if content is body else "max-age=3600")
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Log nothing: the terminal shows only the address."""

    try:
        return ThreadingHTTPServer(("127.0.0.1", port), PageHandler)
    except OSError as error:
        remedy = "choose another port, or leave it out"
        raise InputError("--port", f"{port} cannot be used ({error.strerror})", remedy) from None


def address_of(server: ThreadingHTTPServer) -> str:
    """URL of the page."""
    return f"http://127.0.0.1:{server.server_address[1]}/"


def show(server: ThreadingHTTPServer, open_: bool) -> None:
    """Print the server's URL and serve until Ctrl-C.

    open_ : whether to open it in a browser
    """
    with server:
        address = address_of(server)
        click.echo(address)
        log.info("stop with Ctrl-C")
        if open_:
            webbrowser.open(address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            log.info("stopped")
