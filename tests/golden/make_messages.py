"""Makes messages.txt, the bytes of one message of each type and of each optional field.

Run as `python -m tests.golden.make_messages`; it also renews the examples of docs/protocol.md.
The bytes are made by the few lines of msgpack below, from the field order of the protocol's table,
and share nothing with protocol/codec.py: a test holds the codec to the file.  A byte that changes
here breaks robots in the field.
"""

from __future__ import annotations

import re
import struct
import zlib
from pathlib import Path

FILE = Path(__file__).with_name("messages.txt")
PAGE = Path(__file__).resolve().parents[2] / "docs" / "protocol.md"

_INTEGERS = (
    (0, 0x7F, None, "B"),
    (0, 0xFF, 0xCC, "B"),
    (0, 0xFFFF, 0xCD, "H"),
    (0, 0xFFFF_FFFF, 0xCE, "I"),
    (0, 2**64 - 1, 0xCF, "Q"),
    (-32, -1, None, "b"),
    (-(2**7), -1, 0xD0, "b"),
    (-(2**15), -1, 0xD1, "h"),
    (-(2**31), -1, 0xD2, "i"),
    (-(2**63), -1, 0xD3, "q"),
)

POINTS = struct.pack("<8f", 0.0, 0.0, 1.0, 0.5, 2.0, -0.5, 3.0, 0.0)
SPEEDS = struct.pack("<2f", 0.0, 0.5)
PROFILE = struct.pack("<fBfBfB", 0.0, 0, 0.25, 1, 3.25, 0)
STOPS = struct.pack("<fq", 1.5, 8_400_000_000)
KNOTS = struct.pack("<f", 3.0)
WEIGHTS = struct.pack("<4f", 1.0, 0.75, 0.75, 1.0)

EXAMPLE = {
    "points": struct.pack("<10f", 0.0, 0.0, 0.75, 0.0, 1.5, 0.75, 2.25, 1.5, 3.0, 1.5),
    "knots": struct.pack("<2f", 1.0, 2.0),
    "weights": b"",
    "speeds": SPEEDS,
    "profile": struct.pack(
        "<fBfBfBfBfBfB", 0, 0, 0.25, 1, 1.25, 1, 1.75, 1, 3.21654320, 1, 3.46654320, 0
    ),
    "stops": STOPS,
}
"""The plan of docs/protocol.md: along an S of 3.467 m, with a stop of 4.4 s on the way."""

