"""The bytes themselves: golden, short enough, packed as robots expect."""

import re
from pathlib import Path

import msgspec
import pytest

from protocol import codec, plan_bytes
from protocol.messages import (
    MAX_MESSAGE_BYTES,
    MOST_HELD,
    MOST_NUMBER,
    MOST_WANTED,
    Admit,
    Block,
    Cancel,
    Clock,
    Command,
    Hello,
    Join,
    Leave,
    Order,
    OrderState,
    Plan,
    Refusal,
    Report,
    Rest,
    Tell,
    Unblock,
)
from protocol.phases import GO
from protocol.timing import COMMAND_PERIOD, SECOND
from tests.golden import make_messages

TYPES = {
    1: Hello,
    2: Plan,
    3: Command,
    4: Report,
    5: Clock,
    6: Refusal,
    7: Admit,
    10: Order,
    11: Cancel,
    12: Tell,
    13: OrderState,
    14: Block,
    15: Unblock,
    16: Join,
    17: Leave,
}
PAGE = Path(__file__).resolve().parents[2] / "docs" / "protocol.md"
REST = ("s_m", "epoch", "off_mm", "turn_mrad", "beyond_mm", "revision")
GOLDEN = [line.split() for line in make_messages.FILE.read_text().splitlines()]


def a_plan(points=12, knots=9, profile=13, stops=3, levels=8):
    speeds, speed_knots = plan_bytes.pack_profile(
        [(0.2 * i, 0.1 * (i % levels)) for i in range(profile)]
    )
    return Plan(
        epoch=1,
        boot=2**32 - 1,
        robot="robot-07",
        number=7,
        revision=0,
        begin_ms=0,
        tau_ns=1_500_000_000,
        track_mm=25,
        brake_mmps2=500,
        clock_ms=10,
        degree=3,
        points=plan_bytes.pack_floats([0.1 * i for i in range(2 * points)]),
        knots=plan_bytes.pack_floats([1.3 * i for i in range(knots)]),
        weights=b"",
        speeds=speeds,
        profile=speed_knots,
        stops=plan_bytes.pack_stops([(1.1 * i, i * 10**10) for i in range(stops)]),
    )


def frozen(field):
    """Lists as tuples, those inside as well."""
    return tuple(map(frozen, field)) if isinstance(field, list) else field


@pytest.mark.parametrize(("name", "kind", "text"), GOLDEN, ids=[row[0] for row in GOLDEN])
def test_the_golden_bytes_are_what_the_codec_writes_and_reads(name, kind, text):
    tag, *values = make_messages.fields(name)
    names = make_messages.FIELDS[tag].split()
    fields = dict(zip(names, map(frozen, values), strict=True))
    if fields.get("rest"):
        fields["rest"] = Rest(**dict(zip(REST, fields["rest"], strict=True)))
    message = TYPES[tag](**fields)
    assert codec.encode(message).hex() == text
    assert codec.decode(kind, bytes.fromhex(text)) == message


def test_the_golden_file_is_what_its_script_makes_and_holds_every_message():
    assert make_messages.FILE.read_text() == make_messages.text()
    assert {row[0] for _, row in make_messages.MESSAGES.values()} == set(TYPES)


@pytest.mark.parametrize("tag", TYPES)
def test_the_page_on_the_protocol_names_the_fields_of_every_message_in_their_order(tag):
    start = f"| {TYPES[tag].__name__} | {tag} |"
    (row,) = [line for line in PAGE.read_text().splitlines() if line.startswith(start)]
    cell, count = row.split("|")[-2], 1
    while count:
        cell, count = re.subn(r"\([^()]*\)|\[[^\[\]]*\]", "", cell)
    names = [field.split(":")[0].strip() for field in cell.split(",")]
    assert names == make_messages.FIELDS[tag].split()


def test_a_message_too_long_for_a_robot_is_refused_at_the_sender_with_both_numbers():
    plan = msgspec.structs.replace(a_plan(points=440), profile=bytes(1_000))
    with pytest.raises(plan_bytes.OversizeError) as caught:
        codec.encode(plan)
    spoken = str(caught.value)
    assert f"{len(msgspec.msgpack.encode(plan)) + codec.SEAL_BYTES} bytes" in spoken
    assert str(MAX_MESSAGE_BYTES) in spoken
    assert "robot-07" in spoken


