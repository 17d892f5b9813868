"""docs/protocol.md is a specification: what it states is held against the code, cell by cell."""

import math
import re
import struct
from pathlib import Path

import msgspec
import numpy as np
import pytest
from scipy.interpolate import BSpline

from protocol import codec, timing
from protocol.curve import Curve
from protocol.messages import Plan
from protocol.phases import PHASE_NAMES
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline
from robot_agent.core import transitions
from robot_agent.core.clock_sync import ClockSync
from tests.golden import make_messages
from tests.protocol.test_wire_format import TYPES

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "protocol.md").read_text()
TAGS = {TYPES[tag].__name__: tag for tag in TYPES}
OF_ROBOTS = ("Hello", "Plan", "Refusal", "Command", "Report", "Clock")
BLOCKS = [
    block.strip().splitlines() for block in re.findall(r"```\n(9.*?|dc.*?)```", PAGE, re.DOTALL)
]


def section(title: str) -> str:
    """The text below a heading, up to the next one."""
    (text,) = re.findall(rf"^##+ {re.escape(title)}\n(.*?)(?=^##|\Z)", PAGE, re.DOTALL | re.M)
    return text


def table(title: str, which: int = 0) -> list[list[str]]:
    """The rows of a section's table without its head."""
    tables = re.findall(r"(?:^\|.*\n)+", section(title), re.M)
    rows = [[cell.strip() for cell in row.split("|")[1:-1]] for row in tables[which].splitlines()]
    return rows[2:]


def limits(form: str) -> tuple[int, int] | None:
    """The least and the greatest integer of a form; None for other forms."""
    found = re.fullmatch(r"(?:null, or )?int (\S+)\.\.(\S+)", form)
    return tuple(map(number, found.groups())) if found else None


def number(text: str) -> int:
    factors = re.fullmatch(r"(-?)(\d+)(?:\^(\d+))?(?:-(\d+))?", text)
    sign, base, power, less = factors.groups()
    return (-1 if sign else 1) * int(base) ** int(power or 1) - int(less or 0)


def whole(tag: int) -> list:
    """The fields of the first golden message of a tag, without the tag."""
    rows = [row for _, row in make_messages.MESSAGES.values() if row[0] == tag]
    return list(rows[0][1:])


def decoded(tag: int, fields: list):
    kind = next(kind for kind, row in make_messages.MESSAGES.values() if row[0] == tag)
    packed = (make_messages.sealed if tag == 2 else make_messages.pack)([tag, *fields])
    return codec.decode(kind, packed)


def test_the_examples_are_the_golden_messages_and_every_message_has_one():
    assert make_messages.page(PAGE) == PAGE
    assert [make_messages.rows(name) for name in make_messages.EXAMPLES] == BLOCKS
    assert {make_messages.fields(name)[0] for name in make_messages.EXAMPLES} == set(TYPES)


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: " ".join(block[1].split()))
def test_the_bytes_of_an_example_are_what_the_codec_reads_and_writes(block):
    payload = bytes.fromhex("".join(line.split()[0] for line in block))
    tag = int(block[1].split()[-1])
    kind = next(kind for kind, types in codec.KINDS.items() if TYPES[tag] in types)
    message = codec.decode(kind, payload)
    assert isinstance(message, TYPES[tag])
    assert codec.encode(message) == payload


@pytest.mark.parametrize("name", OF_ROBOTS)
def test_a_table_of_fields_names_them_in_their_order_with_what_they_count_as_when_left_out(name):
    fields = msgspec.structs.fields(TYPES[TAGS[name]])
    rows = table(name)
    assert [row[0] for row in rows] == [field.name for field in fields]
    for (_, _, left_out, _), field in zip(rows, fields, strict=True):
        words = {"": msgspec.NODEFAULT, "null": None, "[]": ()}
        value = words[left_out] if left_out in words else number(left_out)
        assert field.default == value or (field.default is value), field.name


@pytest.mark.parametrize("name", OF_ROBOTS)
def test_the_limits_of_an_integer_are_acceptable_and_the_next_numbers_are_not(name):
    tag = TAGS[name]
    for place, (field, form, *_) in enumerate(table(name)):
        if (bounds := limits(form)) is None:
            continue
        for edge, step in zip(bounds, (-1, 1), strict=True):
            fields = whole(tag)
            fields[place] = edge
            assert decoded(tag, fields) is not None, (field, edge)
            fields[place] = edge + step
            assert decoded(tag, fields) is None, (field, edge + step)


