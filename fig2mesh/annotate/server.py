"""Server of the annotation page: serves picture and annotation, saves changes, makes previews.

It listens on the loopback address only and answers only its own page: requests with another host name are rejected (to
prevent DNS rebinding), and requests that change something need a header that other sites cannot send.
"""

from __future__ import annotations

import io
import json
import threading
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import urlsplit

from PIL import Image

from fig2mesh.annotate.editing import AnnotatedPicture, packed, unpacked
from fig2mesh.errors import InputError
from fig2mesh.parse.annotation import Annotation

HEADER = "X-Fig2mesh"
"""A custom header makes browsers send a CORS preflight for requests from other sites, which is never approved."""

HEAD_BYTES = 1 << 20


@dataclass
class _State:
    """State that the page gets when it is reloaded."""

    annotation: Annotation
    preview: str = ""


def annotation_server(
    page: str,
    subject: AnnotatedPicture,
    start: Annotation,
    save: Callable[[Annotation], str],
    preview: Callable[[Annotation], str],
    port: int = 0,
) -> ThreadingHTTPServer:
    """Make a server for the page of one drawing; `serve_forever()` starts it.

    save : saves an annotation and returns a message; preview : makes a page of one. Both may raise InputError, whose
        text the page shows; they are never called at the same time
    port : 0 for a free one. Raises InputError if it is in use.
    """
    picture = io.BytesIO()
    Image.fromarray(subject.rgba).save(picture, "PNG", compress_level=1)
    height, width = subject.rgba.shape[:2]
    max_bytes = HEAD_BYTES + height * width
    working = threading.Lock()
    state = _State(start)

    class AnnotationHandler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if not self._is_for_us():
                return
            answers: dict[str, tuple[Callable[[], bytes], str]] = {
                "/": (lambda: page.encode(), "text/html; charset=utf-8"),
                "/picture.png": (picture.getvalue, "image/png"),
                "/annotation": (lambda: packed(subject, state.annotation), "application/octet-stream"),
                "/preview": (lambda: state.preview.encode(), "text/html; charset=utf-8"),
            }
            found = answers.get(urlsplit(self.path).path)
            if found is None:
                self.send_error(HTTPStatus.NOT_FOUND)
                return
            content, kind = found
            self._answer(HTTPStatus.OK, content(), kind)

        def do_POST(self) -> None:
            if not self._is_for_us():
                return
            act = {"/save": self._save, "/preview": self._preview}.get(self.path)
            if act is None or self.headers.get(HEADER) is None:
                self.send_error(HTTPStatus.FORBIDDEN)
                return
            length = self.headers.get("Content-Length", "")
            if not length.isdecimal() or int(length) > max_bytes:
                self.send_error(HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
                return
            try:
                annotation = unpacked(self.rfile.read(int(length)), subject)
                with working:
                    message = act(annotation)
                self._answer(HTTPStatus.OK, json.dumps({"message": message}).encode(), "application/json")
            except InputError as error:
                text = json.dumps({"message": " ".join(str(error).split())}).encode()
                self._answer(HTTPStatus.UNPROCESSABLE_ENTITY, text, "application/json")

        def _save(self, annotation: Annotation) -> str:
            message = save(annotation)
            state.annotation = annotation
            return message

        def _preview(self, annotation: Annotation) -> str:
            state.preview = preview(annotation)
            return ""

        def _is_for_us(self) -> bool:
            here = server.server_port
            if self.headers.get("Host") in (f"127.0.0.1:{here}", f"localhost:{here}"):
                return True
            self.send_error(HTTPStatus.FORBIDDEN)
            return False

        def _answer(self, status: HTTPStatus, content: bytes, kind: str) -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(content)

        def log_message(self, format: str, *args: object) -> None:
            """Log nothing: the terminal shows only the address and saved files."""

    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), AnnotationHandler)
    except OSError as error:
        remedy = "choose another port, or leave it out"
        raise InputError("--port", f"{port} cannot be used ({error.strerror})", remedy) from None
    return server
