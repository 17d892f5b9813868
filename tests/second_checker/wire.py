"""The bytes of a Plan message, read by hand: MessagePack, the seal, the packed fields.

Decides: what the bytes say.  Must not know: the product's reader.
"""

import struct
import zlib
from dataclasses import dataclass
from fractions import Fraction

TAG = 2
SEAL_BYTES = 5
_SIZED = {0xC4: ">B", 0xC5: ">H", 0xC6: ">I", 0xD9: ">B", 0xDA: ">H"}
_NUMBERS = {0xCC: ">B", 0xCD: ">H", 0xCE: ">I", 0xCF: ">Q"}
_SIGNED = {0xD0: ">b", 0xD1: ">h", 0xD2: ">i", 0xD3: ">q"}


@dataclass(frozen=True)
class Message:
    """A Plan as sent: SI units, exact numbers."""

    robot: str
    begin: Fraction
    tau: Fraction
    track: Fraction
    brake: Fraction
    degree: int
    knots: list[Fraction]
    points: list[tuple[Fraction, Fraction]]
    weights: list[Fraction]
    profile: list[tuple[Fraction, Fraction]]
    stops: list[tuple[Fraction, Fraction]]


def read(payload):
    """Return the Message; ValueError when the bytes are not one."""
    seal = b"\xce" + struct.pack(">I", zlib.crc32(payload[:-SEAL_BYTES]))
    if payload[-SEAL_BYTES:] != seal:
        raise ValueError("the seal does not fit the bytes")
    fields = _array(payload)
    tag, _, _, robot, _, _, begin, tau, track, brake, _, degree, *packed, _ = fields
    if tag != TAG:
        raise ValueError(f"tag {tag} is not that of a Plan")
    points, inner, weights, speeds, profile, stops = packed
    points = [(Fraction(x), Fraction(y)) for x, y in struct.iter_unpack("<ff", points)]
    inner = [Fraction(one) for (one,) in struct.iter_unpack("<f", inner)]
    weights = [Fraction(one) for (one,) in struct.iter_unpack("<f", weights)]
    speeds = [Fraction(one) for (one,) in struct.iter_unpack("<f", speeds)]
    knots = [(Fraction(s), speeds[k]) for s, k in struct.iter_unpack("<fB", profile)]
    stops = [(Fraction(s), Fraction(t, 10**9)) for s, t in struct.iter_unpack("<fq", stops)]
    if brake:
        knots = sorted(knots + [(s, Fraction(0)) for s, _ in stops if s > 0])
    ends = degree + 1
    return Message(
        robot=robot,
        begin=Fraction(begin, 1000),
        tau=Fraction(tau, 10**9),
        track=Fraction(track, 1000),
        brake=Fraction(brake, 1000),
        degree=degree,
        knots=[Fraction(0)] * ends + inner[:-1] + [inner[-1]] * ends,
        points=points,
        weights=weights or [Fraction(1)] * len(points),
        profile=knots,
        stops=stops,
    )


def _array(data):
    """Return the elements of a MessagePack array of integers, texts and byte strings."""
    if data[0] != 0xDC:
        raise ValueError("a Plan is an array of 16 elements or more")
    (count,) = struct.unpack_from(">H", data, 1)
    at, found = 3, []
    for _ in range(count):
        value, at = _element(data, at)
        found.append(value)
    if at != len(data):
        raise ValueError(f"{len(data) - at} bytes follow the array")
    return found


def _element(data, at):
    mark = data[at]
    if mark < 0x80:
        return mark, at + 1
    if mark >= 0xE0:
        return mark - 256, at + 1
    if 0xA0 <= mark < 0xC0:
        end = at + 1 + (mark & 31)
        return data[at + 1 : end].decode(), end
    form = _SIZED.get(mark) or _NUMBERS.get(mark) or _SIGNED.get(mark)
    if form is None:
        raise ValueError(f"no element begins with {mark:#x}")
    (number,) = struct.unpack_from(form, data, at + 1)
    at += 1 + struct.calcsize(form)
    if mark not in _SIZED:
        return number, at
    value = data[at : at + number]
    return (value.decode() if mark >= 0xD9 else value), at + number
