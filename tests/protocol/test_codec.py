import math
import struct
import zlib

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol import codec, plan_bytes
from protocol.messages import (
    MAX_MESSAGE_BYTES,
    MOST_HELD,
    MOST_WANTED,
    PROTOCOL_VERSION,
    Admit,
    Clock,
    Command,
    Hello,
    Plan,
    Refusal,
    Report,
    Rest,
)
from protocol.phases import GO
from tests.golden import make_messages
from tests.protocol.test_wire_format import a_plan

QUICK = settings(derandomize=True, max_examples=60, database=None, deadline=None)
GOLDEN = [line.split() for line in make_messages.FILE.read_text().splitlines()]

counters = st.integers(0, 2**32 - 1)
names = st.from_regex(r"[A-Za-z0-9_.-]{1,32}", fullmatch=True)
times = st.integers(-(2**62), 2**62)
durations = st.integers(0, 10**12)
numbers = st.integers(0, 65_535)
plan_times = st.integers(-(2**31), 2**31 - 1)
amounts = st.floats(0.0, allow_infinity=False)


def packed(most, multiple=1):
    numbers = st.floats(width=32, allow_nan=False, allow_infinity=False)
    lists = st.integers(0, most).flatmap(
        lambda n: st.lists(numbers, min_size=n * multiple, max_size=n * multiple)
    )
    return lists.map(plan_bytes.pack_floats)


offsets = st.integers(-32_768, 32_767)
plans = st.builds(
    Plan,
    epoch=counters,
    boot=counters,
    robot=names,
    number=numbers,
    revision=counters,
    begin_ms=plan_times,
    tau_ns=durations,
    track_mm=st.integers(0, 65_535),
    brake_mmps2=counters,
    clock_ms=st.integers(1, 65_535),
    degree=st.integers(1, 7),
    points=packed(8, 2),
    knots=packed(8),
    weights=packed(8),
    speeds=packed(4).filter(bool),
    profile=st.lists(
        st.floats(0.0, 100.0, width=32).map(lambda s: struct.pack("<fB", s, 0)), max_size=4
    ).map(b"".join),
    stops=st.lists(
        st.tuples(st.floats(0.0, 100.0, width=32), st.integers(-(2**63), 2**63 - 1)), max_size=4
    ).map(plan_bytes.pack_stops),
)

messages = st.one_of(
    st.tuples(
        st.just("hello"),
        st.builds(
            Hello,
            st.integers(0, 255),
            counters,
            amounts,
            amounts,
            amounts,
            st.none() | st.tuples(*3 * [plan_times]),
            counters,
            numbers,
            numbers,
            numbers,
        ),
    ),
    st.tuples(st.just("plan"), plans),
    st.tuples(st.just("plan"), st.builds(Refusal, counters, st.text(max_size=200))),
    st.tuples(
        st.just("command"),
        st.builds(
            Command,
            counters,
            counters,
            counters,
            counters,
            st.integers(0, 4),
            times,
            times,
            plan_times,
            st.lists(st.tuples(numbers, plan_times), max_size=5).map(tuple),
            numbers,
            numbers,
            st.lists(names, max_size=5).map(tuple),
        ),
    ),
    st.tuples(
        st.just("report"),
        st.builds(
            Report,
            counters,
            counters,
            counters,
            st.integers(0, 5),
            st.integers(0, 7),
            st.none() | st.builds(Rest, amounts, counters, offsets, offsets, offsets),
            st.none() | plan_times,
            numbers,
            counters,
        ),
    ),
    st.tuples(st.just("admit"), st.builds(Admit, counters)),
    st.tuples(
        st.just("clock"),
        st.builds(Clock, counters, times, st.none() | times, st.none() | times, counters),
    ),
)


def raw(*fields):
    return msgspec.msgpack.encode(fields)


def with_seal(body):
    """Return bytes whose array counts one element more already, followed by their seal."""
    return body + struct.pack(">BI", 0xCE, zlib.crc32(body))


@QUICK
@given(messages)
def test_every_message_comes_back_as_it_was_sent(sent):
    kind, message = sent
    assert codec.decode(kind, codec.encode(message)) == message


@QUICK
@given(messages, st.data())
def test_a_truncated_message_is_dropped(sent, data):
    kind, message = sent
    payload = codec.encode(message)
    assert codec.decode(kind, payload[: data.draw(st.integers(0, len(payload) - 1))]) is None


@QUICK
@given(messages)
def test_bytes_after_the_message_make_it_unacceptable(sent):
    kind, message = sent
    assert codec.decode(kind, codec.encode(message) + b"\0") is None