@pytest.mark.parametrize("name", OF_ROBOTS)
def test_a_message_without_a_field_that_must_be_there_is_not_acceptable(name):
    tag = TAGS[name]
    needed = sum(not left_out for _, _, left_out, _ in table(name))
    assert decoded(tag, whole(tag)[:needed]) is not None
    assert decoded(tag, whole(tag)[: needed - 1]) is None


LATER = {
    "nil": b"\xc0",
    "array": b"\x92\x01\xa1x",
    "map": b"\x81\xa1a\xc2",
    "ext": b"\xd4\x05\x00",
    "bin": b"\xc4\x02\x00\x01",
    "float 32": b"\xca\x00\x00\x00\x00",
}


@pytest.mark.parametrize("later", LATER)
@pytest.mark.parametrize("name", make_messages.MESSAGES)
def test_a_field_from_the_future_of_any_type_is_ignored_in_every_message(name, later):
    kind, (tag, *fields) = make_messages.MESSAGES[name]
    sealed = tag == 2
    body = b"".join(map(make_messages.pack, [tag, *fields])) + LATER[later]
    payload = make_messages.head(len(fields) + 2 + sealed) + body
    payload += codec._seal(payload) if sealed else b""
    assert codec.decode(kind, payload) == codec.decode(kind, make_messages.payload(name))


def test_a_field_from_the_future_in_a_place_of_rest_is_ignored():
    fields = make_messages.fields("report_of_a_frozen_robot")[1:]
    later = [*fields]
    later[5] = [*fields[5], "new"]
    assert decoded(4, later) == decoded(4, fields) is not None


INTEGERS = ["05", "cc05", "cd0005", "ce00000005", "cf0000000000000005"]
INTEGERS += ["d005", "d10005", "d200000005", "d30000000000000005"]


@pytest.mark.parametrize("form", INTEGERS)
def test_an_integer_is_read_in_every_form_and_counts_as_a_float_where_one_is_meant(form):
    packed = bytes.fromhex(form)
    report = codec.decode("report", b"\x9b\x04" + packed + bytes.fromhex("010102 00c0c0 000000"))
    assert report.boot == 5
    hello = codec.decode("hello", b"\x94\x01\x03\x07" + packed)
    assert hello.radius_m == 5.0


def test_float_32_and_float_64_are_read_and_neither_counts_as_an_integer():
    for packed in (struct.pack(">Bf", 0xCA, 5.0), struct.pack(">Bd", 0xCB, 5.0)):
        assert codec.decode("hello", b"\x94\x01\x03\x07" + packed).radius_m == 5.0
        assert codec.decode("hello", b"\x93\x01\x03" + packed) is None
    assert codec.decode("hello", b"\x93\x01\x03\xc3") is None


@pytest.mark.parametrize("head", ["a1", "d901", "da0001", "db00000001"])
def test_a_text_is_read_with_every_head_and_bytes_are_no_text(head):
    assert codec.decode("plan", b"\x93\x06\x01" + bytes.fromhex(head) + b"x").reason == "x"
    assert codec.decode("plan", b"\x93\x06\x01\xc4\x01x") is None


@pytest.mark.parametrize("head", ["93", "dc0003", "dd00000003"])
def test_an_array_is_read_with_every_head(head):
    assert codec.decode("plan", bytes.fromhex(head) + b"\x06\x01\xa1x").reason == "x"


@pytest.mark.parametrize("head", ["c4{:02x}", "c5{:04x}", "c6{:08x}"])
def test_bytes_are_read_with_every_head_and_a_text_is_no_bytes(head):
    name = "plan_of_the_page"
    tag, *fields = make_messages.fields(name)

    def with_points(head: bytes) -> bytes:
        parts = [make_messages.pack(field) for field in (tag, *fields)]
        parts[12] = head + fields[11]
        body = make_messages.head(19) + b"".join(parts)
        return body + codec._seal(body)

    size = len(fields[11])
    plan = codec.decode("plan", with_points(bytes.fromhex(head.format(size))))
    assert plan == codec.decode("plan", make_messages.payload(name))
    assert codec.decode("plan", with_points(bytes([0xD9, size]))) is None


