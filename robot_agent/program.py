"""A robot whose decisions another program makes: firmware in the loop.

The program stands in for the core.  It hears the bytes of messages and the measured pose on its
standard input and answers on its standard output, in the words of firmware/examples/host.c.  Link,
driver and black box are those of any agent.

Decides: how messages and poses become the program's lines, and its answers calls of driver and
link.  Must not decide what the robot does, nor what its messages say.
"""

from __future__ import annotations

import math
import os
import subprocess
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple, Self

from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Refusal
from protocol.phases import ARMED, DRIVER_ERROR, GO, IDLE, NO_FAULT, PHASE_NAMES, fault_name
from protocol.transport import Transport
from robot_agent.blackbox import BlackBox
from robot_agent.driver import Driver, DriverError, Pose
from robot_agent.loop import PERIOD_NS
from robot_agent.service import Robot

_WAITING: Final = 64
"""How many messages may wait for a tick; newer ones displace the oldest."""


class ProgramError(Exception):
    """Raised when the program cannot be started or gives no answer; the text is one line."""


class Told(NamedTuple):
    """What the program says of a tick, as in the line that begins with `tick`."""

    phase: int
    fault: int
    speed: float
    curvature: float
    distance: float
    turn: float
    place: float
    epoch: int
    revision: int
    holds: int
    leaves: bool
    reads: bool
    time_ns: int | None


def read_told(line: str) -> Told:
    """Return the content of a `tick` line; ValueError when it is none."""
    word, phase, fault, *rest = line.split()
    if word != "tick" or len(rest) < 11:
        raise ValueError(f"{line.strip()!r} is not a tick")
    speed, curvature, distance, turn, place = (float.fromhex(number) for number in rest[:5])
    epoch, revision, holds = (int(number) for number in rest[5:8])
    leaves, reads = (number == "1" for number in rest[8:10])
    time_ns = None if rest[10] == "-" else int(rest[10])
    return Told(
        int(phase), int(fault), speed, curvature, distance, turn, place,
        epoch, revision, holds, leaves, reads, time_ns,
    )  # fmt: skip


