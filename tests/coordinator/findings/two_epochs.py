"""A log of two robots and two epochs: R2 is lost in the first, R1 arrives in the second."""

import math

from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import address, pack
from coordinator.planning.planner import plan_scenario
from protocol import keys, phases
from protocol.codec import decode, encode
from protocol.curve import Curve
from protocol.messages import Command, Hello, Report, Rest
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline
from tests.scenarios import a_robot, a_scenario, box

SECOND = 1_000_000_000
WALL = 1_700_000_000 * SECOND
BEGIN = 50 * SECOND

CROSS = a_scenario(
    [a_robot("R1", (1.0, 4.0), (9.0, 4.0)), a_robot("R2", (5.0, 1.0), (5.0, 7.0))],
    obstacles=[box(1.0, 1.0, 2.0, 2.0), ((7, 1), (9, 1), (9, 3), (8.9, 3), (8.9, 1.1), (7, 1.1))],
)
GO_1, FREEZE_1, GO_2 = 1.0, 4.0, 7.0


class RobotsOwn:
    """A robot's own curve and time-table, made of the bytes that it gets."""

    def __init__(self, document, robot):
        payload = pack(document, robot, 0)
        parts = unpack_plan(decode("plan", payload))
        self.curve, self.line = Curve(*parts.path), Timeline(*parts.motion)
        self.rate = decode("plan", payload).brake_mmps2 / 1000.0

    def at(self, t):
        s = self.line.s_at(t)
        self.curve.place(s)
        c = self.curve
        return c.x, c.y, math.atan2(c.dy, c.dx), s, self.line.v_at(t)

    def rest(self, t):
        """Arc length of the rest and how long it takes, of a robot that brakes at a time."""
        s, v = self.line.s_at(t), self.line.v_at(t)
        return s + v * v / (2.0 * self.rate), v / self.rate


def first_plan():
    return plan_scenario(CROSS, effort=0)


def second_plan(document):
    """The plan of epoch 2, from where R1 rests; R2 is lost."""
    own = RobotsOwn(document, document.robot("R1"))
    own.curve.place(own.rest(FREEZE_1 - GO_1)[0])
    start = (own.curve.x, own.curve.y)
    robot = a_robot("R1", start, (9.0, 4.0))
    return plan_scenario(
        a_scenario([robot], obstacles=CROSS.workspace.obstacles), effort=0, epoch=2
    )


def records(document, second, rest):
    """What went by in two epochs: R2 is killed at 3.5 s, the fleet freezes half a second later."""
    command, number = keys.command("test"), iter(range(1000))

    def say(epoch, phase, start=0.0):
        start_ns = BEGIN + round(start * SECOND) if start else 0
        return encode(Command(9, 1, next(number), epoch, phase, start_ns, start_ns))

    yield 0.0, command, say(1, phases.HOLD)
    for index, robot in enumerate(document.robots):
        yield 0.1, keys.hello("test", robot.id), encode(Hello(2, 5, 0.2))
        yield 0.2, keys.plan("test", robot.id), address(pack(document, robot, index), 9)
    yield 0.5, command, say(1, phases.GO, GO_1)
    for i in range(5):
        yield 1.5 + 0.5 * i, keys.report("test", "R2"), encode(Report(5, i, 1, phases.MOVING))
    yield FREEZE_1, command, say(1, phases.FREEZE, GO_1)
    stopped = Report(5, 9, 1, phases.FROZEN, 0, Rest(rest, 1))
    yield 5.5, keys.report("test", "R1"), encode(stopped)
    yield 6.0, command, say(2, phases.HOLD)
    yield 6.1, keys.plan("test", "R1"), address(pack(second, second.robots[0], 0), 9)
    yield 6.5, command, say(2, phases.GO, GO_2)
    yield 30.0, keys.report("test", "R1"), encode(Report(5, 10, 2, phases.DONE))
    yield 30.1, command, say(2, phases.OVER)


def log_of(path, document, second, *, attached=True):
    plans = [document, second] if attached else []
    attachments = [
        Attachment(f"plan-{plan.epoch}.json", "application/json", to_json(plan)) for plan in plans
    ]
    own = RobotsOwn(document, document.robot("R1"))
    with Recorder(
        path, metadata={"fleet": "test"}, wall_offset_ns=WALL, attachments=attachments
    ) as log:
        for t, key, payload in records(document, second, own.rest(FREEZE_1 - GO_1)[0]):
            log.record(key, payload, BEGIN + round(t * SECOND))
    return path
