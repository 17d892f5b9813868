"""The messages of a robot, read and written without a msgpack library (docs/protocol.md).

Decides: which bytes are acceptable.  Must not know: what a message makes a robot do.  It runs in
MicroPython, as part of the bundle, and in CPython.
"""

from binascii import crc32
from math import inf
from struct import pack, unpack_from

LONGEST = 4_000
PLAN = 2
COMMAND = 3
CLOCK = 5
REFUSAL = 6

_DEEPEST = 6
_UNKNOWN = ()
"""What stands for a map or an ext: no known field has one."""

_SIZES = (1, 2, 4, 1, 2, 4, 4, 8, 1, 2, 4, 8, 1, 2, 4, 8, 0, 0, 0, 0, 0, 1, 2, 4, 2, 4, 2, 4)
"""How many bytes follow each mark from 0xC4 on: a number, or a length."""

_U32 = (0, (1 << 32) - 1)
_PLAN_TIME = (-(1 << 31), (1 << 31) - 1)
_STAMP = (-(1 << 62), 1 << 62)
_DURATION = (0, 10**12)
_U16 = (0, 65_535)

_FIELDS = {
    ("command", COMMAND): (_U32, _U32, _U32, _U32, (0, 4), _STAMP, _STAMP, _PLAN_TIME),
    ("clock", CLOCK): (_U32, _STAMP, _STAMP, _STAMP, _U32),
    ("plan", REFUSAL): (_U32, None),
    ("plan", PLAN): (
        (_U32, _U32, None, _U32, _U32, _PLAN_TIME, _DURATION, _U16, _U32, (1, 65_535), (1, 7))
        + (None,) * 6
    ),
}
"""The kind of key and the tag of each message, and the limits of its first integers."""


def read(kind: str, payload: bytes) -> list | None:
    """Return the tag and the fields of a message; None when it is not acceptable.

    `kind`: the kind of its key.  Fields that were left out have the values that they count as.
    """
    try:
        return _checked(kind, payload)
    except (ValueError, IndexError, TypeError, UnicodeError):
        return None


def _checked(kind: str, payload: bytes) -> list | None:
    if not 1 < len(payload) <= LONGEST:
        return None
    fields, end = _value(payload, 0, 0)
    if end != len(payload) or not isinstance(fields, list) or isinstance(fields[0], bool):
        return None
    limits = _FIELDS.get((kind, fields[0]))
    if limits is None:
        return None
    _complete(fields)
    for i, limit in enumerate(limits):
        may_be_null = fields[0] == CLOCK and i in (2, 3)
        if limit is not None and not (may_be_null and fields[i + 1] is None):
            _check(fields[i + 1], limit)
    if fields[0] == COMMAND:
        _check_command(fields)
    elif fields[0] == PLAN:
        _check_plan(fields, payload)
    elif fields[0] == REFUSAL and (not isinstance(fields[2], str) or len(fields[2]) > 200):
        return None
    return fields


def _complete(fields: list) -> None:
    """Add what the fields that were left out count as."""
    count = len(fields)
    if fields[0] == COMMAND and count >= 8:
        fields += [0, [], 0, _U32[1], [], 0][count - 8 :] if count < 14 else []
    elif fields[0] == CLOCK and count >= 3:
        fields += [None, None, 0][count - 3 :] if count < 6 else []


def _check(value: object, limit: tuple[int, int]) -> None:
    if not isinstance(value, int) or isinstance(value, bool):
        raise ValueError
    if not limit[0] <= value <= limit[1]:
        raise ValueError


def _check_command(fields: list) -> None:
    held, wanted = fields[9], fields[12]
    for number in (fields[10], fields[11], fields[13]):
        _check(number, _U32)
    if len(held) > 120 or len(wanted) > 60 or not isinstance(held, list):
        raise ValueError
    for pair in held:
        if len(pair) != 2 or not isinstance(pair, list):
            raise ValueError
        _check(pair[0], _U32)
        _check(pair[1], _PLAN_TIME)
    if not isinstance(wanted, list):
        raise ValueError
    for name in wanted:
        _check_name(name)


def _check_name(name: object) -> None:
    if not isinstance(name, str) or not 0 < len(name) <= 32:
        raise ValueError
    for letter in name:
        if letter not in "_.-" and not ("0" <= letter <= "9" or "A" <= letter.upper() <= "Z"):
            raise ValueError
        if letter > "z":
            raise ValueError


def _check_plan(fields: list, payload: bytes) -> None:
    if len(fields) < 19 or payload[-5:] != pack(">BI", 0xCE, crc32(payload[:-5])):
        raise ValueError
    _check_name(fields[3])
    for packed in fields[12:18]:
        if not isinstance(packed, bytes) or len(packed) > 3_600:
            raise ValueError
    unpack_plan(fields)


