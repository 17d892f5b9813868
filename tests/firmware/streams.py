"""Seeded streams of events for a robot, and what the Python agent makes of them.

A stream is a coordinator, a base and a link that behave well and badly by turns.  It drives the
Python agent, shell included, and notes every event in the words of firmware/examples/host.c and
everything that the agent answers, so that another core can be held against it.
"""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, field
from typing import Any

import msgspec

from protocol.codec import encode
from protocol.curve import Curve, clamped_knots
from protocol.messages import Clock, Command, Plan
from protocol.phases import DONE, FREEZE, FROZEN, GO, HOLD, MOVING, OVER, STOP
from protocol.plan_bytes import pack_floats, pack_points, pack_profile, pack_stops
from protocol.timeline import Timeline
from protocol.timing import MILLISECOND, SECOND
from robot_agent.program import read_told
from robot_agent.service import Robot, RobotService

PERIOD_NS = 10 * MILLISECOND
ID = "R1"
SIZES = (450, 300, 4000)


@dataclass(frozen=True)
class Tick:
    """What a robot does after a tick; `sent`: (kind, bytes) of its messages."""

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
    sent: tuple[tuple[str, bytes], ...]
    reads: bool = False
    """Whether it is still reading a Plan; the Python agent reads one at once."""


@dataclass
class Stream:
    """The events, one line each, and the answers to its ticks."""

    lines: list[str] = field(default_factory=list)
    ticks: list[Tick] = field(default_factory=list)


def read_answers(text: str) -> list[Tick]:
    """Return the ticks that the host program told."""
    ticks, sent = [], []
    for line in text.splitlines():
        word, *rest = line.split()
        if word == "tick":
            told = read_told(line)
            ticks.append(Tick(*told[:11], tuple(sent), told.reads))
            sent = []
        elif word != "start":
            sent.append((word, bytes.fromhex(rest[0])))
    return ticks


class _Base:
    """A base that goes where it is told, more or less; it is its own driver."""

    def __init__(self) -> None:
        self.at: list[float] | None = None
        self.seen: tuple[float, float, float] | None = None

    def step(self, now_ns: int) -> None:
        pass

    def pose(self) -> tuple[float, float, float] | None:
        if self.at is None or self.seen is not None:
            return self.seen
        return self.at[0], self.at[1], self.at[2]

    true_pose = pose

    def place(self, x: float, y: float, heading: float) -> None:
        self.at = [x, y, heading]

    def drive(self, speed_mps: float, curvature_radpm: float, distance_m: float) -> None:
        self.told = (speed_mps, curvature_radpm, distance_m, 0.0)

    def turn(self, angle_rad: float) -> None:
        self.told = (0.0, 0.0, 0.0, angle_rad)

    def stop(self) -> None:
        self.told = (0.0, 0.0, 0.0, 0.0)


class _Link:
    def __init__(self) -> None:
        self.sent: list[tuple[str, bytes]] = []

    def subscribe(self, _key: str, _hear: Any) -> None:
        pass

    def declare_alive(self, _key: str) -> None:
        pass

    def put(self, key: str, payload: bytes) -> None:
        self.sent.append((key.split("/")[2], payload))