@QUICK
@given(messages, st.data())
def test_bytes_flipped_on_the_way_never_raise(sent, data):
    kind, message = sent
    payload = bytearray(codec.encode(message))
    for _ in range(data.draw(st.integers(1, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] ^= data.draw(st.integers(1, 255))
    codec.decode(kind, bytes(payload))


@settings(QUICK, max_examples=300)
@given(st.sampled_from(sorted(codec.KINDS)), st.binary(max_size=80))
def test_random_bytes_never_raise_and_what_is_accepted_is_a_message_of_that_kind(kind, noise):
    message = codec.decode(kind, noise)
    assert message is None or isinstance(message, codec.KINDS[kind])


@settings(QUICK, max_examples=300)
@given(st.sampled_from(sorted(codec.KINDS)), st.integers(1, 6), st.lists(st.integers() | st.none()))
def test_arrays_of_numbers_never_raise(kind, tag, numbers):
    fields = [number for number in numbers if number is None or -(2**63) <= number < 2**64]
    message = codec.decode(kind, raw(tag, *fields))
    assert message is None or isinstance(message, codec.KINDS[kind])


def test_a_plan_with_any_bit_flipped_is_dropped_before_it_is_parsed(monkeypatch):
    parsed = []

    class Parser:
        def decode(self, payload):
            parsed.append(payload)
            return a_plan()

    monkeypatch.setattr(codec, "_plan_decoder", Parser())
    codec.decode.cache_clear()
    payload = codec.encode(a_plan())
    assert codec.decode("plan", payload) == a_plan()
    assert parsed == [payload]
    for place in range(len(payload)):
        for bit in range(8):
            bad = bytearray(payload)
            bad[place] ^= 1 << bit
            assert codec.decode("plan", bytes(bad)) is None, (place, bit)
    assert len(parsed) == 1


@pytest.mark.parametrize(("name", "right", "text"), GOLDEN, ids=[row[0] for row in GOLDEN])
def test_a_message_on_a_key_of_another_kind_is_dropped(name, right, text):
    for kind in [*codec.KINDS, "position", ""]:
        fits = kind == right or (right, kind) == ("block", "blocks")
        fits |= (name, kind) == ("order", "orders")
        assert (codec.decode(kind, bytes.fromhex(text)) is not None) == fits, name


@pytest.mark.parametrize(("name", "kind", "text"), GOLDEN, ids=[row[0] for row in GOLDEN])
def test_a_field_that_a_later_version_adds_is_ignored_by_this_one(name, kind, text):
    pack = make_messages.sealed if name.startswith("plan") else make_messages.pack
    packed = pack([*make_messages.fields(name), "new"])
    assert codec.decode(kind, packed) == codec.decode(kind, bytes.fromhex(text)) is not None


def test_a_hello_of_version_1_is_understood_so_that_its_robot_can_be_refused_by_name():
    assert PROTOCOL_VERSION == 3
    hello = Hello(1, 7, 0.15, 0.5, 0.5, None, 3)
    assert codec.decode("hello", raw(1, 1, 7, 0.15, 0.5, 0.5, None, 3)) == hello
    assert (hello.points, hello.stops, hello.bytes) == (0, 0, 0)


def test_a_payload_longer_than_a_robot_receives_is_dropped_before_it_is_read():
    padded = raw(4, 1, 2, 3, 4, 0, None, None, 0, 0, 0, bytes(MAX_MESSAGE_BYTES - 15))
    assert len(padded) == MAX_MESSAGE_BYTES
    assert codec.decode("report", padded) is not None
    longer = raw(4, 1, 2, 3, 4, 0, None, None, 0, 0, 0, bytes(MAX_MESSAGE_BYTES))
    assert codec.decode("report", longer) is None


@pytest.mark.parametrize(
    ("kind", "payload"),
    [
        ("report", b"\x91" * MAX_MESSAGE_BYTES),
        ("report", b"\x98\x04\x01\x02\x03\x04\x00\xc0" + b"\x91" * 3_900),
        ("command", b"\x9d\x03\x01\x01\x01\x01\x01\x00\x00\x00\xdd\xff\xff\xff\xff"),
        ("plan", b"\xdc\x00\x12\x02\xc6\xff\xff\xff\xff"),
        ("plan", with_seal(b"\xdc\x00\x13\x02\xc6\xff\xff\xff\xff")),
        ("plan", with_seal(b"\x91" * (MAX_MESSAGE_BYTES - 5))),
        ("plan", with_seal(b"")),
        ("plan", b"\xdd\xff\xff\xff\xff"),
        ("plan", b"\x93\x06\x01\xa2\xff\xfe"),
    ],
    ids=[
        "nested",
        "nested behind",
        "many held",
        "long bytes",
        "long bytes with a seal",
        "nested with a seal",
        "nothing but a seal",
        "long array",
        "no UTF-8",
    ],
)
def test_bytes_made_to_exhaust_the_reader_are_dropped(kind, payload):
    assert codec.decode(kind, payload) is None


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, -1.0])
def test_a_number_that_is_not_finite_or_below_zero_is_dropped(number):
    assert codec.decode("report", raw(4, 1, 2, 3, 4, 0, number)) is None
    for place in range(3):
        limits = [0.1, 0.2, 0.3]
        limits[place] = number
        assert codec.decode("hello", raw(1, 1, 7, *limits)) is None


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["points", "knots", "weights", "speeds", "profile", "stops"])
def test_a_plan_with_a_number_that_is_not_finite_is_dropped(field, number):
    bad = struct.pack("<2f", 0.0, number)
    if field == "speeds":
        bad = struct.pack("<13f", *[0.1] * 12, number)
    if field == "profile":
        bad = struct.pack("<fB", number, 0)
    if field == "stops":
        bad = struct.pack("<fq", number, 0)
    plan = msgspec.structs.replace(a_plan(), **{field: bad})
    assert codec.decode("plan", codec.encode(plan)) is None