MESSAGES: dict[str, tuple[str, list]] = {
    "hello": (
        "hello",
        [1, 2, 4_294_967_295, 0.15, 0.5, 0.5, None, 1, 60, 20, 1_200],
    ),
    "hello_of_version_3": ("hello", [1, 3, 77, 0.15, 0.5, 0.5, None, 1, 64, 16, 1_600]),
    "hello_that_states_no_limits": ("hello", [1, 2, 7, 0.0, 0.0, 0.0, None, 0, 0, 0, 0]),
    "hello_of_a_robot_that_came_back": (
        "hello",
        [1, 2, 7, 0.0, 0.0, 0.0, [1_500, -20, 1_571], 70_000, 0, 0, 65_535],
    ),
    "admit": ("admit", [7, 12, ""]),
    "plan": (
        "plan",
        [
            2,
            1,
            77,
            "R1",
            3,
            0,
            0,
            5 * 10**8,
            20,
            500,
            10,
            3,
            POINTS,
            KNOTS,
            b"",
            SPEEDS,
            PROFILE,
            STOPS,
        ],
    ),
    "plan_with_weights_without_stops_that_begins_later": (
        "plan",
        [
            2,
            300,
            77,
            "robot-2",
            65_535,
            4,
            61_500,
            10**12,
            65_535,
            0,
            65_535,
            3,
            POINTS,
            KNOTS,
            WEIGHTS,
            SPEEDS,
            PROFILE,
            b"",
        ],
    ),
    "plan_of_the_page": (
        "plan",
        [2, 1, 5, "R1", 3, 0, 0, 5 * 10**8, 20, 500, 10, 3, *EXAMPLE.values()],
    ),
    "refusal": ("plan", [6, 77, "R9 stands in no scenario"]),
    "command_hold": ("command", [3, 5, 1, 1, 1, 0, 0, 1, 0, [], 0, 65_535, [], 5]),
    "command_go": (
        "command",
        [
            3,
            5,
            2,
            65_536,
            1,
            1,
            98_765_432_109,
            123_456_789_012,
            1_800,
            [[3, 24_000], [128, -1_500]],
            0,
            999,
            [],
            4_294_967_295,
        ],
    ),
    "command_go_for_the_other_robots": (
        "command",
        [3, 5, 2, 65_537, 1, 1, 98_765_432_109, 123_456_789_012, 1_800, [], 1_000, 65_535, [], 4],
    ),
    "command_freeze": (
        "command",
        [3, 5, 1, 40_000, 2, 2, -1, 70_000, -300, [], 0, 2**32 - 1, ["R1", "R.2_-"], 5],
    ),
    "command_stop": (
        "command",
        [3, 5, 1, 40_001, 2, 4, 10**10, 2 * 10**10, 0, [], 0, 2**32 - 1, [], 0],
    ),
    "report": ("report", [4, 77, 200, 1, 2, 0, None, 12_345, 3, 4, 5]),
    "report_without_a_stamp": ("report", [4, 77, 7, 1, 1, 0, None, None, 0, 0, 0]),
    "report_of_a_frozen_robot": (
        "report",
        [4, 77, 1_000, 1, 4, 1, [3.140625, 1, -3, 700, 0, 2], None, 0, 2, 2],
    ),
    "clock_question": ("clock", [5, 77, -(2**40), None, None, 0]),
    "clock_answer": ("clock", [5, 77, 2**40, 2**62, 1_000, 5]),
    "order": (
        "order",
        [10, 9, "o-1", [9.0, 5.0, 0.5], "R1", [[5.0, 7.0]], 3_000, -1, True, 60_000, "o-0", "anna"],
    ),
    "cancel": ("order", [11, 9, "o-1", "anna"]),
    "tell": ("tell", [12, 9, 1, "anna"]),
    "block": ("block", [14, 9, "wet", [[0.0, 0.0], [1.5, 0.0], [1.5, 2.0]], ""]),
    "unblock": ("block", [15, 9, "wet", ""]),
    "join": ("roster", [16, 9, "R9", [1.0, 2.0, 0.5], 0.2, 0.8, 0.0, 0.0, 2.0, ""]),
    "leave": ("roster", [17, 9, "R9", ""]),
    "order_state": (
        "orders",
        [13, "o-1", 1, "R1", 0, 400, 21_000, None, 18_500, "held by R2"],
    ),
}
"""Name to (kind of key, tag and fields)."""

EXAMPLES = (
    "hello_of_version_3",
    "plan_of_the_page",
    "refusal",
    "command_go",
    "report",
    "report_of_a_frozen_robot",
    "clock_question",
    "clock_answer",
    "admit",
    "order",
    "cancel",
    "tell",
    "order_state",
    "block",
    "unblock",
    "join",
    "leave",
)
"""The messages that docs/protocol.md shows, in its order."""

FIELDS = {
    1: "version boot radius_m max_speed_mps max_accel_mps2 place sequence points stops bytes",
    2: "epoch boot robot number revision begin_ms tau_ns track_mm brake_mmps2 clock_ms degree "
    "points knots weights speeds profile stops",
    3: "boot term sequence epoch phase start_ns said_ns headroom_ms held first last wanted run",
    4: "boot sequence epoch phase fault rest stamp_ms late revision holds",
    5: "boot sent_ns received_ns answered_ns coordinator",
    6: "boot reason",
    7: "boot by",
    10: "boot id goal robot via dwell_ms priority now release_ms after by",
    11: "boot id by",
    12: "boot what by",
    14: "boot id polygon by",
    15: "boot id by",
    16: "boot robot place radius_m max_speed_mps max_accel_mps2 min_turn_radius_m max_turn_rate by",
    17: "boot robot by",
    13: "id state robot released_ms accepted_ms planned_arrival_ms arrived_ms alone_ms reason",
}
"""Tag to the names of the fields in their order."""