class Robots:
    """The Python agent in its shell, noting what happens to it as a stream."""

    def __init__(self, robot: Robot, boot: int) -> None:
        self.stream, self.base, self._link = Stream(), _Base(), _Link()
        self.service = RobotService(robot, self._link, self.base, "f", boot=boot)  # type: ignore[arg-type]
        self._pose = (math.nan, 0.0, 0.0)
        self._waiting: list[tuple[str, bytes]] = []
        self._inner_tick = self.service.agent.tick
        self.service.agent.tick = self._tick  # type: ignore[method-assign]
        sizes = (robot.radius, robot.max_speed, robot.max_accel, robot.max_speed)
        numbers = " ".join(size.hex() for size in sizes)
        self._note(f"robot {robot.id} {numbers} {boot} {PERIOD_NS}")

    def _note(self, line: str) -> None:
        self.stream.lines.append(line)

    def _tick(self, now_ns: int, x: float, y: float, heading: float) -> None:
        known = self.base.at is not None
        self._pose = (x if known else math.nan, y, heading)
        self._inner_tick(now_ns, x, y, heading)

    def hear(self, kind: str, payload: bytes) -> None:
        """Let a message arrive; the robot processes it at its next tick."""
        key = "splinefleet/f/command" if kind == "command" else f"splinefleet/f/{kind}/{ID}"
        self.service.inbox.put(key, payload, None)
        self._waiting.append((kind, payload))

    def tick(self, now_ns: int) -> Tick:
        agent = self.service.agent
        for kind, payload in self._waiting:
            self._note(f"{kind} {now_ns} {payload.hex()}")
        self._waiting.clear()
        leaves = not self.service.tick(now_ns)
        sent = tuple(self._link.sent)
        self._link.sent.clear()
        self._note(f"tick {now_ns} {' '.join(number.hex() for number in self._pose)}")
        told = Tick(
            agent.phase, agent.fault, agent.drive_speed, agent.drive_curvature,
            agent.drive_distance, agent.drive_turn,
            agent.ride.follower.s if agent.ride is not None else 0.0,
            agent.epoch, agent.revision, agent.holds, leaves, sent,
        )  # fmt: skip
        self.stream.ticks.append(told)
        return told

    def fail(self, now_ns: int) -> None:
        self.service.agent.hear_driver_error(now_ns)
        self._note(f"failed {now_ns}")


def floats(values: list[float]) -> list[float]:
    """Return numbers as float32 holds them."""
    return list(memoryview(pack_floats(values)).cast("B").cast("f"))


@dataclass(frozen=True)
class Course:
    """A Plan with what the coordinator of a stream has to know about it."""

    plan: Plan
    curve: Curve
    timeline: Timeline


def make_plan(
    rng: random.Random,
    epoch: int,
    revision: int,
    begin_ms: int,
    pose: tuple[float, float, float],
    speed: float = 0.0,
    cubic: bool = False,
    repeats: bool = False,
    tight: bool = False,
) -> Course:
    """Return a random course from a pose; with `speed` it begins in motion, straight ahead.

    With `repeats` some knots come several times, and some control points twice.  If it is `tight`,
    it turns sharply between points that are near to each other.
    """
    degree = rng.choice([3, 3, 3, 3, 3, 1, 2, 4, 5, 7]) if speed == 0.0 and not cubic else 3
    count = rng.randint(degree + 1, 40)
    (x, y, heading), bend = pose, 0.0
    points, step = [(x, y)], rng.uniform(0.1, 0.5)
    for i in range(1, count):
        x, y = x + step * math.cos(heading), y + step * math.sin(heading)
        again = repeats and i > 2 and rng.random() < 0.15
        points.append(points[-1] if again else (x, y))
        if i > degree:
            bend = max(min(bend + rng.uniform(-0.3, 0.3), 0.4), -0.4)
            heading += bend if degree > 1 else 0.0
            if tight and rng.random() < 0.4:
                heading += rng.uniform(-2.6, 2.6)
                step = rng.uniform(0.004, 0.1)
    spans = count - degree
    knots, knot = [], 0.0
    for _ in range(spans):
        inner = 0 < len(knots) < spans - 2 and knots.count(knot) < degree
        if not (repeats and inner and rng.random() < 0.35):
            knot += rng.choice([1.0, 1.0, 1.0, rng.uniform(0.3, 2.0)])
        knots.append(knot)
    weights = [] if cubic or rng.random() < 0.7 else [rng.uniform(0.5, 2.0) for _ in points]
    packed = pack_points(points)
    flat = floats([value for point in points for value in point])
    path = (
        degree,
        clamped_knots(degree, floats(knots)),
        flat[0::2],
        flat[1::2],
        floats(weights) or [1.0] * count,
    )
    curve = Curve(*path)
    brake = rng.choice([0, 500, 500, 1000])
    profile, stops = _motion(rng, curve.length, begin_ms, brake, speed)
    speeds, packed_profile = pack_profile(profile)
    plan = Plan(
        epoch, 7, ID, 3, revision, begin_ms, SECOND, rng.choice([20, 50, 100]), brake, 10,
        degree, packed, pack_floats(knots), pack_floats(weights), speeds, packed_profile,
        pack_stops(stops),
    )  # fmt: skip
    full = sorted(profile + [(s, 0.0) for s, _ in stops if s > 0.0]) if brake else profile
    timeline = Timeline(
        floats([s for s, _ in full]),
        floats([v for _, v in full]),
        floats([s for s, _ in stops]),
        [depart / SECOND for _, depart in stops],
        begin_ms / 1000.0,
    )
    return Course(plan, curve, timeline)


