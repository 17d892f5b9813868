"""Make robot.json: what a robot hears and measures, and what it answers, in any language.

Run as `python -m tests.golden.make_robot`.  The events are scripted here; the answers are those of
the Python agent in double precision.  Each vector has:

- `about`: what happens, in words;
- `events`: one line each, in the words of firmware/examples/host.c: `robot ID RADIUS MAX_SPEED
  MAX_ACCEL SPEED_LIMIT BOOT PERIOD_NS`, `command|plan|clock NOW_NS HEX`, `tick NOW_NS X Y HEADING`,
  `failed NOW_NS`; numbers are hexadecimal floats, bytes hexadecimal;
- `sent`: [number of the tick, kind of key, bytes in hex] of each message that the robot sends;
- `states`: [number of the tick, phase, fault, speed, curvature, distance, turn, arc length, epoch,
  revision, holds], every tenth tick.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec

from protocol.codec import encode
from protocol.curve import Curve, clamped_knots
from protocol.messages import Clock, Command, Plan
from protocol.phases import FREEZE, GO, HOLD, STOP
from protocol.plan_bytes import pack_floats, pack_points, pack_profile, pack_stops
from protocol.timing import MILLISECOND, SECOND
from robot_agent.service import Robot
from tests.firmware.streams import ID, PERIOD_NS, SIZES, Robots, Tick, floats

VECTORS = Path(__file__).with_name("robot.json")
OFFSET_NS = 5 * SECOND
FUTURE = b"\xca\x3f\x80\x00\x00" + b"\x81\xa1k\x92\x01\xc0"
"""Two further fields: 1.0 as float32, and {"k": [1, None]}."""
BEND = [(1.0, 2.0), (1.2, 2.0), (1.4, 2.0), (1.6, 2.1), (1.7, 2.3), (1.7, 2.5)]
BACK = [(1.7, 2.5), (1.7, 2.7), (1.6, 2.9), (1.4, 3.0)]
LINE = [(1.0 + 0.2 * k, 2.0) for k in range(12)]
ASIDE = [*((1.45 + 0.15 * k, 2.0) for k in range(8)), (2.65, 2.05), (2.75, 2.2), (2.75, 2.4)]
"""It runs along LINE for 0.9 m from 0.45 m behind its beginning on, and leads off to the left."""


def plan(points: list[tuple[float, float]], revision: int = 0, begin_ms: int = 0) -> Plan:
    """Return a cubic course with a stop in its middle, driven at 0.5 m/s."""
    knots, length = _knots(points), curve_of(points).length
    profile = [(0.0, 0.0), (0.25, 0.5), (length - 0.25, 0.5), (length, 0.0)]
    stops = [(0.5 * length, begin_ms * MILLISECOND + 2 * SECOND)] if length > 1.0 else []
    speeds, packed = pack_profile(profile)
    return Plan(
        1, 7, ID, 3 + revision, revision, begin_ms, SECOND, 50, 500, 10, 3, pack_points(points),
        pack_floats(knots), b"", speeds, packed, pack_stops(stops),
    )  # fmt: skip


def curve_of(points: list[tuple[float, float]]) -> Curve:
    """Return the curve of a course with these control points."""
    flat = floats([value for point in points for value in point])
    knots = clamped_knots(3, _knots(points))
    return Curve(3, knots, flat[0::2], flat[1::2], [1.0] * len(points))


def _knots(points: list[tuple[float, float]]) -> list[float]:
    return [float(i + 1) for i in range(len(points) - 3)]


class Scene:
    """A coordinator that does what it is told, a base without errors, and a robot of one boot."""

    def __init__(self, begin_ns: int = SECOND) -> None:
        self.robots = Robots(Robot(ID, 0.15, 0.6, 0.5, SIZES), 42)
        self.now_ns, self.sequence, self.number = begin_ns, 0, 0
        self.phase, self.start_ns = HOLD, 0
        self.headroom_ms, self.extra = 1500, {}
        self.offset_ns, self.answers, self.speaks, self.slip = OFFSET_NS, True, True, 1.0
        self.newer = False
        self.robots.base.at = [*BEND[0], 0.0]

    def go(self) -> None:
        self.phase, self.start_ns = GO, self.now_ns + self.offset_ns + 100 * MILLISECOND

    def command(self, **changes: Any) -> Command:
        self.sequence += 1
        said_ns = self.now_ns + self.offset_ns
        command = Command(
            7, 1, self.sequence, 1, self.phase, self.start_ns, said_ns, self.headroom_ms, run=7
        )
        return msgspec.structs.replace(command, **{**self.extra, **changes})

    def send(self, kind: str, message: Any) -> None:
        payload = message if isinstance(message, bytes) else encode(message)
        if self.newer and kind != "plan":
            payload = bytes([payload[0] + 1]) + payload[1:] + FUTURE[:5]
        self.robots.hear(kind, payload)

    def tick(self) -> Tick:
        if self.speaks and self.number % 10 == 0:
            self.send("command", self.command())
        told = self.robots.tick(self.now_ns)
        for kind, payload in told.sent:
            if kind == "clock" and self.answers:
                asked = msgspec.msgpack.decode(payload, type=Clock)
                there = asked.sent_ns + self.offset_ns + 3 * MILLISECOND
                leads = self.extra.get("boot", 7)
                self.send("clock", Clock(asked.boot, asked.sent_ns, there, there, leads))
        speed, curvature, distance, turn = self.robots.base.told
        at = self.robots.base.at
        if at is not None:
            way = min(speed * PERIOD_NS / SECOND, distance) * self.slip
            half = 0.5 * way * curvature
            at[0] += way * math.cos(at[2] + half)
            at[1] += way * math.sin(at[2] + half)
            at[2] += 2.0 * half + turn
        self.now_ns += PERIOD_NS
        self.number += 1
        return told

    def ticks(self, count: int) -> None:
        for _ in range(count):
            self.tick()

    def armed(self, course: Plan | None = None) -> Scene:
        self.ticks(5)
        self.send("plan", course or plan(BEND))
        self.ticks(45)
        return self

    def driving(self, ticks: int) -> Scene:
        self.armed().go()
        self.ticks(ticks)
        return self


def arrives() -> Scene:
    """The robot arms, hears GO, stops in the middle of its course and arrives at its end."""
    scene = Scene().driving(450)
    scene.extra = {"wanted": (ID,)}
    scene.ticks(20)
    return scene


def authority() -> Scene:
    """Its authority ends on the way; the robot stands before that and goes on when it gets more."""
    scene = Scene().armed()
    scene.headroom_ms = 800
    scene.go()
    scene.ticks(40)
    scene.extra = {"held": ((1, 0), (3, 900)), "first": 0, "last": 9}
    scene.ticks(160)
    scene.extra = {"first": 4}  # Of another range: it says nothing to this robot.
    scene.ticks(40)
    scene.extra = {}
    scene.ticks(400)
    return scene


def stop() -> Scene:
    """STOP brakes the robot at once; it goes on with the next GO, whose start is later."""
    scene = Scene().driving(90)
    scene.phase = STOP
    scene.ticks(100)
    scene.phase, scene.start_ns = GO, scene.start_ns + SECOND
    scene.ticks(450)
    return scene


def freeze() -> Scene:
    """FREEZE stops the robot for the epoch; it says where it rests, and once more when asked."""
    scene = Scene().driving(90)
    scene.phase = FREEZE
    scene.ticks(80)
    scene.extra = {"wanted": ("R0", ID)}
    scene.ticks(20)
    scene.extra = {"epoch": 2}
    scene.phase = HOLD
    scene.ticks(60)
    return scene


def pushed() -> Scene:
    """Somebody pushes the robot off its path."""
    scene = Scene().driving(80)
    scene.robots.base.at[1] += 0.2  # type: ignore[index]
    scene.ticks(150)
    return scene


def driver_fails() -> Scene:
    """The base fails; the robot brakes along its path."""
    scene = Scene().driving(80)
    scene.robots.fail(scene.now_ns)
    scene.ticks(150)
    return scene


def late() -> Scene:
    """The wheels slip, so the robot is late and says so; then it catches up."""
    scene = Scene().driving(60)
    scene.slip = 0.3
    scene.ticks(80)
    scene.slip = 1.0
    scene.ticks(350)
    return scene


def clock_jumps() -> Scene:
    """The coordinator's clock jumps; the robot notices, asks anew and goes on."""
    scene = Scene().driving(80)
    scene.offset_ns += SECOND // 2
    scene.ticks(150)
    scene.offset_ns -= SECOND // 2
    scene.ticks(250)
    return scene


