"""A coordinator's link that a process of this machine listens in on, and may speak through.

The desk runs in a process of its own: what it does never delays the coordinator's Commands.
Everything that the coordinator says and hears goes through a pipe to it, and operators' messages
come back.

Decides: what the other process may say, and that a slow one loses messages and stops nothing.
Must not know: what the other process is.
"""

from __future__ import annotations

import contextlib
import queue
import threading
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from typing import Final, Literal

import msgspec

from coordinator.fleet.log_records import LINK_UP, link_record
from protocol import keys
from protocol.transport import AliveHandler, Answers, Handler, Transport

_MOST_WAITING: Final = 5_000

_END: Final = b""

_Kind = Literal["put", "ask", "log"]
_Frame = tuple[_Kind, str, bytes, int | None]
_frames: Final = msgspec.msgpack.Decoder(_Frame)


class TappedLink(Transport):
    """The coordinator's transport, with a pipe to the other process; closes both."""

    def __init__(self, inner: Transport, connection: Connection, fleet: str) -> None:
        self._inner = inner
        self._told = frozenset(kind(fleet) for kind in keys.TOLD)
        self._admits = keys.admit(fleet, "*").split("/")
        self._handlers: list[tuple[list[str], Handler]] = []
        self._answers: list[tuple[list[str], Answers]] = []
        self._is_closed = False
        self.speak_through(connection)

    def speak_through(self, connection: Connection) -> None:
        """Use this pipe from now on: whoever was at the other end of the last one has ended."""
        self._waiting: queue.Queue[bytes] = queue.Queue(_MOST_WAITING)
        threading.Thread(target=self._write, args=(connection, self._waiting), daemon=True).start()
        threading.Thread(target=self._read, args=(connection,), daemon=True).start()

    def put(self, key: str, payload: bytes) -> None:
        """Send bytes to all subscribers, the other process among them."""
        self._inner.put(key, payload)
        self._pass_on(key, payload, None)

    def subscribe(self, key_expression: str, handler: Handler) -> None:
        """Call the handler for what arrives on the link or from the other process."""

        def hear(key: str, payload: bytes, sent_ns: int | None) -> None:
            handler(key, payload, sent_ns)
            self._pass_on(key, payload, sent_ns)

        self._handlers.append((key_expression.split("/"), handler))
        self._inner.subscribe(key_expression, hear)

    def answer(self, key_expression: str, answers: Answers) -> None:
        """Answer queries of the link and of the other process."""
        self._answers.append((key_expression.split("/"), answers))
        self._inner.answer(key_expression, answers)

    def ask(self, key_expression: str, handler: Handler) -> None:
        """Send a query on the link."""
        self._inner.ask(key_expression, handler)

    def declare_alive(self, key: str) -> None:
        """Make the key count as alive on the link."""
        self._inner.declare_alive(key)

    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Watch keys of the link; the other process is told what a log would say of them."""

        def hear(key: str, alive: bool) -> None:
            handler(key, alive)
            self._pass_on(key, link_record(alive), None)

        self._inner.watch_alive(key_expression, hear)

    def tell_log_failed(self, text: str) -> None:
        """Tell the other process that the log cannot be written any more; no message says so."""
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(_frame("log", text, b"", None))

    def close(self) -> None:
        """End the link, and the pipe."""
        self._inner.close()
        self._is_closed = True
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(_END)

    def _pass_on(self, key: str, payload: bytes, sent_ns: int | None) -> None:
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(_frame("put", key, payload, sent_ns))

    def _write(self, connection: Connection, waiting: queue.Queue[bytes]) -> None:
        with contextlib.suppress(OSError, ValueError):
            while not self._is_closed:
                connection.send_bytes(waiting.get())
            connection.send_bytes(_END)

    def _read(self, connection: Connection) -> None:
        for kind, key, payload, _ in _frames_of(connection):
            parts = key.split("/")
            if kind == "ask":
                for expression, answers in self._answers:
                    if keys.fits(expression, parts):
                        for answer in answers():
                            self._pass_on(*answer, None)
            elif self._is_closed:
                continue
            elif key in self._told or keys.fits(self._admits, parts):
                for expression, handler in self._handlers:
                    if keys.fits(expression, parts):
                        handler(key, payload, None)


class PipeLink(Transport):
    """The other process's end of the pipe; `ended` is called when the coordinator has closed it.

    `log_failed` is called with the reason when its log cannot be written any more.
    """

    def __init__(
        self,
        connection: Connection,
        ended: Callable[[], None],
        log_failed: Callable[[str], None] = lambda _: None,
    ) -> None:
        self._connection = connection
        self._ended = ended
        self._log_failed = log_failed
        self._lock = threading.Lock()
        self._handlers: list[tuple[list[str], Handler]] = []
        threading.Thread(target=self._read, daemon=True).start()

    def put(self, key: str, payload: bytes) -> None:
        """Say something to the coordinator."""
        self._send("put", key, payload)

    def ask(self, key_expression: str, handler: Handler) -> None:  # noqa: ARG002
        """Ask the coordinator; the subscribers hear the answers."""
        self._send("ask", key_expression, b"")

    def subscribe(self, key_expression: str, handler: Handler) -> None:
        """Call the handler for what the coordinator says and hears."""
        self._handlers.append((key_expression.split("/"), handler))

    def declare_alive(self, key: str) -> None:
        """Do nothing: nobody watches the end of a pipe."""

    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Call the handler for every change that the coordinator hears of."""

        def hear(key: str, payload: bytes, _sent_ns: int | None) -> None:
            handler(key, payload == LINK_UP)

        self.subscribe(key_expression, hear)

    def close(self) -> None:
        """End the pipe."""
        self._connection.close()

    def _send(self, kind: _Kind, key: str, payload: bytes) -> None:
        with self._lock, contextlib.suppress(OSError, ValueError):
            self._connection.send_bytes(_frame(kind, key, payload, None))

    def _read(self) -> None:
        for kind, key, payload, sent_ns in _frames_of(self._connection):
            if kind == "log":
                self._log_failed(key)
                continue
            parts = key.split("/")
            for expression, handler in list(self._handlers):
                if keys.fits(expression, parts):
                    handler(key, payload, sent_ns)
        self._ended()


def _frame(kind: _Kind, key: str, payload: bytes, sent_ns: int | None) -> bytes:
    return msgspec.msgpack.encode((kind, key, payload, sent_ns))


def _frames_of(connection: Connection) -> Iterator[_Frame]:
    """Yield what comes through a pipe until the other side ends or says no frame; close it then.

    A pipe that is closed while somebody reads it stays open: so the reader closes it.
    """
    with contextlib.suppress(OSError, EOFError, ValueError, TypeError):
        while True:
            yield _frames.decode(connection.recv_bytes())
    connection.close()