def test_the_seal_is_the_crc_that_the_page_describes():
    def crc(data: bytes) -> int:
        value = 0xFFFFFFFF
        for byte in data:
            value ^= byte
            for _ in range(8):
                value = value >> 1 ^ (0xEDB88320 if value & 1 else 0)
        return value ^ 0xFFFFFFFF

    assert "0xEDB88320" in section("The seal of a Plan")
    assert f"0x{crc(b'123456789'):X}" in section("The seal of a Plan")
    payload = make_messages.payload("plan_of_the_page")
    assert payload[-5:] == struct.pack(">BI", 0xCE, crc(payload[:-5]))


def test_the_table_of_states_has_every_cell_of_the_agents_own():
    text = section("The states of a robot")
    head = re.search(r"^\| phase \|.*$", text, re.M)[0]
    events = [cell.strip() for cell in head.split("|")[2:-1]]
    rows = {row[0]: row[1:] for row in table("The states of a robot")}
    assert list(rows) == list(PHASE_NAMES)
    said = {
        (PHASE_NAMES.index(phase), event): PHASE_NAMES.index(to)
        for phase, cells in rows.items()
        for event, to in zip(events, cells, strict=True)
        if to != "-"
    }
    assert said == transitions.TRANSITIONS
    assert [row[0] for row in table("The states of a robot", 1)] == events


def test_the_table_of_times_states_the_numbers_of_the_code():
    for what, long, name in table("Times"):
        milliseconds = int(long.removesuffix(" ms"))
        scale = 1 if name.endswith("_MS") else timing.MILLISECOND
        assert getattr(timing, name) == milliseconds * scale, what


def the_plan() -> Plan:
    plan = codec.decode("plan", make_messages.payload("plan_of_the_page"))
    assert isinstance(plan, Plan)
    return plan


def test_the_robots_curve_and_motion_have_the_places_of_the_page():
    parts = unpack_plan(the_plan())
    curve, motion = Curve(*parts.path), Timeline(*parts.motion)
    text = section("What a robot computes")
    assert f"{curve.length:.6f} m" in text
    assert f"{motion.finish:.6f} s" in text
    for row in table("What a robot computes"):
        t, s, v, x, y = map(float, row)
        assert (motion.s_at(t), motion.v_at(t)) == pytest.approx((s, v), abs=1e-6)
        curve.place(motion.s_at(t))
        assert math.hypot(curve.x - x, curve.y - y) < 2e-6


def test_the_places_of_the_page_follow_from_its_formulas_by_other_means():
    points = np.array([(0, 0), (0.75, 0), (1.5, 0.75), (2.25, 1.5), (3, 1.5)])
    spline = BSpline([0, 0, 0, 0, 1, 2, 2, 2, 2], points, 3)
    places = spline(np.linspace(0, 2, 200_001))
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
    end = along[-1]
    knots = [0, 0.25, 1.25, 1.5, 1.75, end - 0.25, end]
    s = np.unique(np.append(np.linspace(0.0, end, 100_001), knots))
    v = np.sqrt(np.interp(s, knots, [0, 0.25, 0.25, 0, 0.25, 0.25, 0]))
    t = np.append(0.0, np.cumsum(2.0 * np.diff(s) / (v[1:] + v[:-1])))
    t[s > 1.5] += 8.4 - 4.0
    for row in table("What a robot computes"):
        at, there, _, x, y = map(float, row)
        mine = np.interp(at, t, s)
        assert mine == pytest.approx(there, abs=2e-5)
        place = [np.interp(mine, along, places[:, axis]) for axis in (0, 1)]
        assert math.hypot(place[0] - x, place[1] - y) < 3e-5


def test_the_clock_filter_finds_the_offset_of_the_example():
    text = " ".join(section("The clock filter").split())
    t1, t2, t3, t4 = (
        1000 * int(stamp.replace(",", ""))
        for stamp in re.search(
            r"t1 = ([\d,]+), t2 = ([\d,]+), t3 = ([\d,]+), t4 = ([\d,]+) micro", text
        ).groups()
    )
    clock = ClockSync()
    clock.ask(t1)
    assert clock.add(t1, t2, t3, t4)
    said = re.search(r"it is ([\d,]+), with an error of (\d+) \(and (\d+) ns", text).groups()
    offset, error, drift = (int(number.replace(",", "")) for number in said)
    assert clock.offset_ns == 1000 * offset
    assert clock.error_ns(t4) == 1000 * error + drift


def test_every_requirement_names_a_section_of_the_page():
    rows = table("Requirements")
    numbers = [row[0] for row in rows]
    assert len(set(numbers)) == len(numbers) >= 40
    for _, what, title in rows:
        assert what.split()[0] in ("must", "should", "may")
        assert section(title)