LAYOUT = {
    "points": "<ff",
    "knots": "<f",
    "weights": "<f",
    "speeds": "<f",
    "profile": "<fB",
    "stops": "<fq",
}
"""The packed fields of a Plan and what they repeat."""


def pack(value: object) -> bytes:
    """Return msgpack in its shortest form, floats as float64."""
    if value is None:
        return b"\xc0"
    if isinstance(value, bool):
        return b"\xc3" if value else b"\xc2"
    if isinstance(value, int):
        mark, form = next(row[2:] for row in _INTEGERS if row[0] <= value <= row[1])
        return (b"" if mark is None else bytes([mark])) + struct.pack(f">{form}", value)
    if isinstance(value, float):
        return b"\xcb" + struct.pack(">d", value)
    if isinstance(value, bytes):
        return b"\xc4" + bytes([len(value)]) + value
    if isinstance(value, str):
        return bytes([0xA0 + len(value)]) + value.encode()
    if isinstance(value, list):
        return head(len(value)) + b"".join(map(pack, value))
    raise TypeError(type(value))


def head(count: int) -> bytes:
    """Return the head of an array."""
    return bytes([0x90 + count]) if count < 16 else b"\xdc" + struct.pack(">H", count)


def fields(name: str) -> list:
    """Return the tag and all fields of a message."""
    return MESSAGES[name][1]


def sealed(values: list) -> bytes:
    """Return the bytes of a plan: one element more, a uint32 in long form, is their CRC-32."""
    body = pack([*values, 0])[:-1]
    return body + struct.pack(">BI", 0xCE, zlib.crc32(body))


def payload(name: str) -> bytes:
    """Return the bytes of a message; those of a plan end with their seal."""
    return (sealed if fields(name)[0] == 2 else pack)(fields(name))


def rows(name: str) -> list[str]:
    """Return the example of docs/protocol.md: a row for each element, its bytes and its meaning."""
    tag, *values = fields(name)
    count = 1 + len(values) + (tag == 2)
    shown = [(head(count), f"array of {count}"), (pack(tag), f"tag {tag}")]
    for field, value in zip(FIELDS[tag].split(), values, strict=True):
        shown += rows_of(f"{field}: ", value, LAYOUT.get(field, "") if tag == 2 else "")
    if tag == 2:
        whole = payload(name)
        shown.append((whole[-5:], f"the seal: CRC-32 of the {len(whole) - 5} bytes above"))
    return [f"{part.hex():<24} {meaning}" for part, meaning in shown]


def rows_of(said: str, value: object, layout: str) -> list[tuple[bytes, str]]:
    """Return the bytes and the meaning of a value, and of each of its parts."""
    if isinstance(value, list):
        parts = [row for part in value for row in rows_of("", part, "")]
        return [(head(len(value)), f"{said}array of {len(value)}"), *indented(parts)]
    if isinstance(value, bytes):
        parts = [
            (struct.pack(layout, *part), ", ".join(map(number, part)))
            for part in struct.iter_unpack(layout, value)
        ]
        return [(pack(value)[:2], f"{said}{len(value)} bytes"), *indented(parts)]
    words = "null" if value is None else "true" if value is True else str(value) or '""'
    return [(pack(value), said + words)]


def indented(parts: list[tuple[bytes, str]]) -> list[tuple[bytes, str]]:
    """Return rows with their meaning moved to the right."""
    return [(part, f"  {meaning}") for part, meaning in parts]


def number(value: float) -> str:
    """Return how an example states a packed number."""
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def text() -> str:
    """Return the lines of the golden file: name, kind of key, bytes in hexadecimal."""
    rows = [f"{name} {kind} {payload(name).hex()}" for name, (kind, _) in MESSAGES.items()]
    return "\n".join(rows) + "\n"


def page(before: str) -> str:
    """Return docs/protocol.md with the examples as they are now."""
    names = iter(EXAMPLES)

    def example(_: re.Match[str]) -> str:
        return "\n".join(["```", *rows(next(names)), "```"])

    return re.sub(r"```\n(?:9|dc)[^`]*```", example, before)


if __name__ == "__main__":
    FILE.write_text(text())
    PAGE.write_text(page(PAGE.read_text()))
