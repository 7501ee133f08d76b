"""The page's other end: hands out picture and annotation, saves what comes back, makes previews.

It listens on the loopback address alone and answers only its own page: requests for another host name are refused (a
name elsewhere may lead here), and what changes something needs a header that pages of others cannot send.
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
"""With a header of one's own a request of another page's script is asked for first, and we never consent."""

HEAD_BYTES = 1 << 20


@dataclass
class _State:
    """What the page gets when it is loaded again."""

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
    """A server for the page of one drawing; `serve_forever()` starts it.

    save : keeps an annotation and says where; preview : makes a page of one. Both may raise InputError, whose text the
        page shows; they are never called at the same time
    port : 0 takes a free one. Raises InputError where it is taken.
    """
    picture = io.BytesIO()
    Image.fromarray(subject.rgba).save(picture, "PNG", compress_level=1)
    height, width = subject.rgba.shape[:2]
    largest = HEAD_BYTES + height * width
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
            if not length.isdecimal() or int(length) > largest:
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
            """Nothing: the terminal shows the address and what was saved."""

    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), AnnotationHandler)
    except OSError as error:
        remedy = "choose another one, or leave it out"
        raise InputError("--port", f"{port} cannot be used ({error.strerror})", remedy) from None
    return server
