"""The coordinator's shell: runs a mission on a real link, a real clock and a real log.

Everything that arrives, everything that is sent and every plan adopted goes to the recorder with
the same `now_ns` that the core got, so that the log can be run again.

Decides: when the mission's driver hears messages and looks at the time, and that plans are searched
in threads beside it.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

from coordinator.fleet.core import Fleet
from coordinator.fleet.events import Incident
from coordinator.fleet.hold_reasons import missing_in_words
from coordinator.fleet.log_records import link_record
from coordinator.log.head import plan_file
from coordinator.log.recorder import Recorder
from coordinator.mission.intake import Arrival
from coordinator.mission.mission import Mission
from coordinator.mission.mission_driver import Job, Journal, MissionDriver, Outcome
from coordinator.plan.document import PlanDocument
from protocol import keys
from protocol.phases import HOLD
from protocol.timing import COMMAND_PERIOD, SECOND
from protocol.transport import Transport


class RecordedJournal(Journal):
    """A mission's journal in a log file.

    If `keep` is given, it is called with every plan that is attached to the log.
    """

    def __init__(
        self, recorder: Recorder, keep: Callable[[PlanDocument], None] | None = None
    ) -> None:
        self._recorder = recorder
        self._keep = keep

    @property
    def error(self) -> str | None:
        """Why nothing can be written any more; None if the log can be written."""
        return self._recorder.error

    @property
    def not_recorded(self) -> int:
        """How many messages the recorder dropped because it had no space for them."""
        return self._recorder.dropped

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Record a message."""
        self._recorder.record(key, payload, now_ns, sent_ns)

    def keep(self, document: PlanDocument) -> None:
        """Attach a plan to the log and pass it to the callback."""
        self._recorder.attach(*plan_file(document))
        if self._keep is not None:
            self._keep(document)

    def sync(self) -> bool:
        """Wait until all records are on the disk; return False if they cannot be written."""
        return self._recorder.sync()

    def hurry(self) -> None:
        """Ask for the records so far to be written to the file soon."""
        self._recorder.hurry()


class Service:
    """The service that runs one mission to its end.

    `clock` returns the coordinator's time in ns; `speed` is how many of its seconds pass in one
    real second.  `watch` is called after every tick, and `keep` with every plan after the first.
    `has_router` returns whether the router can be reached; None if robots connect without a router.
    """

    def __init__(
        self,
        mission: Mission,
        transport: Transport,
        recorder: Recorder,
        clock: Callable[[], int],
        speed: float = 1.0,
        watch: Callable[[Fleet, int], None] | None = None,
        keep: Callable[[PlanDocument], None] | None = None,
        has_router: Callable[[], bool] | None = None,
    ) -> None:
        self.fleet = mission.fleet
        self.driver = MissionDriver(mission, RecordedJournal(recorder, keep), transport.put)
        self._transport = transport
        self._recorder = recorder
        self._clock = clock
        self._speed = speed
        self._watch = watch
        self._has_router = has_router
        self._door = threading.Lock()
        self._arrived = asyncio.Event()
        self._is_waking = False
        self._under_way: list[tuple[Job, asyncio.Future[Outcome]]] = []

    async def run(self, patience_s: float) -> bool:
        """Run until nothing is left to do; return whether every robot has arrived.

        The run also ends when another coordinator has taken over.  It ends with False when not all
        robots of the first epoch are armed after `patience_s` seconds, and, if the log cannot be
        written any more, as soon as no robot is on its way.
        """
        self._listen(asyncio.get_running_loop())
        began = self._clock()
        if self.fleet.is_resumed:
            self.driver.checkpoint(began)
        due = began
        while True:
            await self._take_until(due)
            now = self._clock()
            self._look(now)
            if self._watch is not None:
                self._watch(self.fleet, now)
            due += COMMAND_PERIOD
            if due <= now:
                due = now + COMMAND_PERIOD
            if self.fleet.is_finished or self.fleet.superseded:
                with self._door:
                    self.driver.tell_drops(now, last=True)
                return self.fleet.members.has_arrived
            if self._recorder.error is not None and self.driver.nobody_goes(now):
                return False
            first = self.fleet.epoch == self.fleet.first_epoch
            if first and self.fleet.phase == HOLD and now - began > patience_s * SECOND:
                text = f"gave up after {patience_s:g} s; {missing_in_words(self.fleet, now)}"
                if self.fleet.is_resumed:
                    text += "; was --resume given the fleet's newest log?"
                self.fleet.incidents.append(Incident(now, "timeout", "", text))
                return False

    def _look(self, now: int) -> None:
        """Let the driver look at the time, start its new jobs, and give it those that are done."""
        if self._has_router is not None:
            self.driver.hear_router(self._has_router(), now)
        loop = asyncio.get_running_loop()
        for job in self.driver.look(now):
            future = loop.run_in_executor(None, job.work)
            future.add_done_callback(lambda _: self._arrived.set())
            self._under_way.append((job, future))
        with self._door:
            self.driver.tell_drops(now)
        self._finish_jobs(now)

    def _finish_jobs(self, now: int) -> None:
        """Give the driver the jobs that are done: a robot waits for its course."""
        for job, future in [one for one in self._under_way if one[1].done()]:
            self._under_way.remove((job, future))
            self.driver.finish(job, future.result(), now)

    def _listen(self, loop: asyncio.AbstractEventLoop) -> None:
        def wake() -> None:
            self._is_waking = False
            self._arrived.set()

        def from_any_thread(key: str, payload: bytes, sent_ns: int | None) -> None:
            with self._door:
                has_more = self.driver.intake.put(Arrival(key, payload, sent_ns))
            if has_more and not self._is_waking and not loop.is_closed():
                self._is_waking = True
                loop.call_soon_threadsafe(wake)

        def link_changed(key: str, alive: bool) -> None:
            from_any_thread(key, link_record(alive), None)

        fleet = self.fleet.name
        for kind in (keys.hello, keys.report, keys.clock, keys.admit):
            self._transport.subscribe(kind(fleet, "*"), from_any_thread)
        for key in (keys.command, *keys.TOLD):
            self._transport.subscribe(key(fleet), from_any_thread)
        self._transport.watch_alive(keys.alive(fleet, "*"), link_changed)
        self._transport.answer(
            keys.plan(fleet, "*"), lambda: self.driver.plans_again(self._clock())
        )

        self._transport.answer(keys.orders(fleet, "*"), self.driver.orders_again)
        self._transport.answer(keys.blocks(fleet, "*"), self.driver.blocks_again)

    async def _take_until(self, due: int) -> None:
        """Let the driver hear what arrives until the clock shows `due`."""
        await asyncio.sleep(0)  # Finished jobs must be noticed even if many messages wait.
        while (left := due - (now := self._clock())) > 0:
            self._arrived.clear()
            self._finish_jobs(now)
            with self._door:
                arrival = self.driver.intake.take(now)
            if arrival is not None:
                self.driver.hear(arrival, now)
                continue
            try:
                async with asyncio.timeout(left / SECOND / self._speed):
                    await self._arrived.wait()
            except TimeoutError:
                return