class Program:
    """The running program and the pipes to it; ends it when closed."""

    def __init__(self, path: Path) -> None:
        """Start the program at a path.  Raises ProgramError."""
        self._name = str(path)
        try:
            self._process = subprocess.Popen(
                [path.absolute()], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
        except OSError as error:
            raise ProgramError(f"{path}: {error.strerror}") from None
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._lines, self._answers = self._process.stdin, self._process.stdout

    def tell(self, line: str) -> None:
        """Hand the program an event; it comes with the next `ask`.  Raises ProgramError."""
        try:
            self._lines.write(line + "\n")
        except (OSError, ValueError):  # ValueError: it was closed because it had ended.
            raise self._ended() from None

    def ask(self, line: str) -> tuple[list[tuple[str, str]], Told]:
        """Hand the program a tick and return its answer: (word, rest) of each line, and the tick.

        Raises ProgramError when the program has ended or says something else.
        """
        said: list[tuple[str, str]] = []
        self.tell(line)
        try:
            self._lines.flush()
            for answer in self._answers:
                word, _, rest = answer.strip().partition(" ")
                if word == "tick":
                    return said, read_told(answer)
                said.append((word, rest))
        except OSError:
            raise self._ended() from None
        except ValueError as error:
            raise ProgramError(f"{self._name}: {error}") from None
        raise self._ended()

    def _ended(self) -> ProgramError:
        return ProgramError(f"{self._name} has ended, exit code {self.close()}")

    def close(self) -> int:
        """End the program and return its exit code."""
        with suppress(OSError):  # It may have ended before.
            self._lines.close()
        try:
            return self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()
        finally:
            self._answers.close()

    def __enter__(self) -> Self:
        """Return the program itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()


class ProgramService:
    """Stands where RobotService stands, with a program in place of the core.

    `refusal`: why the robot ends for good, in words.
    """

    def __init__(
        self,
        program: Program,
        robot: Robot,
        transport: Transport,
        driver: Driver,
        fleet: str | None,
        blackbox: BlackBox | None = None,
        boot: int | None = None,
        *,
        clock: Callable[[], int],
        host_clock: Callable[[], int] | None = None,
        period_ns: int = PERIOD_NS,
    ) -> None:
        self.robot = robot
        self.boot = int.from_bytes(os.urandom(4)) if boot is None else boot
        self.heard_ns = -(2**62)
        self.told = Told(IDLE, NO_FAULT, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, False, False, None)
        self.refusal: str | None = None
        self._program, self._transport, self._driver = program, transport, driver
        self._blackbox, self._clock, self._host_clock = blackbox, clock, host_clock or clock
        self._waiting: deque[tuple[str, str, bytes, int]] = deque(maxlen=_WAITING)
        self._error = ""
        accel = robot.max_accel if robot.max_accel < math.inf else 0.0
        sizes = (robot.radius, robot.max_speed, accel, robot.max_speed)
        numbers = " ".join(float(size).hex() for size in sizes)
        program.tell(f"robot {robot.id} {numbers} {self.boot} {period_ns}")
        self._fleet: str | None = None
        if fleet is not None:
            self._join(fleet)
        transport.subscribe(keys.command(fleet or "*"), self._enqueue)

    def tick(self, now_ns: int) -> bool:
        """Hear, measure, decide, drive and speak, as firmware/examples/loop.c does.

        Returns False at the end, which is also when the program has ended or makes no sense.
        """
        driver, host_ns = self._driver, self._host_clock()
        driver.step(now_ns)
        pose = driver.pose()
        if pose is None and self.told.phase > ARMED:
            raise DriverError("the base has lost its place")
        try:
            self._hear(now_ns)
            said, self.told = self._program.ask(f"tick {now_ns} {_in_hex(pose)}")
        except ProgramError as error:
            self.refusal = str(error)
            return False
        told = self.told
        for word, rest in said:
            if word == "start":
                x, y, heading = map(float.fromhex, rest.split())
                driver.place(x, y, heading)
        if told.turn:
            driver.turn(told.turn)
        else:
            driver.drive(told.speed, told.curvature, told.distance)
        for word, rest in said:
            if self._fleet is not None and word in ("hello", "clock", "report"):
                key = getattr(keys, word)(self._fleet, self.robot.id)
                self._transport.put(key, bytes.fromhex(rest))
        if self._blackbox is not None:
            place = (driver.true_pose(), told.place, told.phase)
            self._blackbox.write(host_ns, told.time_ns, *place)
        return self.refusal is None and not told.leaves

    def rescue(self, error: Exception, now_ns: int) -> None:
        """Tell the program that a tick has failed; its answer comes with the next one."""
        self._error = f"{type(error).__name__}: {error}"
        with suppress(ProgramError):  # The next tick finds out.
            self._program.tell(f"failed {now_ns}")

    def describe(self) -> str:
        """Return the robot's phase in words, and why it stopped if it did."""
        told = self.told
        text = PHASE_NAMES[told.phase]
        if told.fault != NO_FAULT:
            text += f", {fault_name(told.fault)}"
        return f"{text} ({self._error})" if told.fault == DRIVER_ERROR else text

    def waits_for(self, _now_ns: int) -> str:
        """Return in words what keeps the robot from being armed, as far as its shell knows."""
        return "hears no coordinator" if self._fleet is None else ""

    def _join(self, fleet: str) -> None:
        self._fleet, robot = fleet, self.robot.id
        for kind in (keys.plan, keys.clock):
            self._transport.subscribe(kind(fleet, robot), self._enqueue)
        self._transport.declare_alive(keys.alive(fleet, robot))

    def _enqueue(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        place = keys.split(key)
        if place is not None:
            self._waiting.append((place[0], place[1], payload, self._clock()))

    def _hear(self, now_ns: int) -> None:
        for _ in range(len(self._waiting)):
            fleet, kind, payload, heard_ns = self._waiting.popleft()
            message = decode(kind, payload)
            if self._fleet is None and isinstance(message, Command):
                self._join(fleet)
            if fleet != self._fleet:
                continue
            self._program.tell(f"{kind} {heard_ns if kind == 'clock' else now_ns} {payload.hex()}")
            if isinstance(message, Command):
                self._note(message, now_ns)
            elif isinstance(message, Refusal) and message.boot == self.boot:
                self.refusal = message.reason

    def _note(self, command: Command, now_ns: int) -> None:
        self.heard_ns = now_ns
        if self._blackbox is not None:
            self._blackbox.join(command.boot)
            if command.phase == GO:
                self._blackbox.begin(command.boot, command.start_ns)


def _in_hex(pose: Pose | None) -> str:
    return " ".join(float(number).hex() for number in pose or (math.nan, 0.0, 0.0))
