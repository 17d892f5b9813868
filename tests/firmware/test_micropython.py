"""The MicroPython robot, here in CPython: the same acts and bytes as robot_agent/ has."""

import random
import struct
import types
import zlib
from itertools import pairwise

import pytest

from firmware.micropython import messages
from firmware.micropython.bundle import bundle
from firmware.micropython.loop import run
from firmware.micropython.messages import read, written
from firmware.micropython.robot import Robot
from protocol.codec import decode, encode
from protocol.messages import Clock, Hello, Plan, Refusal, Report, Rest
from protocol.plan_parts import unpack_plan
from tests.firmware.micropython_replay import replay
from tests.firmware.record_robot import record_robot
from tests.golden import make_messages

HEARD = ("plan", "command", "clock")
GOLDEN = {name: kind for name, (kind, _) in make_messages.MESSAGES.items() if kind in HEARD}


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    path = tmp_path_factory.mktemp("record") / "record.txt"
    path.write_text("\n".join(record_robot()) + "\n")
    return path


def sealed(body: bytes) -> bytes:
    return struct.pack(">BI", 0xCE, zlib.crc32(body))


def of_bundle() -> type[Robot]:
    module = types.ModuleType("splinefleet_robot")
    exec(compile(bundle(), "splinefleet_robot.py", "exec"), vars(module))
    return module.Robot


@pytest.mark.parametrize("robot", [Robot, of_bundle()], ids=["modules", "bundle"])
def test_the_shell_does_and_says_to_the_last_bit_what_the_agent_does_in_all_exchanges(
    record, robot
):
    ticks = record.read_text().count("T ")
    assert ticks > 10_000
    assert replay(robot, record) == f"{ticks} ticks, 0 bytes"


@pytest.mark.parametrize("name", GOLDEN)
def test_golden_messages_are_read(name):
    fields = read(GOLDEN[name], make_messages.payload(name))
    known = make_messages.fields(name)
    assert fields[: len(known)] == known


@pytest.mark.parametrize("name", [name for name in GOLDEN if name.startswith("plan")])
def test_a_plan_has_the_same_numbers_as_for_the_agent(name):
    payload = make_messages.payload(name)
    plan = decode("plan", payload)
    assert isinstance(plan, Plan)
    assert messages.unpack_plan(read("plan", payload)) == tuple(unpack_plan(plan))


@pytest.mark.parametrize("name", GOLDEN)
def test_what_one_reader_drops_the_other_one_drops(name):
    dice = random.Random(name)
    whole, kind = make_messages.payload(name), GOLDEN[name]
    for _ in range(1_500):
        payload = bytearray(whole)
        for _ in range(dice.randrange(1, 4)):
            place = dice.randrange(len(payload))
            change = dice.choice(("flip", "cut", "put", "mark"))
            if change == "flip":
                payload[place] ^= 1 << dice.randrange(8)
            elif change == "cut":
                del payload[place : place + dice.randrange(1, 4)]
            elif change == "put":
                payload[place:place] = bytes([dice.randrange(256)])
            else:
                payload[place] = dice.randrange(0xC0, 0xE0)
            payload = payload or bytearray(b"\xc0")
        if name.startswith("plan") and dice.random() < 0.8:
            payload = payload[:-5] + sealed(bytes(payload[:-5]))
        there, here = decode(kind, bytes(payload)), read(kind, bytes(payload))
        assert (there is None) == (here is None), payload.hex()


def test_what_the_robot_says_is_written_as_the_codec_writes_it():
    dice = random.Random(1)
    for _ in range(2_000):
        big = [dice.randrange(2 ** dice.randrange(1, 33)) for _ in range(4)]
        stamp = dice.choice((None, -dice.randrange(2**31), dice.randrange(2**31)))
        rest = dice.choice((None, Rest(dice.random(), big[0], -dice.randrange(2**15), 5, -33, 1)))
        report = Report(*big[:3], 2, 1, rest, stamp, dice.randrange(65_536), big[3], 0)
        where = None if rest is None else (rest.s_m, rest.epoch, rest.off_mm, 5, -33, 1)
        said = (4, *big[:3], 2, 1, where, stamp, report.late, big[3], 0)
        assert written(said) == encode(report)
    hello = Hello(3, 7, 0.15, 0.5, 0.5, (1, -70_000, 3_141), 9, 64, 16, 1_600)
    said = (1, 3, 7, 0.15, 0.5, 0.5, (1, -70_000, 3_141), 9, 64, 16, 1_600)
    assert written(said) == encode(hello)
    assert written((5, 7, -(2**40), None, None, 0)) == encode(Clock(7, -(2**40)))


class Base:
    """A base that does nothing; its pose fails in some ticks."""

    def __init__(self, fails=()):
        self.calls, self.ticks, self.fails = [], 0, fails

    def pose(self):
        self.ticks += 1
        if self.ticks in self.fails:
            raise OSError("no pose")
        return 1.0, 2.0, 0.0

    def drive(self, *command):
        self.calls.append(command)

    def stop(self):
        self.calls.append("stop")


def test_the_loop_ticks_at_its_rate_and_ends_when_the_robot_is_refused():
    now = [0]
    base, times = Base(fails=(3,)), []
    robot = Robot("R1", lambda *_: None, 7)

    def sleep_us(left):
        times.append(now[0])
        now[0] += 1_000 * left
        if len(times) == 5:
            robot.hear("plan", encode(Refusal(7, "who are you")), now[0])

    def clock_ns():
        now[0] += 1_000_000
        return now[0]

    run(robot, base, clock_ns, sleep_us)
    assert robot.refusal == "who are you"
    assert base.calls == [(0.0, 0.0, 0.0)] * 2 + ["stop"] + [(0.0, 0.0, 0.0)] * 3 + ["stop"]
    assert {b - a for a, b in pairwise(times)} == {10_000_000}


def test_the_bundle_has_no_words_that_a_board_has_no_use_for():
    text = bundle()
    assert '"""' not in text
    assert "firmware" not in text
    assert len(text) < 60_000
