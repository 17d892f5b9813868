"""Fuzz targets for bytes from the wire: the codec, the fleet core, the robot's shell."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Final

from benchmarks.fuzz.target import Target
from benchmarks.table import ROOT
from coordinator.mission.fleet_from_plan import muster
from coordinator.plan.wire import packed
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from protocol import keys
from protocol.codec import KINDS, SEAL_BYTES, decode, encode
from protocol.messages import Clock, Command, Plan, Report
from protocol.phases import GO, HOLD, STOP
from protocol.plan_parts import unpack_plan
from robot_agent.service import Robot, RobotService
from sim.world.body import SimulatedBody
from sim.world.memory_transport import MemoryNetwork

_KINDS: Final = tuple(KINDS)
_KEYS: Final = (keys.hello, keys.plan, keys.report, keys.clock, keys.admit, keys.alive)
_PERIOD_NS: Final = 10_000_000
_BEGAN_NS: Final = 1_000_000_000
_BOOT: Final = 7


def codec(data: bytes) -> None:
    """Decode a message of the kind that the first byte names; it must survive encoding."""
    if not data:
        return
    kind = _KINDS[data[0] % len(_KINDS)]
    message = decode(kind, data[1:])
    if message is None and kind == "plan":
        message = decode(kind, _sealed(data[1:])) or decode(kind, _sealed(data[1:-SEAL_BYTES]))
    if message is None:
        return
    again = decode(kind, encode(message))
    assert again == message, f"{message} became {again}"
    if isinstance(message, Plan):
        unpack_plan(message)
    elif isinstance(message, Command):
        for number in (0, message.first, message.last):
            message.authority_of(number)


def _sealed(body: bytes) -> bytes:
    """Return bytes followed by the seal that fits them, as a Plan's are."""
    return body + b"\xce" + zlib.crc32(body).to_bytes(SEAL_BYTES - 1)


def codec_seeds() -> Iterator[bytes]:
    """Return the golden messages."""
    for kind, payload in _golden():
        yield bytes([_KINDS.index(kind)]) + payload


class _Halls:
    """A fleet core and a robot's shell that live as long as the process."""

    def __init__(self) -> None:
        document = plan_scenario(read_scenario(ROOT / "examples" / "paper_five.toml"))
        self.document = document
        self.network = MemoryNetwork()
        self.link = self.network.session("coordinator")
        self.session = self.network.session("robot")
        self.begin()

    def begin(self) -> None:
        """Begin anew, so that an input's effect does not depend on earlier inputs."""
        self.fleet = muster(packed(self.document), _BOOT)
        self.robot = self.document.robots[0].id
        self.session.end(0)
        self.session = self.network.session("robot")
        name = self.document.scenario
        self.service = RobotService(
            Robot(self.robot), self.session, SimulatedBody(), name, boot=_BOOT
        )


_halls: list[_Halls] = []


def _hall() -> _Halls:
    if not _halls:
        _halls.append(_Halls())
    _halls[0].begin()
    return _halls[0]


def pieces(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Cut an input into messages: a byte for the key, two for the length, the payload."""
    place = 0
    while place + 3 <= len(data):
        length = int.from_bytes(data[place + 1 : place + 3], "little")
        yield data[place], data[place + 3 : place + 3 + length]
        place += 3 + length


def fleet(data: bytes) -> None:
    """Give the fleet core messages on any of its keys, and let time pass in between."""
    hall = _hall()
    name, now_ns = hall.document.scenario, _BEGAN_NS
    robots = [robot.id for robot in hall.document.robots]
    for which, payload in pieces(data):
        kind, whose = _KEYS[which % 6], robots[which // 6 % len(robots)]
        key = keys.command(name) if which >= 240 else kind(name, whose)
        now_ns += which * 1_000_000
        hall.fleet.hear(key, payload, now_ns)
        hall.fleet.tick(now_ns)


def robot(data: bytes) -> None:
    """Give a robot's shell messages on its keys, and let it tick in between."""
    hall = _hall()
    name, now_ns = hall.document.scenario, _BEGAN_NS
    for which, payload in pieces(data):
        kind = (keys.plan, keys.clock)[which % 2]
        key = keys.command(name) if which % 3 == 0 else kind(name, hall.robot)
        hall.link.put(key, payload)
        now_ns += _PERIOD_NS
        hall.network.advance(hall.network.now_ns + _PERIOD_NS)
        hall.service.tick(now_ns)


def _golden() -> Iterator[tuple[str, bytes]]:
    text = (ROOT / "tests" / "golden" / "messages.txt").read_text()
    for line in text.splitlines():
        _, kind, payload = line.split()
        yield kind, bytes.fromhex(payload)


def _piece(which: int, payload: bytes) -> bytes:
    return bytes([which]) + len(payload).to_bytes(2, "little") + payload


def spoken() -> Iterator[bytes]:
    """Yield inputs: golden messages one after the other, and a fleet that sets out."""
    yield b"".join(_piece(number * 7 % 256, text) for number, (_, text) in enumerate(_golden()))
    reports = (Report(_BOOT, n, 1, phase) for n, phase in enumerate((0, 1, 2, 3, 4, 5)))
    yield b"".join(_piece(2, encode(report)) for report in reports)
    hall = _hall()
    plan = hall.fleet.members[hall.robot].plan
    states = ((HOLD, 0), (GO, _BEGAN_NS), (STOP, _BEGAN_NS), (GO, 2 * _BEGAN_NS))
    commands = [
        (0, encode(Command(_BOOT, 1, n + 1, 1, phase, start_ns, _BEGAN_NS, 10_000, ((1, 500),))))
        for n, (phase, start_ns) in enumerate(states)
    ]
    asked = (_BEGAN_NS + n * _PERIOD_NS for n in range(3, 11))
    said = [
        commands[0],
        (2, plan),
        *((1, encode(Clock(_BOOT, now_ns, now_ns, now_ns, _BOOT))) for now_ns in asked),
        *commands[1:],
    ]
    yield b"".join(_piece(which, payload) for which, payload in said)


TARGETS: Final = {
    "codec": Target(codec, codec_seeds, 4_200),
    "fleet": Target(fleet, spoken, 4_200),
    "robot": Target(robot, spoken, 4_200),
}
