"""The shell around the page: reads files into a scene, and serves the page to one viewer.

Decides: what is read, and that only requests from this machine are answered.  Must not know: what
is on the page.  It uses the standard library's http.server, with a thread for each request.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Final

import msgspec

from coordinator.base.errors import InputError
from coordinator.findings.traffic_numbers import first_go
from coordinator.log.blackbox_attachments import unpacked
from coordinator.log.log_file import RESUMED, logs_before, read_log
from coordinator.plan.plan_file import read
from coordinator.scenario.file_kinds import is_log
from coordinator.view.scene import Scene
from coordinator.view.scene_log import scene_of_logs
from coordinator.view.scene_plan import scene_of_plan
from coordinator.view.true_tracks import ghosts_of, read_ghosts

HOST: Final = "127.0.0.1"
_HOSTS: Final = (HOST, "localhost")

Events = Callable[[], Iterator[tuple[str, str]]]
"""Yields (event, data in one line) while a page listens; ("", "") keeps the connection alive."""


def read_scene(source: Path) -> Scene:
    """Return the scene of a plan, or of a log with the black boxes in it or beside it.

    Raise InputError if the file is neither.
    """
    if not is_log(source):
        return scene_of_plan(read(source))
    log = read_log(source)
    logs = [*logs_before(log, str(source)), log]
    depths = range(len(logs) - 1, -1, -1)
    names = [f"{source}{f': {RESUMED}' * depth}" for depth in depths]
    scene = scene_of_logs(list(zip(names, logs, strict=True)))
    try:
        boxes = unpacked(log.attachments)
        if boxes:
            ghosts = ghosts_of(boxes, scene.robots, f"{source}: ")
        else:
            go_ns = first_go(logs, 0)
            folder = source if source.is_dir() else source.parent
            ghosts = read_ghosts(folder / "blackbox", scene.robots, go_ns)
    except InputError as error:
        left_out = [f"without black boxes: {problem}" for problem in error.problems]
        return msgspec.structs.replace(scene, notes=[*scene.notes, *left_out])
    return msgspec.structs.replace(scene, ghosts=ghosts)


@contextmanager
def served(page: Callable[[], str], port: int = 0, events: Events | None = None) -> Iterator[str]:
    """Serve a page on this machine and yield its address; port 0 takes a free one.

    Raise InputError if the port is in use.
    """

    class Handler(_Handler):
        make_page = staticmethod(page)
        make_events = None if events is None else staticmethod(events)

    try:
        server = ThreadingHTTPServer((HOST, port), Handler)
    except (OSError, OverflowError) as error:
        raise InputError([f"--port: {port}: {getattr(error, 'strerror', None) or error}"]) from None
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.1,), daemon=True)
    thread.start()
    try:
        yield f"http://{HOST}:{server.server_address[1]}/"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


class _Handler(BaseHTTPRequestHandler):
    """A handler that serves the page at /, server-sent events at /events, and 404 elsewhere."""

    protocol_version = "HTTP/1.1"
    server_version = "splinefleet"
    sys_version = ""
    make_page: Callable[[], str]
    make_events: Events | None = None

    def do_GET(self) -> None:
        """Answer a request."""
        host = self.headers.get("Host", "").rpartition(":")[0]
        path = self.path.partition("?")[0]
        if host not in _HOSTS:  # refuse foreign names that resolve to this machine
            self._answer(HTTPStatus.FORBIDDEN, "text/plain", b"this machine only\n")
        elif path == "/":
            self._answer(HTTPStatus.OK, "text/html", self.make_page().encode())
        elif path == "/events" and self.make_events is not None:
            self._stream(self.make_events())
        else:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", b"there is one page only\n")

    def log_message(self, *_: object) -> None:
        """Log nothing about requests."""

    def _answer(self, status: HTTPStatus, kind: str, body: bytes) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()
        self.wfile.write(body)

    def _stream(self, events: Iterator[tuple[str, str]]) -> None:
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream; charset=utf-8")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        try:
            for event, data in events:
                text = f"event: {event}\ndata: {data}\n\n" if event else ": still here\n\n"
                self.wfile.write(text.encode())
                self.wfile.flush()
        except (BrokenPipeError, ConnectionResetError):
            return
