"""The coordinator's shell: a mission on a real link, a real clock and a real log.

Decides: when the core's `hear` and `tick` are called, and that plans are found beside it, in a
thread.  Everything that arrives, everything that is sent and every plan adopted goes to the
recorder with the very `now_ns` that the core saw, so a log can be run again.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Final

from coordinator.fleet.core import Fleet
from coordinator.fleet.drop_record import NOT_RECORDED, drops_key, drops_record
from coordinator.fleet.epoch_record import Request, adoption_key, record_of
from coordinator.fleet.events import Incident, Outgoing
from coordinator.fleet.intake import Arrival, Intake
from coordinator.fleet.link_record import link_news, router_key
from coordinator.fleet.missing_robots import missing_in_words
from coordinator.fleet.mission import Mission
from coordinator.fleet.recovery import Recovery
from coordinator.fleet.tick_record import QUIET, quiet_key
from coordinator.log.head import plan_file
from coordinator.log.recorder import Recorder
from coordinator.plan.document import PlanDocument
from coordinator.schedule.lateness import Lateness, lateness_key, lateness_record
from protocol import keys
from protocol.phases import FREEZE, GO, HOLD
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND
from protocol.transport import Transport

_TELL_DROPS: Final = SECOND
"""The log tells so often how many messages were dropped, while it becomes more."""

_ANSWER_TIME: Final = MILLISECOND
"""For each plan that is told again nobody is answered for so long."""


class Service:
    """Runs one mission to its end.

    `clock` gives the coordinator's time in ns, `speed` how many of its seconds pass in one real
    second; `watch` is called after every tick, `keep` with every plan of a later epoch.
    `has_router` tells whether the router is reached that everybody meets at, if one is.
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
        self.mission = mission
        self.fleet = mission.fleet
        members = self.fleet.members
        self.intake = Intake(self.fleet.name, lambda robot: members[robot].boot)
        self._transport = transport
        self._recorder = recorder
        self._clock = clock
        self._speed = speed
        self._watch = watch
        self._keep = keep
        self._has_router = has_router
        self._router_up: bool | None = None
        self._door = threading.Lock()
        self._arrived = asyncio.Event()
        self._is_waking = False
        self._plans = self.fleet.plans()
        self._answers_from_ns = 0
        self._drops: dict[str, int] = {}
        self._drops_told_ns = 0
        self._phase = (0, -1)
        self._log_told = False
        self._withheld = False
        self._planning: tuple[Request, asyncio.Future[Recovery]] | None = None
        self._retiming: tuple[Lateness, asyncio.Future[PlanDocument | None]] | None = None

    async def run(self, patience_s: float) -> bool:
        """Run until nothing is left to do; tell whether every robot has arrived.

        Also ends with False when not all robots are armed for the first time after `patience_s`
        seconds, or another coordinator has taken over; and when the log cannot be written any
        more, as soon as nobody is on its way.
        """
        self._listen(asyncio.get_running_loop())
        began = self._clock()
        due = began
        while True:
            await self._take_until(due)
            now = self._clock()
            self._look_at_router(now)
            self._tick(now)
            self._tell_drops(now)
            self._plan(now)
            self._retime(now)
            self._look_at_log(now)
            self._plans = self.fleet.plans()
            if self._watch is not None:
                self._watch(self.fleet, now)
            due += COMMAND_PERIOD
            if due <= now:
                due = now + COMMAND_PERIOD
            if self.fleet.is_finished or self.fleet.superseded:
                self._tell_drops(now + _TELL_DROPS)
                return self.fleet.members.has_arrived
            if self._recorder.error is not None and self._nobody_goes(now):
                return False
            first = self.fleet.epoch == self.fleet.first_epoch
            if first and self.fleet.phase == HOLD and now - began > patience_s * SECOND:
                text = f"gave up after {patience_s:g} s; {missing_in_words(self.fleet, now)}"
                if self.fleet.is_resumed:
                    text += "; was --resume given the fleet's newest log?"
                self.fleet.incidents.append(Incident(now, "timeout", "", text))
                return False

    def _look_at_router(self, now: int) -> None:
        """Tell the core, and the log, when the router is reached and when it is not."""
        up = None if self._has_router is None else self._has_router()
        if up is not None and up != self._router_up:
            self._router_up = up
            key, news = router_key(self.fleet.name), link_news(up)
            self._recorder.record(key, news, now)
            self._send(self.fleet.hear(key, news, now), now)

    def _look_at_log(self, now: int) -> None:
        """Tell at once, and once, that the log cannot be written any more."""
        if self._recorder.error is not None and not self._log_told:
            self._log_told = True
            text = f"{self._recorder.error}; nobody is sent on its way any more"
            self.fleet.incidents.append(Incident(now, "log", "", text))

    def _nobody_goes(self, now: int) -> bool:
        """Tell whether no robot is on its way, or none has heard that it might go."""
        phase = self.fleet.phase
        return self._withheld or phase == HOLD or (phase == FREEZE and self.fleet.is_settled(now))

    def _tick(self, now: int) -> None:
        messages = self.fleet.tick(now)
        if not messages:
            self._recorder.record(quiet_key(self.fleet.name), QUIET, now)
        self._send(messages, now)

    def _plan(self, now: int) -> None:
        """Begin to plan when the fleet rests, and adopt the plan when it is there."""
        request = self.mission.request(now)
        if request is not None:
            loop = asyncio.get_running_loop()
            self._planning = (request, loop.run_in_executor(None, self.mission.solve, request))
        if (
            self._recorder.error is not None
            or self._planning is None
            or not self._planning[1].done()
        ):
            return
        asked, future = self._planning
        self._planning = None
        recovery = future.result()
        messages = self.mission.adopt(asked, recovery, now)
        if messages is None:
            return
        self._recorder.record(adoption_key(self.fleet.name), record_of(asked), now)
        if recovery.document is not None:
            self._keep_plan(recovery.document)
        self._send(messages, now)

    def _retime(self, now: int) -> None:
        """Look for new times when a robot is late, and tell them when they are there."""
        late = self.mission.late()
        if late is not None:
            loop = asyncio.get_running_loop()
            self._retiming = (late, loop.run_in_executor(None, self.mission.retime, late))
        if self._retiming is None or not self._retiming[1].done():
            return
        asked, future = self._retiming
        self._retiming = None
        found = future.result()
        document = found if self._recorder.sync() else None
        messages = self.mission.take_times(asked, document, now)
        if messages is None:
            return
        self._recorder.record(lateness_key(self.fleet.name), lateness_record(asked), now)
        if document is not None:
            self._keep_plan(document)
            if not self._recorder.sync():
                return
        self._send(messages, now)

    def _keep_plan(self, document: PlanDocument) -> None:
        """Attach a plan to the log, and hand it on."""
        self._recorder.attach(*plan_file(document))
        if self._keep is not None:
            self._keep(document)

    def _listen(self, loop: asyncio.AbstractEventLoop) -> None:
        def wake() -> None:
            self._is_waking = False
            self._arrived.set()

        def from_any_thread(key: str, payload: bytes, sent_ns: int | None) -> None:
            with self._door:
                has_more = self.intake.put(Arrival(key, payload, sent_ns))
            if has_more and not self._is_waking and not loop.is_closed():
                self._is_waking = True
                loop.call_soon_threadsafe(wake)

        def link_changed(key: str, alive: bool) -> None:
            from_any_thread(key, link_news(alive), None)

        fleet = self.fleet.name
        for kind in (keys.hello, keys.report, keys.clock, keys.admit):
            self._transport.subscribe(kind(fleet, "*"), from_any_thread)
        self._transport.subscribe(keys.command(fleet), from_any_thread)
        self._transport.watch_alive(keys.alive(fleet, "*"), link_changed)
        self._transport.answer(keys.plan(fleet, "*"), self._answer)

    def _answer(self) -> list[tuple[str, bytes]]:
        """Return the plans for one who has not heard them all, if not too many ask.

        None that no robot may hear yet.
        """
        now, plans = self._clock(), self._plans
        if self._withheld or now < self._answers_from_ns:
            return []
        self._answers_from_ns = now + _ANSWER_TIME * len(plans)
        return [(plan.key, plan.payload) for plan in plans]

    async def _take_until(self, due: int) -> None:
        """Feed the core with what arrives until the clock shows `due`."""
        await asyncio.sleep(0)  # However much waits, plans that are found must be noticed.
        while (left := due - (now := self._clock())) > 0:
            self._arrived.clear()
            with self._door:
                arrival = self.intake.take(now)
            if arrival is not None:
                told = len(self.fleet.incidents)
                self._recorder.record(arrival.key, arrival.payload, now, arrival.sent_ns)
                self._send(self.fleet.hear(arrival.key, arrival.payload, now), now)
                if len(self.fleet.incidents) > told:
                    self._recorder.hurry()  # Who has arrived says so before it leaves, for good.
                continue
            try:
                async with asyncio.timeout(left / SECOND / self._speed):
                    await self._arrived.wait()
            except TimeoutError:
                return

    def _tell_drops(self, now: int) -> None:
        """Let the log tell how many messages were dropped, now and then."""
        if now - self._drops_told_ns < _TELL_DROPS:
            return
        with self._door:
            dropped = dict(self.intake.dropped)
        if self._recorder.dropped:
            dropped[NOT_RECORDED] = self._recorder.dropped
        if dropped != self._drops:
            self._drops, self._drops_told_ns = dropped, now
            self._recorder.record(drops_key(self.fleet.name), drops_record(dropped), now)

    def _send(self, messages: list[Outgoing], now_ns: int) -> None:
        """Record and send; a new phase is in the log before a robot hears of it.

        Plans and a GO that no log holds are not sent: who goes on from it would not know of them.
        """
        for message in messages:
            self._recorder.record(message.key, message.payload, now_ns)
        if messages and self._phase != (self.fleet.epoch, self.fleet.phase):
            self._phase = (self.fleet.epoch, self.fleet.phase)
            is_logged = self._recorder.sync()
            self._withheld |= self.fleet.phase in (HOLD, GO) and not is_logged
        if self._withheld:
            return
        for message in messages:
            self._transport.put(message.key, message.payload)
