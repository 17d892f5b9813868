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
from protocol.key_files import KeyFiles, read_key_files
from protocol.transport import Transport

_STARTS_S: Final = 30.0


class DeskPlace(NamedTuple):
    """Where a desk is served: host, port, and the fleet's folder of keys, if it has one."""

    host: str
    port: int
    keys: Path | None = None

    @property
    def is_local(self) -> bool:
        """Whether only this machine reaches it."""
        return self.host in ("127.0.0.1", "localhost", "::1")


def desk_place(page: str, keys: Path | None) -> DeskPlace:
    """Return the place that --page HOST:PORT names.

    Raises InputError if it is malformed, or open to strangers.
    """
    host, colon, port = page.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not (colon and host and port.isdecimal() and int(port) <= 65_535):
        raise InputError([f"--page: {page[:60]} is not HOST:PORT"])
    place = DeskPlace(host, int(port), keys)
    if keys is None and not place.is_local:
        raise InputError([f"--page: {host} is open to strangers; give --keys, or use 127.0.0.1"])
    return place


@contextmanager
def with_desk(
    link: Transport, document: PlanDocument, place: DeskPlace
) -> Iterator[tuple[Transport, str]]:
    """Start the desk of a coordinator's link; yield the link to use in its place, and its address.

    `document`: the plan with the floor and the first epoch.

    Raises InputError if it cannot be served there.
    """
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    answer, told = context.Pipe(duplex=False)
    desk = context.Process(target=_run, args=(theirs, told, to_json(document), place), daemon=True)
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
    link = PipeLink(connection, ended.set)
    document = from_json(plan)
    line = Line(link, LiveCourse(document.scenario, document), "page")
    files, valid = None, frozenset[str]()
    if place.keys is not None and not place.is_local:
        files, valid = _keys(place.keys)
    desk = Desk(
        line,
        lambda may: page_of(line.scene(), live=True, may_command=may),
        may_command=True,
        is_local=files is None,
        valid=valid,
    )
    try:
        with served(desk.app(), place.host, place.port, files) as address:
            told.send(address)
            ended.wait()
    except InputError as error:
        told.send(InputError([f"--page: {problem}" for problem in error.problems]))


def _keys(folder: Path) -> tuple[KeyFiles, frozenset[str]]:
    """Return the coordinator's own keys, and the common names that may connect."""
    now = datetime.datetime.now(datetime.UTC)
    badges = KeyStore(folder).register().valid(now)
    return read_key_files(folder, "coordinator"), frozenset(one.common_name for one in badges)
