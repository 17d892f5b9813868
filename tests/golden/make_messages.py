"""Makes messages.txt: the bytes of one message of each type and of each optional field.

Run as `python -m tests.golden.make_messages`.  The bytes are made by the few lines of msgpack
below, from the field order of the protocol's table, and share nothing with protocol/codec.py:
a test holds the codec to the file.  A byte that changes here breaks robots in the field.
"""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

FILE = Path(__file__).with_name("messages.txt")

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

LEASES = [600, 10]

MESSAGES: dict[str, tuple[str, list]] = {
    "hello": ("hello", [1, 1, 4_294_967_295, 0.15, 0.5, 0.5, None, 1]),
    "hello_that_states_no_limits": ("hello", [1, 1, 7, 0.0, 0.0, 0.0, None, 0]),
    "hello_of_a_robot_that_came_back": (
        "hello",
        [1, 1, 7, 0.0, 0.0, 0.0, [1_500, -20, 1_571], 70_000],
    ),
    "admit": ("admit", [7, 12]),
    "plan": (
        "plan",
        [
            2,
            1,
            77,
            "R1",
            5 * 10**8,
            20,
            500,
            3,
            POINTS,
            KNOTS,
            b"",
            SPEEDS,
            PROFILE,
            STOPS,
        ],
    ),
    "plan_with_weights_without_stops": (
        "plan",
        [2, 300, 77, "robot-2", 10**12, 65_535, 0, 3, POINTS, KNOTS, WEIGHTS, SPEEDS, PROFILE, b""],
    ),
    "refusal": ("plan", [6, 77, "R9 stands in no scenario"]),
    "command_hold": ("command", [3, 5, 1, 0, 0, 0, [], 0, None, []]),
    "command_go": (
        "command",
        [3, 5, 65_536, 1, 1, 123_456_789_012, [], 98_765_432_109, 70_000, [["R2", 1_500]]],
    ),
    "command_freeze": ("command", [3, 5, 40_000, 2, 2, -1, ["R1", "R.2_-"], 1, None, []]),
    "new_times": ("plan", [8, 300, 77, 2, 500, SPEEDS, PROFILE, STOPS]),
    "pace": ("report", [9, 77, 300, 2, None]),
    "pace_of_a_robot_that_stands": ("report", [9, 77, 300, 0, 12_345_678]),
    "report": ("report", [4, 77, 200, 1, 2, 0, None, 12_345, 3]),
    "report_without_a_stamp": ("report", [4, 77, 7, 1, 1, 0, None, None, 0]),
    "report_of_a_frozen_robot": (
        "report",
        [4, 77, 1_000, 1, 4, 1, [3.140625, 1, -3, 700, 0], None, 0],
    ),
    "clock_question": ("clock", [5, 77, -(2**40), None, None]),
    "clock_answer": ("clock", [5, 77, 2**40, 2**62, 1_000]),
}
"""Name to (kind of key, tag and fields); a plan's checksum and what follows is added below."""


def pack(value: object) -> bytes:
    """Return msgpack in its shortest form, floats as float64."""
    if value is None:
        return b"\xc0"
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
        count = len(value)
        head = bytes([0x90 + count]) if count < 16 else b"\xdc" + struct.pack(">H", count)
        return head + b"".join(map(pack, value))
    raise TypeError(type(value))


def fields(name: str) -> list:
    """Return the tag and all fields of a message, a plan's checksum included."""
    _, row = MESSAGES[name]
    if row[0] == 8:
        return [*row, zlib.crc32(pack([*row, 0]))]
    if row[0] != 2:
        return row
    return [*row, zlib.crc32(pack([*row, 0, *LEASES])), *LEASES]


def text() -> str:
    """Return the lines of the golden file: name, kind of key, bytes in hexadecimal."""
    rows = [f"{name} {kind} {pack(fields(name)).hex()}" for name, (kind, _) in MESSAGES.items()]
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    FILE.write_text(text())