def strangers() -> Scene:
    """Answers of another coordinator, to no open question, twice or unsigned move no clock."""
    scene = Scene().armed()
    scene.go()
    scene.answers = False
    for _ in range(450):
        for kind, payload in scene.tick().sent:
            if kind == "clock":
                sent = msgspec.msgpack.decode(payload, type=Clock).sent_ns
                right, wrong = sent + scene.offset_ns, sent + scene.offset_ns + SECOND
                scene.send("clock", Clock(42, sent, wrong, wrong, 8))
                scene.send("clock", msgspec.msgpack.encode((5, 42, sent, wrong, wrong)))
                scene.send("clock", Clock(42, sent - 1, wrong, wrong, 7))
                scene.send("clock", Clock(42, sent, right, right, 7))
                scene.send("clock", Clock(42, sent, wrong, wrong, 7))
    return scene


def no_time() -> Scene:
    """Nobody answers about the time: after 3 s at its start the robot arms without it."""
    scene = Scene()
    scene.answers = False
    scene.armed().ticks(300)
    scene.go()
    scene.ticks(200)
    return scene


def silence() -> Scene:
    """A silent coordinator: the robot stands where its authority ends; at its goal, it leaves."""
    scene = Scene().driving(60)
    scene.speaks = False
    scene.ticks(240)
    scene.speaks = True
    scene.ticks(200)
    scene.speaks = False
    scene.ticks(1010)
    return scene