@pytest.mark.parametrize(
    ("field", "length"),
    [
        ("points", 4),
        ("points", 9),
        ("knots", 3),
        ("weights", 5),
        ("profile", 4),
        ("stops", 8),
        ("speeds", 0),
    ],
)
def test_a_plan_with_a_packed_field_of_no_whole_length_is_dropped(field, length):
    plan = msgspec.structs.replace(a_plan(), **{field: bytes(length)})
    assert codec.decode("plan", codec.encode(plan)) is None


def test_a_plan_without_its_seal_or_with_another_one_is_dropped():
    payload = codec.encode(a_plan())
    body, seal = payload[: -codec.SEAL_BYTES], payload[-codec.SEAL_BYTES :]
    assert payload == with_seal(body)
    other = codec.encode(a_plan(stops=2))[-codec.SEAL_BYTES :]
    for wrong in (b"", bytes(5), seal[:1] + seal[:0:-1], seal * 2, other):
        assert codec.decode("plan", body + wrong) is None
    assert codec.decode("plan", msgspec.msgpack.encode(a_plan())) is None


def test_any_msgpack_library_reads_a_plan_and_finds_the_seal_behind_its_fields():
    payload = codec.encode(a_plan())
    *fields, seal = msgspec.msgpack.decode(payload)
    assert fields == msgspec.msgpack.decode(msgspec.msgpack.encode(a_plan()))
    assert seal == zlib.crc32(payload[: -codec.SEAL_BYTES])


def test_a_refusal_has_no_seal():
    packed = raw(6, 7, "R9 stands in no scenario")
    assert codec.encode(Refusal(7, "R9 stands in no scenario")) == packed
    assert codec.decode("plan", packed) == Refusal(7, "R9 stands in no scenario")
    assert codec.decode("plan", with_seal(packed)) is None


def command(start_ns=0, said_ns=0, **fields):
    return Command(5, 1, 1, 1, GO, start_ns, said_ns, **fields)


def test_a_command_gives_authority_to_robots_in_its_range_and_says_nothing_of_others():
    said = command(10**9, 31 * 10**9, headroom_ms=1_800, held=((4, 9_000),), first=3, last=5)
    assert [said.authority_of(number) for number in range(8)] == [
        *[None] * 3,
        *[31_800, 9_000, 31_800],
        *[None] * 2,
    ]


def test_a_robot_outside_of_the_range_is_told_nothing_even_if_it_is_named_as_held():
    said = command(held=((2, 9_000), (6, 9_000)), first=3, last=5)
    assert (said.authority_of(2), said.authority_of(6)) == (None, None)
    assert command(first=5, last=3).authority_of(4) is None


def test_a_command_that_states_no_range_speaks_for_every_number():
    said = command(headroom_ms=700)
    assert {said.authority_of(number) for number in (0, 1, 999, 65_535)} == {700}


def test_authority_is_rounded_down_to_milliseconds_before_the_start_as_well():
    assert command(0, 1_999_999, headroom_ms=10).authority_of(0) == 11
    assert command(1, 0, headroom_ms=10).authority_of(0) == 9


HOLDS = (3, 1, 1, 1, 1, 0, 0, 0)
"""A Command with the tag and all fields that have no default."""


