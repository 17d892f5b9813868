"""The robot's shell: the agent on a real link, with a real driver and a black box.

Decides: how messages become calls of the agent, and its results become messages.  Must not decide
what a robot does: agent.py does.  This is the only user of msgspec on the robot's side; firmware
has its own shell around the same core.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

from protocol import keys
from protocol.codec import encode
from protocol.messages import (
    PROTOCOL_VERSION,
    Clock,
    Command,
    Hello,
    Plan,
    Refusal,
    Report,
    Rest,
)
from protocol.phases import DONE, FREEZE, FROZEN, GO, HOLD, IDLE, PHASE_NAMES, STOP
from protocol.plan_parts import unpack_plan
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND
from protocol.transport import Transport
from robot_agent.blackbox import BlackBox
from robot_agent.core.agent import Agent
from robot_agent.core.ride import NOTHING
from robot_agent.driver import Driver, DriverError
from robot_agent.inbox import Inbox
from robot_agent.loop import PERIOD_NS, FixedRateLoop
from robot_agent.steady_clock import SteadyClock
from robot_agent.words import ANEW, Lasting, Trouble, phase_in_words, waits_for

_NOWHERE = (0.0, 0.0, 0.0)
_AT_REST = (DONE, FROZEN)

_SILENCE_NS = 5 * COMMAND_PERIOD
"""A coordinator from which nothing was received for this long counts as silent."""

_READINGS: Final = 5
"""How often two clocks are read until nothing came between the readings."""


class RefusedError(Exception):
    """Raised when the coordinator refuses this robot; the text is its reason.  Exit code 2."""


@dataclass(frozen=True)
class Robot:
    """Who the robot is and what it can do [m, m/s, m/s^2]; 0 means not stated.

    `holds`: the most control points, stops and bytes of a Plan that it can hold.
    """

    id: str
    radius: float = 0.0
    max_speed: float = 0.0
    max_accel: float = 0.0
    holds: tuple[int, int, int] = (0, 0, 0)


class Service(Protocol):
    """What `run_robot` runs tick by tick, as RobotService is."""

    refusal: str | None
    heard_ns: int

    def tick(self, now_ns: int) -> bool: ...  # noqa: D102
    def describe(self) -> str: ...  # noqa: D102
    def waits_for(self, now_ns: int) -> str: ...  # noqa: D102
    def rescue(self, error: Exception, now_ns: int) -> None: ...  # noqa: D102


def run_robot(
    robot: Robot,
    transport: Transport,
    driver: Driver,
    *,
    clock: Callable[[], int],
    sleep: Callable[[int], None],
    host_clock: Callable[[], int] | None = None,
    fleet: str | None = None,
    blackbox: Path | None = None,
    give_up_ns: int = 0,
    period_ns: int = PERIOD_NS,
    tell: Callable[[str], None] = lambda _: None,
    count: Callable[[str, FixedRateLoop], None] = lambda _state, _loop: None,
    serve: Callable[..., Service] | None = None,
) -> int:
    """Run one robot; return 0 when its fleet has ended, 130 when interrupted, 1 when it gave up.

    It gives up when it has heard no coordinator for `give_up_ns` (0: it never does); a robot under
    way has stopped long before.  Link, driver and black box are closed in every case.  `tell` is
    called with a sentence at every change of phase, and with what keeps an idle robot from arming.
    `count` is called with the phase and the loop at every change of phase, and once more when the
    loop has ended.

    `clock` returns the robot's own time [ns]; `sleep` waits for a number of ns of this time;
    `host_clock` returns the host's time, for the black box, where it differs from the robot's own.
    Without `fleet` the robot joins the first fleet that it hears.  `serve` makes what runs the
    robot tick by tick, a RobotService unless another one is given.  Raises RefusedError, and
    OSError when the black box cannot be written.
    """
    clock = SteadyClock(clock)
    with transport:
        box = BlackBox(blackbox) if blackbox is not None else None
        service = (serve or RobotService)(
            robot,
            transport,
            driver,
            fleet,
            box,
            clock=clock,
            host_clock=host_clock,
            period_ns=period_ns,
        )
        began = clock()
        told = PHASE_NAMES[IDLE]
        reason = Lasting()
        gave_up, silent_ns = False, 0

        def tick(now_ns: int) -> bool:
            nonlocal told, gave_up, silent_ns
            going = service.tick(now_ns)
            if (state := service.describe()) != told:
                told = state
                tell(f"{robot.id}: {state}")
                count(state, loop)
            if why := reason.hear(service.waits_for(now_ns), now_ns):
                tell(f"{robot.id}: {why}")
            silent_ns = now_ns - max(service.heard_ns, began)
            gave_up = going and 0 < give_up_ns < silent_ns
            return going and not gave_up

        rescues = (lambda _: driver.stop(), lambda error: service.rescue(error, clock()))
        loop = FixedRateLoop(tick, rescues, clock, sleep, period_ns)
        gc.collect()
        gc.freeze()  # What is there by now stays: to look through it takes longer than a tick.
        try:
            loop.run()
        except KeyboardInterrupt:
            return 130
        finally:
            driver.stop()
            if box is not None:
                box.close()
            count("end", loop)
    if service.refusal is not None:
        raise RefusedError(service.refusal)
    if gave_up:
        tell(f"{robot.id}: gave up, heard no coordinator for {give_up_ns / SECOND:g} s")
    return 1 if gave_up else 0


class RobotService:
    """Runs the robot tick by tick; `inbox` counts invalid messages and dropped ones.

    `clock` is the robot's own clock and stamps messages that arrive between ticks.  Without it
    messages count as arrived at the next tick, which makes the robot less certain of the
    coordinator's time.  `host_clock` stamps the black box; it is needed, with `clock`, if the
    robot's clock differs from the host's.
    """

    def __init__(
        self,
        robot: Robot,
        transport: Transport,
        driver: Driver,
        fleet: str | None,
        blackbox: BlackBox | None = None,
        boot: int | None = None,
        clock: Callable[[], int] | None = None,
        host_clock: Callable[[], int] | None = None,
        period_ns: int = PERIOD_NS,
    ) -> None:
        self.agent = Agent(robot.max_speed, period_ns)
        self.boot = int.from_bytes(os.urandom(4)) if boot is None else boot
        self.refusal: str | None = None
        self.inbox = Inbox(robot.id)
        self.last_error = ""
        self.heard_ns = self.quiet_until_ns = -(2**62)
        self._hellos = 0
        self._phase, self._arrived = HOLD, False
        self._is_asked, self._trouble = False, Trouble()
        self._run, self._other_run_ns = 0, -(2**62)
        """The run of the fleet that the robot has a part in, and when it heard another one."""

        self.robot = robot
        self._transport = transport
        self._driver = driver
        self._fleet: str | None = None
        self._clock = clock
        self._host_clock = host_clock
        self._blackbox = blackbox
        if fleet is not None:
            self._join(fleet)
        transport.subscribe(keys.command(fleet or "*"), self._enqueue)

    def tick(self, now_ns: int) -> bool:
        """Receive, read the pose, decide, drive, send, record; return False at the end."""
        if self.inbox.waits:
            self._hear(now_ns)
        self._move(now_ns)
        self._speak(now_ns)
        agent = self.agent
        if agent.phase in _AT_REST:
            self.quiet_until_ns = agent.quiet_until(now_ns)
        return self.refusal is None and not agent.finished

    def rest(self, now_ns: int) -> bool:
        """Take the place of `tick` for a robot whose base rests; False if `tick` has more to do.

        It hears what has arrived and reads the pose, but commands and records nothing.
        """
        agent = self.agent
        if self.inbox.waits:
            self._hear(now_ns)
            self.quiet_until_ns = agent.quiet_until(now_ns)
        if now_ns >= self.quiet_until_ns or not agent.skip(now_ns):
            return False
        pose = self._driver.pose()
        if pose is not None and not agent.stays(now_ns, *pose):
            self._speak(now_ns)
        return True

    def describe(self) -> str:
        """Return the robot's phase in words, and why it stopped if it did."""
        return phase_in_words(self.agent, self.last_error)

    def waits_for(self, now_ns: int) -> str:
        """Return in words what keeps the robot from being armed; empty when nothing does.

        Of a robot under way: what keeps it from driving on, and then that this has ended.  Of one
        that has a part in a run: that it hears a coordinator of another one in place of its own.
        """
        heard = now_ns - self.heard_ns < _SILENCE_NS
        if self.agent.phase != IDLE:
            self._arrived = self.agent.phase == DONE
            if not heard and now_ns - self._other_run_ns < _SILENCE_NS:
                return ANEW
            return self._trouble.hear(self.agent, heard, self._phase == STOP, now_ns)
        self._trouble.forget()
        pose = self._driver.pose()
        name, arrived = self.robot.id, self._arrived
        return waits_for(self.agent, name, self._fleet, self._phase, heard, pose, arrived)

    def coordinator_time(self, now_ns: int) -> int | None:
        """Return the robot's estimate of the coordinator's time [ns]; None while it has none."""
        sync = self.agent.clock
        return now_ns + sync.offset_ns if sync.good else None

    def rescue(self, error: Exception, now_ns: int) -> None:
        """Report to the agent and the coordinator that a tick has failed."""
        self.last_error = f"{type(error).__name__}: {error}"
        self.agent.hear_driver_error(now_ns)
        self._speak(now_ns)

    def _join(self, fleet: str) -> None:
        self._fleet = fleet
        for kind in (keys.plan, keys.clock):
            self._transport.subscribe(kind(fleet, self.robot.id), self._enqueue)
        self._transport.declare_alive(keys.alive(fleet, self.robot.id))

    def _enqueue(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        self.inbox.put(key, payload, self._clock() if self._clock else None)

    def _hear(self, now_ns: int) -> None:
        while (heard := self.inbox.take()) is not None:
            fleet, message, heard_ns = heard
            if isinstance(message, Command) and self._fleet in (None, fleet):
                self._hear_command(fleet, message, now_ns)
            elif isinstance(message, Plan):
                self._hear_plan(message)
            elif isinstance(message, Refusal) and message.boot == self.boot:
                self.refusal = message.reason
            elif isinstance(message, Clock) and message.boot == self.boot:
                self._hear_clock(message, now_ns if heard_ns is None else heard_ns)

    def _hear_command(self, fleet: str, command: Command, now_ns: int) -> None:
        if self._fleet is None:
            self._join(fleet)
        agent = self.agent
        authority = coming = command.authority_of(agent.number)
        if agent.next_number != agent.number:
            coming = command.authority_of(agent.next_number)
        counts = agent.hear_command(
            command.boot,
            command.term,
            command.sequence,
            command.epoch,
            command.phase,
            command.start_ns,
            command.said_ns,
            NOTHING if authority is None else authority,
            self.robot.id in command.wanted,
            now_ns,
            command.run,
            NOTHING if coming is None else coming,
        )
        if not counts:
            if command.run != self._run:
                self._other_run_ns = now_ns
            return
        self.heard_ns, self._phase, self._run = now_ns, command.phase, command.run
        self._is_asked = self.robot.id in command.wanted
        if self._blackbox is not None:
            self._blackbox.join(command.boot)
            if command.phase == GO:
                self._blackbox.begin(command.boot, command.start_ns)

    def _hear_plan(self, plan: Plan) -> None:
        which = (plan.boot, plan.epoch, plan.number, plan.revision)
        self.agent.hear_plan(*which, *unpack_plan(plan))

    def _hear_clock(self, answer: Clock, heard_ns: int) -> None:
        if answer.received_ns is not None and answer.answered_ns is not None:
            stamps = (answer.sent_ns, answer.received_ns, answer.answered_ns)
            self.agent.hear_clock(answer.coordinator, *stamps, heard_ns)

    def _move(self, now_ns: int) -> None:
        agent, driver = self.agent, self._driver
        driver.step(now_ns)
        pose = driver.pose()
        if pose is None and agent.has_driven():
            raise DriverError("the base has lost its place")
        if pose is None and agent.ride is not None:
            pose = agent.ride.follower.start_pose()
            driver.place(*pose)
        x, y, heading = pose or _NOWHERE
        agent.tick(now_ns, x, y, heading)
        if agent.drive_turn:
            driver.turn(agent.drive_turn)
        else:
            driver.drive(agent.drive_speed, agent.drive_curvature, agent.drive_distance)
        if self._blackbox is not None:
            s = agent.ride.follower.s if agent.ride is not None else 0.0
            host_ns, estimate_ns = now_ns + self._host_ahead_ns(), self.coordinator_time(now_ns)
            self._blackbox.write(host_ns, estimate_ns, driver.true_pose(), s, agent.phase)

    def _host_ahead_ns(self) -> int:
        """Return how far the host's clock is ahead of the robot's own [ns].

        A program that loses the processor between two readings takes them again.
        """
        clock, host_clock, ahead_ns = self._clock, self._host_clock, 0
        if clock is None or host_clock is None:
            return ahead_ns
        for _ in range(_READINGS):
            before_ns, host_ns, after_ns = clock(), host_clock(), clock()
            ahead_ns = host_ns - after_ns
            if after_ns - before_ns < MILLISECOND:
                break
        return ahead_ns

    def _place(self) -> tuple[int, int, int] | None:
        """Return the pose, if it is asked for or the fleet is frozen, and the robot never drove."""
        pose, may_tell = self._driver.pose(), self._is_asked or self._phase == FREEZE
        if pose is None or not may_tell or self.agent.has_driven():
            return None
        x, y, heading = (round(1000.0 * number) for number in pose)
        return x, y, heading

    def _rest(self) -> Rest | None:
        agent = self.agent
        if agent.report_s is None:
            return None
        rest = agent.rest
        return Rest(agent.report_s, rest.epoch, rest.off, rest.turn, rest.beyond, rest.revision)

    def _speak(self, now_ns: int) -> None:
        if self._fleet is None:
            return
        agent, fleet, robot = self.agent, self._fleet, self.robot
        if agent.hello_due(now_ns):
            accel = robot.max_accel if robot.max_accel < float("inf") else 0.0
            limits = (robot.radius, robot.max_speed, accel)
            self._hellos += 1
            place = self._place()
            said = (*limits, place, self._hellos, *robot.holds)
            hello = Hello(PROTOCOL_VERSION, self.boot, *said)
            self._transport.put(keys.hello(fleet, robot.id), encode(hello))
        asked_ns = self._clock() if self._clock else now_ns
        if agent.clock_due(asked_ns):
            self._transport.put(keys.clock(fleet, robot.id), encode(Clock(self.boot, asked_ns)))
        if agent.report_due(now_ns):
            report = Report(
                self.boot,
                agent.report_sequence,
                agent.epoch,
                agent.phase,
                agent.fault,
                self._rest(),
                None if agent.report_stamp_ms == NOTHING else agent.report_stamp_ms,
                agent.report_late,
                agent.revision,
                agent.holds,
            )
            self._transport.put(keys.report(fleet, robot.id), encode(report))
