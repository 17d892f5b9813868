"""The coordinator's shell in virtual time, in place of service/coordinator_service.py.

Decides: how long planning takes, and what a killed coordinator leaves behind.  What a coordinator
does is decided by the same mission driver as in a real run.  Must not know: robots, bodies, faults.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Final

from msgspec.structs import replace

from coordinator.fleet.core import Fleet
from coordinator.fleet.log_records import Request, link_record
from coordinator.log.head import plan_file
from coordinator.log.log_file import log_from_bytes
from coordinator.mission.intake import Arrival
from coordinator.mission.mission import Mission
from coordinator.mission.mission_driver import (
    CHECKPOINT_BYTES,
    Job,
    Journal,
    MissionDriver,
    Outcome,
)
from coordinator.plan.document import PlanDocument
from coordinator.scenario.model import Scenario
from coordinator.service.replay import go_on
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Command
from protocol.phases import OVER
from sim.world.memory_transport import MemoryNetwork, MemorySession
from sim.world.run_logs import RunLogs

COORDINATOR: Final = "coordinator"
"""The name of the coordinator's session."""


_FOR_EVER_MS: Final = 1_000_000_000

_COURSES_PER_PLAN: Final = 6
"""How many courses are found in the time of a plan for the fleet."""


class VirtualJournal(Journal):
    """A mission's journal that writes to the logs of a run in virtual time, if there are any."""

    def __init__(self, logs: RunLogs | None) -> None:
        self._logs = logs

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Record a message in the log."""
        if self._logs is not None:
            self._logs.record(key, payload, now_ns, sent_ns)

    def keep(self, document: PlanDocument) -> None:
        """Attach a plan to the log, without the time that planning took on this machine."""
        if self._logs is not None:
            timing = dict.fromkeys(document.timing, 0.0)
            self._logs.attach(*plan_file(replace(document, timing=timing)))

    def sync(self) -> bool:
        """Bring the log to the disk, which in virtual time is never slow and never fails."""
        if self._logs is not None:
            self._logs.sync()
        return True

    def hurry(self) -> None:
        """Do nothing: no record waits to be written."""


class VirtualService:
    """The coordinator in virtual time: runs a mission on a network, from `begin` on.

    `planning_ns`: how long finding a plan takes.  `logs`: where messages are recorded, if anywhere.
    `authority` is for tests alone, see World; `checkpoint_bytes` as for MissionDriver.
    """

    def __init__(
        self,
        mission: Mission,
        network: MemoryNetwork,
        clock: Callable[[], int],
        planning_ns: int,
        *,
        logs: RunLogs | None = None,
        authority: bool = True,
        checkpoint_bytes: int = CHECKPOINT_BYTES,
    ) -> None:
        self.bytes_heard = 0
        self._network = network
        self._clock = clock
        self._planning_ns = planning_ns
        self._logs = logs
        self._authority = authority
        self._checkpoint_bytes = checkpoint_bytes
        self._before: bytes | None = None
        self.next_scenario: Scenario | None = None
        """With the floor on which the next coordinator finds itself, if that has changed."""

        self.beside: Executor | None = None
        """Where searches are made while the world goes on; by default it stands still meanwhile."""

        self._session: MemorySession | None = None
        self._drive(mission)

    def _drive(self, mission: Mission) -> None:
        journal = VirtualJournal(self._logs)
        self.driver = MissionDriver(mission, journal, self._put, self._checkpoint_bytes)
        self._under_way: list[tuple[int, Job, Future[Outcome]]] = []

    def begin(self) -> None:
        """Open the link: from now on the core receives, looks at the time, and sends."""
        self._session = self._network.session(COORDINATOR)
        for kind in (keys.hello, keys.report, keys.clock, keys.admit):
            self._session.subscribe(kind(self.fleet.name, "*"), self._enqueue)
        for key in (keys.command, keys.order, keys.tell, keys.block, keys.roster):
            self._session.subscribe(key(self.fleet.name), self._enqueue)
        self._session.watch_alive(keys.alive(self.fleet.name, "*"), self._link_changed)

    @property
    def mission(self) -> Mission:
        """The mission."""
        return self.driver.mission

    @property
    def fleet(self) -> Fleet:
        """The fleet core."""
        return self.driver.fleet

    def look(self) -> None:
        """Let the driver look at the time; a job that it requests is finished some time later."""
        if self._session is None:
            return
        now_ns = self._clock()
        jobs = self.driver.look(now_ns)
        self._under_way += [(now_ns + self._time_of(job), job, self._begun(job)) for job in jobs]
        self.driver.tell_drops(now_ns)
        for one in [one for one in self._under_way if one[0] <= now_ns and one[2].done()]:
            self._under_way.remove(one)
            _, job, outcome = one
            self.driver.finish(job, outcome.result(), now_ns)

    def _begun(self, job: Job) -> Future[Outcome]:
        """Begin a job; without a thread beside this one it is done then."""
        if self.beside is not None:
            return self.beside.submit(job.work)
        done: Future[Outcome] = Future()
        done.set_result(job.work())
        return done

    def _time_of(self, job: Job) -> int:
        """Return how long a job takes [ns]: a plan for the fleet, or one robot's course."""
        is_plan = isinstance(job.wanted, Request)
        return self._planning_ns if is_plan else self._planning_ns // _COURSES_PER_PLAN

    @property
    def has_arrivals(self) -> bool:
        """Whether messages have arrived that the driver has not heard."""
        return not self.driver.intake.is_empty()

    def take_arrivals(self) -> None:
        """Pass the messages that have arrived to the driver."""
        driver = self.driver
        now_ns = self._clock()
        while (arrival := driver.intake.take(now_ns)) is not None:
            driver.hear(arrival, now_ns)

    def die(self) -> None:
        """End as a killed process does; ValueError without logs to resume from.

        A coordinator whose fleet has ended has nothing left to do; it is not killed.
        """
        if self.fleet.phase == OVER:
            return
        if self._logs is None:
            raise ValueError("a coordinator without a log cannot resume")
        self._before = self._logs.cut()
        self._network.drop(COORDINATOR)
        self._drive(self.mission)

    def come_back(self, scenario: Scenario | None = None) -> None:
        """Resume from the log, with the next boot id, on a scenario's floor if one is given."""
        if self._logs is None or self._before is None:
            return
        scenario, self.next_scenario = scenario or self.next_scenario, None
        boot, now_ns = (self.fleet.boot + 1) % 2**32, self._clock()
        log = log_from_bytes(self._before, "the log before")
        self._drive(go_on(log, boot, now_ns, scenario))
        self._logs.go_on(self._before, boot, now_ns, scenario)
        self.driver.checkpoint(now_ns)
        self._before = None
        self.begin()

    def _enqueue(self, key: str, payload: bytes, sent_ns: int | None) -> None:
        self.bytes_heard += len(payload)
        self.driver.intake.put(Arrival(key, payload, sent_ns))

    def _link_changed(self, key: str, alive: bool) -> None:
        self.driver.intake.put(Arrival(key, link_record(alive), None))

    def _put(self, key: str, payload: bytes) -> None:
        if self._session is not None:
            self._session.put(key, payload if self._authority else _heedless(payload))


def _heedless(payload: bytes) -> bytes:
    """Return the message; a Command lets every robot drive as far as its plan goes."""
    command = decode("command", payload)
    if isinstance(command, Command):
        return encode(replace(command, headroom_ms=_FOR_EVER_MS, held=()))
    return payload
