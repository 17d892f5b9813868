"""The shell of a MicroPython robot: bytes to the core, and its decisions to bytes.

Decides: how messages become calls of the core, and its results messages.  It takes the place of
robot_agent/service.py, and sends the same bytes for the same messages and poses.  Must not know:
links, and how a base is moved.
"""

from collections.abc import Callable

from firmware.micropython.messages import CLOCK, COMMAND, PLAN, REFUSAL, read, unpack_plan, written
from protocol.phases import FREEZE, HOLD
from robot_agent.core.agent import Agent
from robot_agent.core.ride import NOTHING

MOST_WAITING = 16
VERSION = 3


class Robot:
    """A robot of a fleet.

    `put(kind, payload)` sends bytes on the robot's key of a kind: hello, report or clock.  `limits`
    are radius [m], greatest speed [m/s] and acceleration [m/s^2]; 0.0: not stated.  `holds`: the
    most control points, stops and bytes of a Plan.  `boot`: 32 random bits.  `refusal` is the
    reason why the coordinator refuses the robot, or None.

    After `tick`, `agent` tells what to command to the base: drive_turn if it is not 0, else
    drive_speed, drive_curvature and drive_distance.
    """

    def __init__(
        self,
        name: str,
        put: Callable[[str, bytes], None],
        boot: int,
        limits: tuple[float, float, float] = (0.0, 0.0, 0.0),
        holds: tuple[int, int, int] = (0, 0, 0),
        period_ns: int = 10_000_000,
    ) -> None:
        self.agent = Agent(limits[1], period_ns)
        self.refusal = None
        self.bad = 0
        self._name, self._put, self._boot = name, put, boot
        self._limits, self._holds = limits, holds
        self._hellos = 0
        self._phase, self._is_asked = HOLD, False
        self._waiting = []

    def hear(self, kind: str, payload: bytes, now_ns: int) -> None:
        """Take in what came on a key of a kind: plan, command or clock; acted on in the next tick.

        Not to be called from an interrupt, because it allocates.
        """
        fields = read(kind, payload)
        if fields is None or (fields[0] == PLAN and fields[3] != self._name):
            self.bad += 1
            return
        if len(self._waiting) == MOST_WAITING:
            del self._waiting[0]
        self._waiting.append((fields, now_ns))

    def tick(self, now_ns: int, x: float, y: float, heading: float) -> bool:
        """Let the robot at this pose [m, m, rad] decide and speak; False when it may end."""
        while self._waiting:
            fields, heard_ns = self._waiting.pop(0)
            self._act_on(fields, heard_ns, now_ns)
        self.agent.tick(now_ns, x, y, heading)
        self._speak(now_ns, x, y, heading)
        return self.refusal is None and not self.agent.finished

    def _act_on(self, fields: list, heard_ns: int, now_ns: int) -> None:
        tag = fields[0]
        if tag == COMMAND:
            self._obey(fields, now_ns)
        elif tag == PLAN:
            rules, path, motion = unpack_plan(fields)
            self.agent.hear_plan(fields[2], fields[1], fields[4], fields[5], rules, path, motion)
        elif tag == CLOCK and fields[1] == self._boot and None not in fields[3:5]:
            self.agent.hear_clock(fields[5], fields[2], fields[3], fields[4], heard_ns)
        elif tag == REFUSAL and fields[1] == self._boot:
            self.refusal = fields[2]

    def _obey(self, fields: list, now_ns: int) -> None:
        agent = self.agent
        counts = agent.hear_command(
            fields[1],
            fields[2],
            fields[3],
            fields[4],
            fields[5],
            fields[6],
            fields[7],
            _authority_of(fields, agent.number),
            self._name in fields[12],
            now_ns,
            fields[13],
            _authority_of(fields, agent.next_number),
        )
        if counts:
            self._phase, self._is_asked = fields[5], self._name in fields[12]

    def _speak(self, now_ns: int, x: float, y: float, heading: float) -> None:
        agent, boot = self.agent, self._boot
        if agent.hello_due(now_ns):
            place = None
            if (self._is_asked or self._phase == FREEZE) and not agent.has_driven():
                place = [round(1000.0 * number) for number in (x, y, heading)]
            self._hellos += 1
            limits = (1, VERSION, boot) + self._limits
            self._put("hello", written(limits + (place, self._hellos) + self._holds))
        if agent.clock_due(now_ns):
            self._put("clock", written((CLOCK, boot, now_ns, None, None, 0)))
        if agent.report_due(now_ns):
            rest = None
            if agent.report_s is not None:
                where = agent.rest
                rest = (
                    agent.report_s, where.epoch, where.off, where.turn, where.beyond, where.revision
                )  # fmt: skip
            stamp = None if agent.report_stamp_ms == NOTHING else agent.report_stamp_ms
            said = (4, boot, agent.report_sequence, agent.epoch, agent.phase, agent.fault, rest)
            self._put(
                "report", written(said + (stamp, agent.report_late, agent.revision, agent.holds))
            )


def _authority_of(fields: list, number: int) -> int:
    """Return the plan time [ms] that a Command grants on a course, or NOTHING."""
    if not fields[10] <= number <= fields[11]:
        return NOTHING
    for held, time_ms in fields[9]:
        if held == number:
            return time_ms
    return (fields[7] - fields[6]) // 1_000_000 + fields[8]
