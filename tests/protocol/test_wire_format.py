"""The bytes themselves: golden, short enough, packed as robots expect."""

import msgspec
import pytest

from protocol import codec, plan_bytes
from protocol.messages import (
    MAX_MESSAGE_BYTES,
    MOST_HELD,
    MOST_NAMED,
    Admit,
    Clock,
    Command,
    Hello,
    NewTimes,
    Pace,
    Plan,
    Refusal,
    Report,
    Rest,
)
from tests.golden import make_messages

TYPES = {
    1: Hello,
    2: Plan,
    3: Command,
    4: Report,
    5: Clock,
    6: Refusal,
    7: Admit,
    8: NewTimes,
    9: Pace,
}
GOLDEN = [line.split() for line in make_messages.FILE.read_text().splitlines()]


def a_plan(points=12, knots=9, profile=13, stops=3, levels=8):
    speeds, speed_knots = plan_bytes.pack_profile(
        [(0.2 * i, 0.1 * (i % levels)) for i in range(profile)]
    )
    return codec.seal(
        Plan(
            epoch=1,
            boot=2**32 - 1,
            robot="robot-07",
            tau_ns=1_500_000_000,
            track_mm=25,
            brake_mmps2=500,
            degree=3,
            points=plan_bytes.pack_floats([0.1 * i for i in range(2 * points)]),
            knots=plan_bytes.pack_floats([1.3 * i for i in range(knots)]),
            weights=b"",
            speeds=speeds,
            profile=speed_knots,
            stops=plan_bytes.pack_stops([(1.1 * i, i * 10**10) for i in range(stops)]),
            checksum=0,
        )
    )


def frozen(field):
    """Lists as tuples, those inside as well."""
    return tuple(map(frozen, field)) if isinstance(field, list) else field


@pytest.mark.parametrize(("name", "kind", "text"), GOLDEN, ids=[row[0] for row in GOLDEN])
def test_the_golden_bytes_are_what_the_codec_writes_and_reads(name, kind, text):
    tag, *fields = make_messages.fields(name)
    if tag == 4 and fields[5] is not None:
        fields[5] = Rest(*fields[5])
    message = TYPES[tag](*map(frozen, fields))
    assert codec.encode(message).hex() == text
    assert codec.decode(kind, bytes.fromhex(text)) == message


def test_the_golden_file_is_what_its_script_makes_and_holds_every_message():
    assert make_messages.FILE.read_text() == make_messages.text()
    assert {row[0] for _, row in make_messages.MESSAGES.values()} == set(TYPES)


def test_a_message_too_long_for_a_robot_is_refused_at_the_sender_with_both_numbers():
    longest = a_plan(points=440)
    with pytest.raises(plan_bytes.OversizeError) as caught:
        codec.encode(msgspec.structs.replace(longest, profile=bytes(1_000)))
    spoken = str(caught.value)
    real = len(msgspec.msgpack.encode(longest)) - len(longest.profile) + 1_000 + 1
    assert f"{real} bytes" in spoken
    assert str(MAX_MESSAGE_BYTES) in spoken
    assert "robot-07" in spoken


def test_a_plan_with_12_control_points_and_3_stops_is_at_most_350_bytes_long():
    # 12 control points bend three times at most; three bends, three stops and both ends need no
    # more than 22 speed knots beside the stops, and 5 speeds where each gap reaches the top.
    assert len(codec.encode(a_plan(points=12, knots=9, profile=22, stops=3, levels=5))) <= 350


def test_a_command_that_names_as_many_robots_as_it_may_is_not_too_long():
    names = [f"{number:032}" for number in range(MOST_NAMED)]
    held = tuple((name, -(2**31)) for name in names[:MOST_HELD])
    largest = 2**32 - 1
    command = Command(
        largest, largest, largest, 3, 2**62, tuple(names[MOST_HELD:]), 2**62, -(2**31), held
    )
    assert len(codec.encode(command)) <= MAX_MESSAGE_BYTES


def test_a_report_on_the_move_is_at_most_22_bytes_long():
    for boot, sequence, epoch in [(0, 0, 0), (2**32 - 1, 2**16 - 1, 127)]:
        report = Report(boot, sequence, epoch, phase=5, fault=7, stamp_ms=10**7, late=65_535)
        assert len(codec.encode(report)) <= 22


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