def redirected() -> Scene:
    """A newer course from the goal is sent twice, changed to where it begins, and driven."""
    scene = Scene().driving(200)
    newer = plan(BACK, 1, 6000)
    scene.send("plan", newer)
    scene.ticks(20)
    scene.send("plan", newer)
    scene.ticks(800)
    return scene


def in_motion() -> Scene:
    """A newer course that began 0.1 s ago and runs along the present one until 3.2 s.

    The robot changes to it without slowing down, once it has authority on it; a Command said too
    little of it before.
    """
    scene = Scene().armed(msgspec.structs.replace(plan(LINE), stops=b""))
    scene.go()
    scene.ticks(160)
    scene.extra = {"held": ((3, 3200), (4, 1500))}
    length = curve_of(ASIDE).length
    speeds, profile = pack_profile([(0.0, 0.5), (length - 0.25, 0.5), (length, 0.0)])
    moving = {"speeds": speeds, "profile": profile, "stops": b""}
    scene.send("plan", msgspec.structs.replace(plan(ASIDE, 1, 1400), **moving))
    scene.ticks(40)
    scene.extra = {"held": ((3, 3200), (4, 3200))}
    scene.ticks(20)
    scene.extra = {}
    scene.ticks(340)
    return scene


def malformed() -> Scene:
    """Messages that are not acceptable change nothing; those of a newer protocol are understood."""
    scene = Scene()
    scene.ticks(5)
    good = encode(plan(BEND))
    other = encode(msgspec.structs.replace(plan(BEND), robot="R2"))
    for payload in (good[:-1] + b"\x00", good[:-7], b"", b"\xc1", good + b"\x00", other):
        scene.send("plan", payload)
        scene.tick()
    scene.send("plan", good)
    scene.ticks(30)
    fields = msgspec.msgpack.decode(encode(scene.command()))
    for change in ({0: 9}, {5: 5}, {5: 1.0}, {1: -1}, {9: [[1]]}, {9: 3}, {12: ["?"]}, {4: None}):
        wrong = [change.get(i, field) for i, field in enumerate(fields)]
        scene.send("command", msgspec.msgpack.encode(wrong))
        scene.tick()
    scene.go()
    scene.speaks = False
    fields = msgspec.msgpack.decode(encode(scene.command()))
    longer = [*fields, {"a": [1, 2.5, None]}, b"xx", msgspec.msgpack.Ext(5, b"abc"), "later"]
    scene.send("command", msgspec.msgpack.encode(longer))
    scene.ticks(20)
    scene.send("command", b"\xdd\x00\x00\x00\x0e" + b"".join(map(_long, _next(scene))))
    scene.ticks(40)
    return scene


