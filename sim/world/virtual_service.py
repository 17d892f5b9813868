"""The coordinator's shell in virtual time: the twin of service/coordinator_service.py.

Decides: when the core hears and looks, that a plan takes its time to be found, and what is
recorded, with the same order and stamps as the real shell.  Must not know: robots, bodies, faults.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from msgspec.structs import replace

from coordinator.fleet.core import Fleet
from coordinator.fleet.epoch_record import Request, adoption_key, record_of
from coordinator.fleet.events import Outgoing
from coordinator.fleet.link_record import link_news
from coordinator.fleet.mission import Mission
from coordinator.fleet.recovery import Recovery
from coordinator.fleet.tick_record import QUIET, quiet_key
from coordinator.log.head import plan_file
from coordinator.log.log_file import log_from_bytes
from coordinator.plan.document import PlanDocument
from coordinator.schedule.lateness import Lateness, lateness_key, lateness_record
from coordinator.service.replay import go_on
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Command
from protocol.phases import FREEZE, GO, OVER
from protocol.timing import MILLISECOND
from sim.world.memory_transport import MemoryNetwork, MemorySession
from sim.world.run_logs import RunLogs

RETIMING: Final = 150 * MILLISECOND
"""How long new times take to be found, in virtual time."""

COORDINATOR: Final = "coordinator"
"""The name of the coordinator's session."""


class VirtualService:
    """Runs a mission on a network in virtual time, from `begin` on; without `logs` none is written.

    `planning_ns`: how long a plan takes to be found.  `freezes` is for tests alone, see World.
    """

    def __init__(
        self,
        mission: Mission,
        network: MemoryNetwork,
        clock: Callable[[], int],
        planning_ns: int,
        *,
        logs: RunLogs | None = None,
        freezes: bool = True,
    ) -> None:
        self.mission = mission
        self.bytes_heard = 0
        self._network = network
        self._clock = clock
        self._planning_ns = planning_ns
        self._logs = logs
        self._freezes = freezes
        self._planning: tuple[int, Request, Recovery] | None = None
        self._retiming: tuple[int, Lateness, PlanDocument | None] | None = None
        self._arrivals: list[tuple[str, bytes, int | None]] = []
        self._before: bytes | None = None
        self._session: MemorySession | None = None

    def begin(self) -> None:
        """Open the link: from now on the core hears, looks and speaks."""
        self._session = self._network.session(COORDINATOR)
        for kind in (keys.hello, keys.report, keys.clock):
            self._session.subscribe(kind(self.fleet.name, "*"), self._enqueue)
        self._session.watch_alive(keys.alive(self.fleet.name, "*"), self._link_changed)

    @property
    def fleet(self) -> Fleet:
        """The fleet core."""
        return self.mission.fleet

    def look(self) -> None:
        """Let the fleet core look at the time, and plan when it rests."""
        if self._session is None:
            return
        now_ns = self._clock()
        messages = self.fleet.tick(now_ns)
        if not messages:
            self._record(quiet_key(self.fleet.name), QUIET)
        self._send(messages)
        if self._freezes:
            self._plan(now_ns)
            self._retime(now_ns)

    def take_arrivals(self) -> None:
        """Let the core hear what has arrived."""
        arrivals, self._arrivals = self._arrivals, []
        for key, payload, sent_ns in arrivals:
            self.bytes_heard += len(payload)
            now_ns = self._clock()
            self._record(key, payload, sent_ns)
            self._send(self.fleet.hear(key, payload, now_ns))

    def die(self) -> None:
        """End as a killed process does; ValueError without logs to go on from.

        One whose fleet is over has nothing to go on with, and stays.
        """
        if self.fleet.phase == OVER:
            return
        if self._logs is None:
            raise ValueError("a coordinator without a log cannot go on from it")
        self._before = self._logs.cut()
        self._network.drop(COORDINATOR)
        self._arrivals.clear()
        self._planning = self._retiming = None

    def come_back(self) -> None:
        """Go on from the log, with the next boot id."""
        if self._logs is None or self._before is None:
            return
        boot, now_ns = (self.fleet.boot + 1) % 2**32, self._clock()
        self.mission = go_on(log_from_bytes(self._before, "the log before"), boot, now_ns)
        self._logs.go_on(self._before, boot, now_ns)
        self._before = None
        self.begin()

    def _enqueue(self, key: str, payload: bytes, sent_ns: int | None) -> None:
        self._arrivals.append((key, payload, sent_ns))

    def _link_changed(self, key: str, alive: bool) -> None:
        self._arrivals.append((key, link_news(alive), None))

    def _plan(self, now_ns: int) -> None:
        """Plan when the fleet rests; the plan is there some time later."""
        request = self.mission.request(now_ns)
        if request is not None:
            due_ns = now_ns + self._planning_ns
            self._planning = (due_ns, request, self.mission.solve(request))
        if self._planning is None or now_ns < self._planning[0]:
            return
        _, asked, recovery = self._planning
        self._planning = None
        messages = self.mission.adopt(asked, recovery, now_ns)
        if messages is None:
            return
        self._record(adoption_key(self.fleet.name), record_of(asked))
        if self._logs is not None and recovery.document is not None:
            self._logs.attach(*plan_file(recovery.document))
        self._send(messages)

    def _retime(self, now_ns: int) -> None:
        """Look for new times when a robot is late; they are there some time later."""
        late = self.mission.late()
        if late is not None:
            self._retiming = (now_ns + RETIMING, late, self.mission.retime(late))
        if self._retiming is None or now_ns < self._retiming[0]:
            return
        _, asked, document = self._retiming
        self._retiming = None
        messages = self.mission.take_times(asked, document, now_ns)
        if messages is None:
            return
        self._record(lateness_key(self.fleet.name), lateness_record(asked))
        if self._logs is not None and document is not None:
            self._logs.attach(*plan_file(document))
        self._send(messages)

    def _send(self, messages: list[Outgoing]) -> None:
        for message in messages:
            self._record(message.key, message.payload)
        for message in messages:
            payload = message.payload if self._freezes else _heedless(message.payload)
            if self._session is not None:
                self._session.put(message.key, payload)

    def _record(self, key: str, payload: bytes, sent_ns: int | None = None) -> None:
        if self._logs is not None:
            self._logs.record(key, payload, self._clock(), sent_ns)


def _heedless(payload: bytes) -> bytes:
    """Return a message that says GO where it said FREEZE."""
    command = decode("command", payload)
    if isinstance(command, Command) and command.phase == FREEZE:
        return encode(replace(command, phase=GO))
    return payload