def _motion(
    rng: random.Random, length: float, begin_ms: int, brake: int, speed: float
) -> tuple[list[tuple[float, float]], list[tuple[float, int]]]:
    cruise = speed or rng.uniform(0.2, 0.6)
    first = 0.0 if speed == 0.0 and brake else cruise
    last = 0.0 if brake else cruise
    ramp = min(0.3, length / 8)
    inner = [(ramp, cruise), (0.45 * length, cruise), (length - ramp, cruise)]
    profile = [(0.0, first), *inner, (length, last)]
    stops, depart_ns = [], begin_ms * MILLISECOND
    if speed == 0.0 and rng.random() < 0.5:
        depart_ns += rng.randint(0, 2 * SECOND)
        stops.append((0.0, depart_ns))
    for share in (0.3, 0.6):
        if rng.random() < 0.4:
            depart_ns += rng.randint(0, 6 * SECOND)
            stops.append((share * length, depart_ns))
    return profile, stops


class Trial:
    """A coordinator, a link and a base around one robot, by a seed.

    `trouble`: the share of events that are not as they should be.  `courses`: whether the robot is
    sent newer courses on its way.  `cubic`: whether all are cubic without weights, as the planner's
    are.  `repeats`: whether knots and control points repeat.  `tight`: whether courses turn
    sharply, and wheels are stuck for moments.  `absurd`: whether the coordinator's clock jumps by
    centuries.  `go_after`: how many ticks pass before GO.
    """

    def __init__(
        self,
        seed: int,
        trouble: float = 1.0,
        *,
        courses: bool = True,
        cubic: bool = False,
        repeats: bool = False,
        tight: bool = False,
        absurd: bool = False,
        go_after: int = 60,
    ) -> None:
        self.rng, self.courses, self.trouble = random.Random(seed), courses, trouble
        self.shape = cubic, repeats, tight
        self.absurd = absurd
        self.go_after = go_after
        rng = self.rng
        robot = Robot(ID, 0.2, rng.choice([0.0, 0.6, 0.8]), rng.choice([0.0, 0.5]), SIZES)
        self.robots = Robots(robot, rng.randint(0, 2**32 - 1))
        self.now_ns = rng.choice([0, 10**9, 10**15, 17 * 10**17]) + rng.randint(0, 10**9)
        self.offset_ns = rng.randint(-(10**12), 10**12)
        self.term, self.boot, self.sequence, self.epoch, self.run = 1, 7, 0, 1, 7
        self.phase, self.start_ns = HOLD, 0
        self.course: Course | None = None
        self.revision = 0
        self.pose = (rng.uniform(-5, 5), rng.uniform(-5, 5), rng.uniform(-3, 3))
        self.slip, self.stuck_until_ns = 1.0, 0
        self.headroom_ms, self.mute_until_ns = 1500, 0
        self.old: list[tuple[str, bytes]] = []

    def _luck(self, share: float) -> bool:
        return self.rng.random() < share * self.trouble

    def stream(self, ticks: int) -> Stream:
        """Return the stream of so many ticks."""
        for tick in range(ticks):
            self._tick(tick)
        return self.robots.stream

    def _tick(self, tick: int) -> None:
        rng, robots = self.rng, self.robots
        agent = robots.service.agent
        self.now_ns += PERIOD_NS
        if self._luck(0.003):
            self.now_ns += rng.randint(0, 200 * MILLISECOND)
        self._jump()
        if tick == 20 and self.course is None:
            self._send_plan()
        if tick % 10 == 0:
            self._lead(tick)
        if self._luck(0.005) and self.old:
            robots.hear(*rng.choice(self.old))
        if self._luck(0.0005):
            robots.fail(self.now_ns)
        base = robots.base
        if agent.ride is not None and base.at is not None and self._luck(0.0005):
            base.seen = rng.choice([(base.at[0], math.nan, 0.0), (1e12, *base.at[1:])])
        told = robots.tick(self.now_ns)
        base.seen = None
        for kind, payload in told.sent:
            if kind == "clock" and self.now_ns > self.mute_until_ns and not self._luck(0.1):
                self._answer(payload)
            if kind == "hello" and tick > 20 and rng.random() < 0.3:
                self._send_plan()
        self._move()
        if self.courses and agent.phase in (MOVING, DONE, FROZEN) and rng.random() < 0.01:
            self._send_course()

    def _jump(self) -> None:
        rng = self.rng
        if self._luck(0.001):
            self.offset_ns += rng.randint(-(10**9), 10**9)
        if self.absurd and rng.random() < 0.02:
            ends = [sign * 2**power + rng.choice([0, 5]) for sign in (-1, 1) for power in (61, 62)]
            self.offset_ns = rng.choice(ends) - self.now_ns
            self.start_ns = rng.choice([*ends, self.now_ns + self.offset_ns])

    def _hear(self, kind: str, payload: bytes) -> None:
        if self._luck(0.02):
            payload = self._damaged(payload)
        self.old = [*self.old[-20:], (kind, payload)]
        self.robots.hear(kind, payload)

    def _damaged(self, payload: bytes) -> bytes:
        rng, changed = self.rng, bytearray(payload)
        for _ in range(rng.randint(1, 3)):
            changed[rng.randrange(len(changed))] = rng.randrange(256)
        return bytes(changed[: rng.randint(1, len(changed))] if rng.random() < 0.3 else changed)

    def _answer(self, payload: bytes) -> None:
        asked = msgspec.msgpack.decode(payload, type=Clock)
        delay = self.rng.randint(0, 8 * MILLISECOND if not self._luck(0.1) else 50 * MILLISECOND)
        there = asked.sent_ns + self.offset_ns + delay
        boot = self.boot if not self._luck(0.05) else 3
        self._hear("clock", encode(Clock(asked.boot, asked.sent_ns, there, there + 10_000, boot)))

    def _send_plan(self) -> None:
        base = self.robots.base
        pose = self.pose if base.at is None else tuple(base.at)
        self.pose = pose  # type: ignore[assignment]
        if self.course is None or self.course.plan.epoch != self.epoch or self._luck(0.2):
            self.course = make_plan(  # type: ignore[arg-type]
                self.rng, self.epoch, 0, 0, pose, 0.0, *self.shape
            )
            if self._luck(0.3):
                base.at = [
                    pose[0] + self.rng.gauss(0, 0.01), pose[1] + self.rng.gauss(0, 0.01),
                    pose[2] + self.rng.gauss(0, 0.3),
                ]  # fmt: skip
        self.revision = 0
        plan = msgspec.structs.replace(self.course.plan, boot=self.boot)
        self._hear("plan", encode(plan))

    def _send_course(self) -> None:
        """A newer course: from a stop, from the goal, in motion, or where the robot stands.

        One that it began in motion is sent again at times, with another number: it is the same.
        """
        agent, base, course = self.robots.service.agent, self.robots.base, self.course
        if course is None or agent._coming is not None or base.at is None:
            return
        if agent.revision != course.plan.revision or agent.epoch != course.plan.epoch:
            return
        if course.timeline.v_at(course.plan.begin_ms / 1000.0) > 0.0 and self.rng.random() < 0.5:
            self.revision = max(self.revision, agent.holds) + 1
            plan = msgspec.structs.replace(course.plan, revision=self.revision)
            self.course = Course(plan, course.curve, course.timeline)
            self._hear("plan", encode(msgspec.structs.replace(plan, boot=self.boot, number=5)))
            return
        now = (self.now_ns + self.offset_ns - self.start_ns) / SECOND
        begin, speed = now + self.rng.uniform(-0.5, 4.0), 0.0
        stop = course.timeline.next_stop(now)
        if agent.phase == FROZEN:
            pose = (base.at[0], base.at[1], base.at[2])
        else:
            if agent.phase == DONE or self.rng.random() < 0.2:
                begin = max(begin, course.timeline.finish)
            elif stop is not None and self.rng.random() < 0.5:
                begin = stop[1]
            begin = round(begin, 3)
            speed = course.timeline.v_at(begin)
            course.curve.place(course.timeline.s_at(begin))
            heading = math.atan2(course.curve.dy, course.curve.dx)
            pose = (course.curve.x, course.curve.y, heading)
        if not -900_000 < begin < 900_000:
            return
        self.revision = max(self.revision, agent.holds) + 1
        begin_ms = round(1000 * begin)
        following = make_plan(
            self.rng, self.epoch, self.revision, begin_ms, pose, speed, *self.shape
        )
        message = msgspec.structs.replace(following.plan, boot=self.boot, number=4)
        self._hear("plan", encode(message))
        self.course = following

    def _lead(self, tick: int) -> None:
        rng = self.rng
        if self._luck(0.01):
            self.mute_until_ns = self.now_ns + rng.randint(0, 4 * SECOND)
        if self.now_ns < self.mute_until_ns:
            return
        if self.phase == HOLD and tick > self.go_after and rng.random() < 0.3:
            self.phase = GO
            self.start_ns = self.now_ns + self.offset_ns + rng.randint(0, SECOND)
        elif self._luck(0.004):
            self.phase = rng.choice([STOP, FREEZE, GO, GO, HOLD, OVER])
        elif self.phase != GO and self.phase != HOLD and rng.random() < 0.05:
            self._another_epoch() if self.phase in (FREEZE, OVER) else None
            self.phase = HOLD if self.phase in (FREEZE, OVER) else GO
        if self._luck(0.002):
            self._another_epoch()
        if self._luck(0.002):
            self.term += rng.randint(0, 1)
            self.boot, self.sequence = rng.randint(1, 99), 0
            self.run = self.run if rng.random() < 0.5 else self.boot
        if self._luck(0.05):
            self.headroom_ms = rng.choice([0, 300, 800, 1500, 5000])
        self.sequence += 1 if not self._luck(0.02) else -1
        said_ns = self.now_ns + self.offset_ns - rng.randint(0, 5 * MILLISECOND)
        if self._luck(0.002):
            said_ns += SECOND
        held: tuple[tuple[int, int], ...] = ()
        if self._luck(0.2):
            time_ms = (said_ns - self.start_ns) // MILLISECOND - rng.randint(0, 2000)
            held = ((1, 5), (rng.choice([3, 4, 5]), max(min(time_ms, 2**31 - 1), -(2**31))))
        wanted = (ID,) if rng.random() < 0.05 else ()
        command = Command(
            self.boot, self.term, max(self.sequence, 0), self.epoch, self.phase, self.start_ns,
            said_ns, self.headroom_ms, held, 0, 2**32 - 1 if not self._luck(0.05) else 3,
            wanted, self.run,
        )  # fmt: skip
        self._hear("command", encode(command))

    def _another_epoch(self) -> None:
        self.epoch += 1
        self.phase, self.course = HOLD, None

    def _move(self) -> None:
        """Let the base do what it was told, with noise, slip, shoves and being stuck."""
        base, rng = self.robots.base, self.rng
        if base.at is None:
            return
        if self._luck(0.001):
            self.slip = rng.uniform(0.5, 1.1)
        if self._luck(0.001):
            self.stuck_until_ns = self.now_ns + rng.randint(0, 3 * SECOND)
        if self.shape[2] and rng.random() < 0.05:
            self.stuck_until_ns = self.now_ns + rng.randint(0, SECOND // 4)
        if self.now_ns < self.stuck_until_ns:
            return
        speed, curvature, distance, turn = base.told
        way = min(speed * PERIOD_NS / SECOND, distance) * self.slip
        half = 0.5 * way * curvature
        base.at[0] += way * math.cos(base.at[2] + half)
        base.at[1] += way * math.sin(base.at[2] + half)
        base.at[2] += 2.0 * half + max(min(turn, 0.02), -0.02)
        if way > 0.0 and rng.random() < 0.5:
            base.at[0] += rng.gauss(0.0, 0.0003)
            base.at[1] += rng.gauss(0.0, 0.0003)
        if self._luck(0.0005):
            base.at[0] += rng.gauss(0.0, 0.05)


def play(lines: list[str]) -> list[Tick]:
    """Return what the Python agent answers to the events of a stream."""
    _, name, *numbers = lines[0].split()
    radius, speed, accel = map(float.fromhex, numbers[:3])
    robots = Robots(Robot(name, radius, speed, accel, SIZES), int(numbers[4]))
    for line in lines[1:]:
        word, now, *rest = line.split()
        if word == "tick":
            x, y, heading = map(float.fromhex, rest)
            robots.base.at = None if math.isnan(x) else [x, y, heading]
            robots.tick(int(now))
        elif word == "failed":
            robots.fail(int(now))
        else:
            robots.hear(word, bytes.fromhex("".join(rest)))
    return robots.stream.ticks
