"""The desk of a coordinator, in a process of its own.

Decides: where the desk is served, with which keys, and that it ends with its coordinator.
"""

from __future__ import annotations

import datetime
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final, NamedTuple

from coordinator.base.errors import InputError
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import from_json, to_json
from coordinator.security.key_store import KeyStore
from coordinator.service.tapped_link import PipeLink, TappedLink
from protocol.endpoint import Endpoint
from protocol.key_files import KeyFiles, read_key_files
from protocol.transport import Transport

_STARTS_S: Final = 60.0


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
    link: Transport, document: PlanDocument, place: DeskPlace
) -> Iterator[tuple[TappedLink, str]]:
    """Start the desk of a coordinator's link; yield the link to use in its place, and its address.

    `document`: the plan with the floor and the first epoch.

    Raises InputError if it cannot be served there.
    """
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    answer, told = context.Pipe(duplex=False)
    desk = context.Process(target=_run, args=(theirs, told, to_json(document), place))
    desk.start()
    theirs.close()
    told.close()
    try:
        heard = answer.recv() if answer.poll(_STARTS_S) else InputError(["--page: no answer"])
    except EOFError:
        heard = InputError(["--page: the desk has ended at its start"])
    if isinstance(heard, InputError):
        ours.close()
        desk.join(1.0)
        raise heard
    tapped = TappedLink(link, ours, document.scenario)
    try:
        yield tapped, str(heard)
    finally:
        tapped.close()
        desk.join(3.0)
        desk.kill()
        desk.join()


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
