"""The desk of a coordinator, in a process of its own.

Decides: where the desk is served, with which keys, that it ends with its coordinator, and that one
that is killed begins again.
"""

from __future__ import annotations

import datetime
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final, NamedTuple
from urllib.parse import urlsplit

from coordinator.base.errors import InputError
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import from_json, to_json
from coordinator.security.key_store import KeyStore
from coordinator.service.tapped_link import PipeLink, TappedLink
from protocol.endpoint import Endpoint
from protocol.key_files import KeyFiles, read_key_files
from protocol.transport import Transport

_STARTS_S: Final = 60.0

_LOOK_S: Final = 0.5
"""How often [s] it is looked whether the desk's process is there still."""

_SELDOM_S: Final = 60.0
"""A desk that does not come up is started again at intervals that double, up to this [s]."""


class DeskPlace(NamedTuple):
    """Where a desk is served; with `files`, over TLS to who shows a certificate in `valid`."""

    host: str
    port: int
    files: KeyFiles | None = None
    valid: frozenset[str] = frozenset()


def desk_place(page: str, keys: Path | None) -> DeskPlace:
    """Return the place that --page HOST:PORT names.

    This machine needs no keys.  Raises InputError if the place is malformed or open to strangers,
    InputError or TransportError if the keys are not usable.
    """
    host, port = host_and_port(page)
    if Endpoint("tcp", host, port).is_loopback:
        return DeskPlace(host, port)
    if keys is None:
        raise InputError([f"--page: {host} is open to strangers; give --keys, or use 127.0.0.1"])
    badges = KeyStore(keys).register().valid(datetime.datetime.now(datetime.UTC))
    valid = frozenset(one.common_name for one in badges)
    return DeskPlace(host, port, read_key_files(keys, "coordinator"), valid)


def host_and_port(page: str) -> tuple[str, int]:
    """Return what --page HOST:PORT states; raises InputError if it is malformed."""
    host, colon, port = page.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not (colon and host and port.isdecimal() and int(port) <= 65_535):
        raise InputError([f"--page: {page[:60]} is not HOST:PORT"])
    return host, int(port)


@contextmanager
def with_desk(
    link: Transport, document: PlanDocument, place: DeskPlace, tell: Callable[[str, str], None]
) -> Iterator[TappedLink]:
    """Start the desk of a coordinator's link; yield the link to use in its place.

    `document`: the plan with the floor and the first epoch.  `tell` gets the page's address and a
    line about it, at the beginning and, from another thread, whenever the desk has begun again.

    Raises InputError if it cannot be served there.
    """
    plan = to_json(document)
    first = _Process(plan, place)
    tell(first.address, f"the page is at {first.address}")
    tapped = TappedLink(link, first.connection, document.scenario)
    ended = threading.Event()

    def keep() -> None:
        desk, pause = first, _LOOK_S
        again = place._replace(port=urlsplit(first.address).port or place.port)
        while not ended.wait(pause):
            if desk.process.is_alive():
                pause = _LOOK_S
                continue
            pause = min(2.0 * pause, _SELDOM_S)
            with suppress(InputError):
                desk = _Process(plan, again)
                tapped.speak_through(desk.connection)
                tell(desk.address, f"the page's process has ended; {desk.address} is there again")
        desk.end()

    keeper = threading.Thread(target=keep, daemon=True)
    keeper.start()
    try:
        yield tapped
    finally:
        ended.set()
        tapped.close()
        keeper.join()


class _Process:
    """A process that serves the desk at `address`, and the coordinator's end of the pipe to it.

    Raises InputError if it cannot be served there.
    """

    def __init__(self, plan: bytes, place: DeskPlace) -> None:
        context = get_context("spawn")
        self.connection, theirs = context.Pipe()
        answer, told = context.Pipe(duplex=False)
        self.process = context.Process(target=_run, args=(theirs, told, plan, place))
        self.process.start()
        theirs.close()
        told.close()
        try:
            heard = answer.recv() if answer.poll(_STARTS_S) else InputError(["--page: no answer"])
        except EOFError:
            heard = InputError(["--page: the desk has ended at its start"])
        if isinstance(heard, InputError):
            self.connection.close()
            self.end()
            raise heard
        self.address = str(heard)

    def end(self) -> None:
        """Wait until it has ended by itself, as it does without its pipe; else kill it."""
        self.process.join(3.0)
        self.process.kill()
        self.process.join()


def _run(connection: Connection, told: Connection, plan: bytes, place: DeskPlace) -> None:
    """Serve the desk until the coordinator closes the pipe."""
    from coordinator.desk.line import Line
    from coordinator.desk.web import Desk, served
    from coordinator.view.live_course import LiveCourse
    from coordinator.view.page import page_of

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ended = threading.Event()
    link = PipeLink(connection, ended.set, lambda text: line.log_failed(text))
    document = from_json(plan)
    line = Line(link, LiveCourse(document.scenario, document), "page")
    desk = Desk(
        line,
        lambda may: page_of(line.scene(), live=True, may_command=may),
        may_command=True,
        is_local=place.files is None,
        valid=place.valid,
    )
    try:
        with served(desk.app(), place.host, place.port, place.files) as address:
            told.send(address)
            ended.wait()
    except InputError as error:
        told.send(InputError([f"--page: {problem}" for problem in error.problems]))