def _value(payload: bytes, at: int, depth: int) -> tuple[object, int]:
    """Return the value that begins at an index, and where it ends; ValueError if there is none."""
    mark = payload[at]
    at += 1
    if mark < 0x80 or mark >= 0xE0:
        return mark if mark < 0x80 else mark - 256, at
    if mark < 0xC0:
        if mark >= 0xA0:
            return _bytes(payload, at, mark & 31, True)
        return _array(payload, at, mark & 15, depth, mark < 0x90)
    if mark in (0xC0, 0xC2, 0xC3):
        return None if mark == 0xC0 else mark == 0xC3, at
    if 0xCA <= mark <= 0xD3:
        size = _SIZES[mark - 0xC4]
        _within(payload, at + size)
        return unpack_from(">" + "fdBHIQbhiq"[mark - 0xCA], payload, at)[0], at + size
    if 0xD4 <= mark <= 0xD8:
        return _skipped(payload, at + 1 + (1 << (mark - 0xD4)))
    if mark == 0xC1:
        raise ValueError
    return _long(payload, at, mark, depth)


def _long(payload: bytes, at: int, mark: int, depth: int) -> tuple[object, int]:
    """Return a value whose head states its length."""
    end = at + _SIZES[mark - 0xC4]
    _within(payload, end)
    count = 0
    while at < end:
        count = count << 8 | payload[at]
        at += 1
    if mark <= 0xC6:
        return _bytes(payload, at, count, False)
    if mark <= 0xC9:
        return _skipped(payload, at + 1 + count)
    if mark <= 0xDB:
        return _bytes(payload, at, count, True)
    return _array(payload, at, count, depth, mark > 0xDD)


def _within(payload: bytes, end: int) -> None:
    if end > len(payload):
        raise ValueError


def _skipped(payload: bytes, end: int) -> tuple[object, int]:
    _within(payload, end)
    return _UNKNOWN, end


def _bytes(payload: bytes, at: int, count: int, is_text: bool) -> tuple[object, int]:
    _within(payload, at + count)
    part = payload[at : at + count]
    return str(part, "utf-8") if is_text else part, at + count


def _array(payload: bytes, at: int, count: int, depth: int, is_map: bool) -> tuple[object, int]:
    """Return the values of an array; a map is skipped."""
    if depth > _DEEPEST:
        raise ValueError
    count = 2 * count if is_map else count
    _within(payload, at + count)
    values = []
    for _ in range(count):
        value, at = _value(payload, at, depth + 1)
        values.append(value)
    return _UNKNOWN if is_map else values, at


def _floats(packed: bytes, step: int = 4, at: int = 0) -> list[float]:
    """Return the float32 at an offset in each `step` bytes; ValueError for incomplete ones."""
    if len(packed) % step:
        raise ValueError
    values = [unpack_from("<f", packed, i + at)[0] for i in range(0, len(packed), step)]
    for value in values:
        if not -inf < value < inf:
            raise ValueError
    return values


def unpack_plan(fields: list) -> tuple:
    """Return the rules, the path and the motion of a Plan, as Agent.hear_plan takes them."""
    degree, packed, weights = fields[11], fields[12], fields[14]
    knots = _floats(fields[13]) or [0.0]
    xs, ys, speeds = _floats(packed, 8), _floats(packed, 8, 4), _floats(fields[15])
    profile, stops = fields[16], fields[17]
    knots_s, stops_s = _floats(profile, 5), _floats(stops, 12)
    knots_v = [speeds[profile[5 * i + 4]] for i in range(len(knots_s))]
    departs = [unpack_from("<q", stops, 12 * i + 4)[0] / 1e9 for i in range(len(stops_s))]
    if fields[9]:
        for s in stops_s:
            place = 0
            while place < len(knots_s) and (knots_s[place], knots_v[place]) < (s, 0.0):
                place += 1
            if s > 0.0:
                knots_s.insert(place, s)
                knots_v.insert(place, 0.0)
    ends = [0.0] * (degree + 1), [knots[-1]] * (degree + 1)
    return (
        (fields[8], fields[9], fields[10] * 1_000_000),
        (degree, ends[0] + knots[:-1] + ends[1], xs, ys, _floats(weights) or [1.0] * len(xs)),
        (knots_s, knots_v, stops_s, departs, fields[6] / 1000.0),
    )


def written(fields: list | tuple) -> bytes:
    """Return the bytes of a message of fewer than 16 fields: null, numbers, and lists of them."""
    parts = [bytes([0x90 + len(fields)])]
    for value in fields:
        if value is None:
            parts.append(b"\xc0")
        elif isinstance(value, float):
            parts.append(pack(">Bd", 0xCB, value))
        elif isinstance(value, (list, tuple)):
            parts.append(written(value))
        else:
            parts.append(_integer(value))
    return b"".join(parts)


def _integer(value: int) -> bytes:
    """Return an integer in its shortest form."""
    if -32 <= value < 128:
        return bytes([value & 255])
    if value > 0:
        for mark, form, size in ((0xCC, ">BB", 8), (0xCD, ">BH", 16), (0xCE, ">BI", 32)):
            if value < 1 << size:
                return pack(form, mark, value)
        return pack(">BQ", 0xCF, value)
    for mark, form, size in ((0xD0, ">Bb", 7), (0xD1, ">Bh", 15), (0xD2, ">Bi", 31)):
        if value >= -(1 << size):
            return pack(form, mark, value)
    return pack(">Bq", 0xD3, value)