def newer() -> Scene:
    """A coordinator of a newer protocol: further fields in Plan, Command and Clock, and float32."""
    scene = Scene()
    scene.newer = True
    scene.ticks(5)
    known = msgspec.msgpack.decode(encode(plan(BEND)))[:-1]
    body = b"\xdc\x00\x15" + b"".join(map(msgspec.msgpack.encode, known)) + FUTURE
    scene.send("plan", body + b"\xce" + zlib.crc32(body).to_bytes(4, "big"))
    scene.ticks(45)
    scene.go()
    scene.ticks(60)
    return scene


def wrapping() -> Scene:
    """Sequences end at 2^32 - 1, and the next coordinator begins anew with a higher term."""
    scene = Scene(begin_ns=17 * 10**17)
    scene.sequence = 2**32 - 12
    scene.driving(60)
    scene.speaks = False
    scene.ticks(100)
    scene.speaks, scene.sequence, scene.extra = True, 0, {"term": 2, "boot": 8}
    scene.ticks(200)
    return scene


def _next(scene: Scene) -> list[Any]:
    return msgspec.msgpack.decode(encode(scene.command()))  # type: ignore[no-any-return]


def _long(value: Any) -> bytes:
    """Return msgpack with the longest head for an integer or an array."""
    if isinstance(value, int):
        return b"\xd3" + value.to_bytes(8, "big", signed=True)
    return b"\xdd" + len(value).to_bytes(4, "big") + b"".join(map(_long, value))


SCENES: tuple[Callable[[], Scene], ...] = (
    arrives, authority, stop, freeze, pushed, driver_fails, late, clock_jumps, strangers,
    no_time, silence, redirected, in_motion, malformed, newer, wrapping,
)  # fmt: skip


def told(ticks: list[Tick]) -> dict[str, Any]:
    """Return the answers of a vector: what is sent, and the state every tenth tick."""
    sent = [[i, kind, b.hex()] for i, tick in enumerate(ticks) for kind, b in tick.sent]
    return {"sent": sent, "states": [[i, *state(ticks[i])] for i in range(0, len(ticks), 10)]}


def state(tick: Tick) -> Iterator[int | str]:
    """Return phase, fault, five numbers as hexadecimal floats, epoch, revision, holds."""
    yield from (tick.phase, tick.fault)
    numbers = (tick.speed, tick.curvature, tick.distance, tick.turn, tick.place)
    yield from map(float.hex, numbers)
    yield from (tick.epoch, tick.revision, tick.holds)


def vectors() -> dict[str, Any]:
    """Return all vectors by name."""
    made = {}
    for scene in SCENES:
        stream = scene().robots.stream
        about = (scene.__doc__ or "").strip()
        events = {"about": about, "events": stream.lines}
        made[scene.__name__] = {**events, **told(stream.ticks)}
    return made


if __name__ == "__main__":
    VECTORS.write_text(json.dumps(vectors(), indent=0) + "\n")