def test_the_seal_counts_for_the_length_of_a_plan():
    long = msgspec.structs.replace(a_plan(), points=bytes(3_200), knots=bytes(256))
    room = MAX_MESSAGE_BYTES - len(msgspec.msgpack.encode(long)) - codec.SEAL_BYTES
    fits = msgspec.structs.replace(long, knots=long.knots + bytes(room))
    assert len(codec.encode(fits)) == MAX_MESSAGE_BYTES
    longer = msgspec.structs.replace(fits, knots=fits.knots + b"\0")
    assert len(msgspec.msgpack.encode(longer)) < MAX_MESSAGE_BYTES
    with pytest.raises(plan_bytes.OversizeError):
        codec.encode(longer)


def test_a_plan_with_12_control_points_and_3_stops_is_at_most_350_bytes_long():
    # 12 control points bend three times at most; three bends, three stops and both ends need no
    # more than 22 speed knots beside the stops, and 5 speeds where each gap reaches the top.
    assert len(codec.encode(a_plan(points=12, knots=9, profile=22, stops=3, levels=5))) <= 350


def test_a_command_that_names_as_many_robots_as_it_may_is_not_too_long():
    names = tuple(f"{number:032}" for number in range(MOST_WANTED))
    held = tuple((MOST_NUMBER - i, -(2**31)) for i in range(MOST_HELD))
    command = Command(
        *[2**32 - 1] * 4,
        phase=4,
        start_ns=-(2**62),
        said_ns=-(2**62),
        headroom_ms=-(2**31),
        held=held,
        first=MOST_NUMBER,
        last=MOST_NUMBER,
        wanted=names,
    )
    payload = codec.encode(command)
    assert len(payload) <= MAX_MESSAGE_BYTES
    assert codec.decode("command", payload) == command


def test_commands_for_a_thousand_robots_on_time_cost_less_than_1000_bytes_a_second():
    command = Command(*[2**32 - 1] * 4, GO, 2**62, 2**62, headroom_ms=10**5, last=999)
    assert all(command.authority_of(number) == 10**5 for number in range(1_000))
    assert len(codec.encode(command)) * (SECOND // COMMAND_PERIOD) < 1_000


def test_a_report_on_the_move_is_at_most_24_bytes_long():
    for boot, sequence, epoch in [(0, 0, 0), (2**32 - 1, 2**16 - 1, 127)]:
        most = {"stamp_ms": 10**7, "late": 65_535, "revision": 127, "holds": 127}
        report = Report(boot, sequence, epoch, phase=5, fault=7, **most)
        assert len(codec.encode(report)) <= 24


def test_packed_numbers_come_back_as_float32():
    numbers = [0.0, -1.5, 3.0e38, 2.0**-149]
    assert plan_bytes.unpack_floats(plan_bytes.pack_floats(numbers)) == pytest.approx(
        numbers, rel=1e-7
    )
    assert plan_bytes.pack_floats([1.0]) == b"\x00\x00\x80\x3f"
    knots = [(0.0, 0.0), (0.5, 0.25), (1.5, 0.25), (2.0, 0.0)]
    speeds, profile = plan_bytes.pack_profile(knots)
    assert (len(speeds), len(profile)) == (8, 20)
    assert plan_bytes.unpack_profile(speeds, profile) == knots
    stops = [(0.5, -1), (2.0, 2**62)]
    assert plan_bytes.unpack_stops(plan_bytes.pack_stops(stops)) == stops


def test_packing_and_unpacking_refuse_what_does_not_fit():
    with pytest.raises(OverflowError):
        plan_bytes.pack_floats([1e39])
    with pytest.raises(ValueError, match="5 bytes"):
        plan_bytes.unpack_floats(bytes(5))
    with pytest.raises(ValueError, match="1 speeds"):
        plan_bytes.unpack_profile(bytes(4), b"\0\0\0\0\1")
    with pytest.raises(plan_bytes.OversizeError, match="257 different speeds"):
        plan_bytes.pack_profile([(float(i), float(i)) for i in range(257)])
    with pytest.raises(ValueError, match="13 bytes"):
        plan_bytes.unpack_stops(bytes(13))
