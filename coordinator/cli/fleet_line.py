"""A link of an operator's command to one running fleet.

Decides: which fleet a command speaks to, and how long it listens.  Must not know: what is asked.
"""

from __future__ import annotations

import getpass
import math
import os
import queue
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Final

import msgspec
import typer

from coordinator.base.console import tell
from coordinator.cli.option_checks import named, reached, within
from coordinator.service.key_option import Keys, given_keys
from protocol import keys as places
from protocol.codec import decode, encode
from protocol.key_files import KeyFiles
from protocol.messages import Block, Command, Message, Operators, OrderState
from protocol.transport import Transport

_PERIOD_S: Final = 0.2
_QUIET_S: Final = 0.5
"""When no further answer has come for so long, all have."""

_MISSED_S: Final = 2.0
"""After so long without a coordinator a person is told that none is heard yet."""

Connect = Annotated[
    str, typer.Option(callback=reached, help="tcp/HOST:PORT of the coordinator or router.")
]
FleetName = Annotated[
    str | None,
    typer.Option(callback=named, help="Name of the fleet; by default the first one heard."),
]
Patience = Annotated[
    float, typer.Option("--patience", callback=within(0.5, 86_400.0), help="Seconds to wait.")
]


class FleetLine:
    """A link to one fleet: what arrives, and where to put; `clock` tells the time [s]."""

    def __init__(
        self,
        transport: Transport,
        fleet: str | None,
        patience: float,
        by: str,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.boot = int.from_bytes(os.urandom(4), "little")
        self.fleet = fleet
        self.is_heard = False
        """Whether anything of the fleet was heard."""

        self.phase: int | None = None
        """The phase that the fleet's last Command stated."""

        self._others: set[str] = set()
        """The fleets whose coordinators are heard, if they are noted."""

        self._by = by
        self._transport = transport
        self._heard: queue.SimpleQueue[tuple[str, Message]] = queue.SimpleQueue()
        self._patience = patience
        self._clock = clock
        self._until = clock() + patience
        for key in (
            places.command(fleet or "*"),
            places.orders(fleet or "*", "*"),
            places.blocks(fleet or "*", "*"),
        ):
            transport.subscribe(key, self._hear)

    def _hear(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        place = places.split(key)
        message = decode(place[1], payload) if place is not None else None
        if place is not None and message is not None:
            self._heard.put((place[0], message))

    def note_others(self) -> None:
        """Note which other fleets are heard, to name them if this one is not."""

        def hear(key: str, _payload: bytes, _sent_ns: int | None) -> None:
            place = places.split(key)
            if place is not None:
                self._others.add(place[0])

        self._transport.subscribe(places.command("*"), hear)

    def messages(self, say: Callable[[str], None], *, lasts: bool = False) -> Iterator[Message]:
        """Yield the fleet's messages; call `say` with the fleet's name now and then.

        Ends when the patience is over; if this `lasts`, when nothing was heard for so long.
        """
        due, missed = 0.0, self._until - self._patience + _MISSED_S
        while (now := self._clock()) < self._until:
            if not self.is_heard and now >= missed:
                missed = math.inf
                tell(f"no coordinator is heard yet; this goes on for {self._until - now:.0f} s")
            if self.fleet is not None and now >= due:
                say(self.fleet)
                due = now + _PERIOD_S
            try:
                name, message = self._heard.get(timeout=_PERIOD_S)
            except queue.Empty:
                continue
            if self.fleet is None and isinstance(message, Command):
                self.fleet = name
            if name == self.fleet:
                self.is_heard = True
                self.phase = message.phase if isinstance(message, Command) else self.phase
                if lasts:
                    self._until = self._clock() + self._patience
                yield message

    def ask_until(
        self, key: Callable[[str], str], message: Operators, fits: Callable[[Message], bool]
    ) -> Message | None:
        """Send a message until an answer fits, and return that; None if none does in time."""
        answers = self.messages(lambda fleet: self.put(key(fleet), message))
        return next((one for one in answers if fits(one)), None)

    def unanswered(self, asked: str = "") -> typer.Exit:
        """Say that no coordinator has answered, and which fleets are heard; return exit code 1.

        `asked`: what was asked, in words.
        """
        which = "" if self.fleet is None else f" of fleet {self.fleet}"
        what = f" to {asked}" if asked else ""
        others = ", ".join(sorted(self._others - {self.fleet}))
        there = f"; the fleets heard are {others}" if others else ""
        tell(f"no coordinator{which} has answered{what} within {self._patience:g} s{there}", "red")
        return typer.Exit(1)

    def must_be_heard(self) -> None:
        """Say that no coordinator was heard, and exit with code 1, unless one was."""
        if not self.is_heard:
            raise self.unanswered()

    def put(self, key: str, message: Operators) -> None:
        """Send a message, with the name of who sends it."""
        self._transport.put(key, encode(msgspec.structs.replace(message, by=self._by)))

    def states(self) -> dict[str, OrderState]:
        """Return the states of all orders, by order; empty if there are none."""
        found = self._asked(places.orders).values()
        return {one.id: one for one in found if isinstance(one, OrderState)}

    def blocks(self) -> dict[str, Block]:
        """Return the closed places by their ids; empty if there are none."""
        found = self._asked(places.blocks).values()
        return {one.id: one for one in found if isinstance(one, Block)}

    def _asked(self, key: Callable[[str, str], str]) -> dict[str, Message]:
        """Return what the coordinator answers on such keys, by id."""
        found: dict[str, Message] = {}
        last: float | None = None

        def ask(fleet: str) -> None:
            self._transport.ask(key(fleet, "*"), self._hear)

        for message in self.messages(ask):
            now = self._clock()
            last = now if last is None else last
            if isinstance(message, OrderState | Block) and found.get(message.id) != message:
                found[message.id], last = message, now
            elif now - last > _QUIET_S:
                break
        return found


@contextmanager
def fleet_line(connect: str, fleet: str | None, patience: float, keys: Keys) -> Iterator[FleetLine]:
    """Open a link to a fleet for so long [s]."""
    from protocol.zenoh_transport import ZenohTransport

    files = given_keys(keys, "operator")
    with ZenohTransport.connect(connect, timeout_s=min(patience, 20.0), keys=files) as transport:
        line = FleetLine(transport, fleet, patience, sender(files))
        if fleet is not None and files is None:  # Keys let nobody listen to other fleets.
            line.note_others()
        yield line


def sender(files: KeyFiles | None) -> str:
    """Return who gives an order: the name on the keys, or else the user of this machine."""
    if files is not None:
        return files.badge.name
    try:
        return getpass.getuser()[:64]
    except (KeyError, OSError):
        return ""