def test_a_command_may_leave_out_what_has_a_default():
    spelt_out = Command(1, 1, 1, 1, 0, 0, 0, 0, (), 0, 2**32 - 1, ())
    assert codec.decode("command", raw(*HOLDS)) == spelt_out


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("hello", (1, 256, 7)),
        ("hello", (1, -1, 7)),
        ("hello", (1, 1, 2**32)),
        ("hello", (1, 1, "7")),
        ("hello", (1, 1)),
        ("hello", (1, 2, 7, 0.0, 0.0, 0.0, None, 0, 65_536)),
        ("hello", (1, 2, 7, 0.0, 0.0, 0.0, None, 0, 0, -1)),
        ("hello", (1, 2, 7, 0.0, 0.0, 0.0, None, 0, 0, 0, 0.5)),
        ("command", (*HOLDS[:5], 5, *HOLDS[6:])),
        ("command", (*HOLDS[:5], -1, *HOLDS[6:])),
        ("command", (*HOLDS[:6], 2**62 + 1, *HOLDS[7:])),
        ("command", (*HOLDS[:6], 0.5, *HOLDS[7:])),
        ("command", (*HOLDS[:7], -(2**62) - 1)),
        ("command", HOLDS[:7]),
        ("command", (*HOLDS, 2**31)),
        ("command", (*HOLDS, 0, [[1, 0]] * (MOST_HELD + 1))),
        ("command", (*HOLDS, 0, [["R1", 0]])),
        ("command", (*HOLDS, 0, [[2**32, 0]])),
        ("command", (*HOLDS, 0, [[1, 2**31]])),
        ("command", (*HOLDS, 0, [[1]])),
        ("command", (*HOLDS, 0, [[1, 2, 3]])),
        ("command", (*HOLDS, 0, [], -1)),
        ("command", (*HOLDS, 0, [], 0, 2**32)),
        ("command", (*HOLDS, 0, [], 0, 1, ["R1"] * (MOST_WANTED + 1))),
        ("command", (*HOLDS, 0, [], 0, 1, ["R 1"])),
        ("command", (*HOLDS, 0, [], 0, 1, ["R1\n"])),
        ("command", (*HOLDS, 0, [], 0, 1, [""])),
        ("command", (*HOLDS, 0, [], 0, 1, ["R" * 33])),
        ("report", (4, 1, 1, 1, 6)),
        ("report", (4, 1, 1, 1, 0, 8)),
        ("report", (4, 1, -1, 1, 0)),
        ("report", (4, 1, 1, 1, 2, 0, None, 2**31)),
        ("report", (4, 1, 1, 1, 2, 0, None, 0, 65_536)),
        ("order", (10, 1, "a", [1.0])),
        ("order", (10, 1, "a", [1.0, math.nan])),
        ("order", (10, 1, "a", [1.0, 2.0], "R1", [[1.0, math.inf]])),
        ("order", (10, 1, "a/b", [1.0, 2.0])),
        ("order", (10, 1, "", [1.0, 2.0])),
        ("order", (10, 1, "a", [1.0, 2.0], "R1", [], -1)),
        ("tell", (12, 1, 3)),
        ("block", (14, 1, "a", [[0.0, 0.0], [1.0, 0.0]])),
        ("roster", (16, 1, "R9", [0.0, 0.0, math.inf], 0.2, 0.8)),
        ("roster", (16, 1, "R9", [0.0, 0.0, 0.0], 0.0, 0.8)),
        ("roster", (16, 1, "R9", [0.0, 0.0, 0.0], 0.2, 1e-300)),
        ("roster", (16, 1, "R9", [0.0, 0.0, 0.0], 0.2, 0.8, 1e-300)),
        ("roster", (16, 1, "R9", [0.0, 0.0, 0.0], 0.2, 0.8, 0.8, 0.0, 1e-300)),
        ("block", (14, 1, "a", [[0.0, 0.0], [1.0, 0.0], [1.0, math.nan]])),
        ("orders", (13, "a", 5)),
        ("report", (4, 1, 1, 1, 2, 0, None, 0, -1)),
        ("report", (4, 1, 1, 1, 2, 0, None, 0, 0, -1)),
        ("report", (8, 1, 1, 2, None)),
        ("clock", (5, 1, -(2**62) - 1)),
        ("clock", (5, 1, 2**64 - 1)),
        ("plan", (6, 1, "x" * 201)),
        ("plan", (7, 1, "unknown tag")),
        ("plan", ()),
    ],
)
def test_a_field_out_of_its_bounds_is_dropped(kind, fields):
    assert codec.decode(kind, raw(*fields)) is None


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("robot", "R1\n"),
        ("robot", "../R1"),
        ("number", -1),
        ("number", 2**32),
        ("revision", -1),
        ("begin_ms", 2**31),
        ("clock_ms", 0),
        ("tau_ns", -1),
        ("tau_ns", 10**12 + 1),
        ("track_mm", 65_536),
        ("degree", 0),
        ("degree", 8),
        ("points", bytes(3_608)),
    ],
)
def test_a_plan_with_a_field_out_of_its_bounds_is_dropped(field, value):
    small = a_plan(points=0, knots=0, profile=0, stops=0)
    plan = msgspec.structs.replace(small, **{field: value})
    assert codec.decode("plan", codec.encode(small)) == small
    assert codec.decode("plan", codec.encode(plan)) is None
