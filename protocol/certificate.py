"""What a certificate of a fleet says, read from its bytes (RFC 5280, DER in PEM).

Decides: how names and times are found in a certificate.  Must not know: files, or whether the
certificate is to be trusted: TLS decides that.  The cryptography package could read certificates
too, but it takes longer to load than everything else that a robot needs for its link.
"""

from __future__ import annotations

import binascii
import datetime
import re
from typing import Final, NamedTuple

_PEM: Final = re.compile(rb"-----BEGIN ([A-Z ]+)-----\s+([A-Za-z0-9+/=\s]+)-----END \1-----")
_COMMON_NAME: Final = bytes((0x55, 0x04, 0x03))
_VERSION, _SHORT_TIME, _LONG_TIME = 0xA0, 0x17, 0x18
_POINT: Final = 65
"""Bytes of a public point of the curve P-256: the end of every private key of this project."""


class Certificate(NamedTuple):
    """A certificate: issuer and subject (names as DER), common name, and validity (UTC)."""

    issuer: bytes
    subject: bytes
    common_name: str
    begins: datetime.datetime
    ends: datetime.datetime
    der: bytes

    def belongs_to(self, private: bytes) -> bool:
        """Return whether it was made for this private key (PEM, as `splinefleet keys` writes)."""
        try:
            point = _der(private, b"PRIVATE KEY")[-_POINT:]
        except ValueError:
            return False
        return len(point) == _POINT and point in self.der


class _Element(NamedTuple):
    tag: int
    whole: bytes
    content: bytes


def read_certificate(pem: bytes) -> Certificate:
    """Read a certificate.

    Raises ValueError when the bytes are not a certificate with exactly one common name.
    """
    der = _der(pem, b"CERTIFICATE")
    try:
        ((_, _, outer),) = _elements(der)
        fields = _elements(_elements(outer)[0].content)
        if fields[0].tag == _VERSION:
            del fields[0]
        _, _, issuer, validity, subject = fields[:5]
        begins, ends = (_time(one) for one in _elements(validity.content))
        (name,) = _common_names(subject)
    except IndexError:
        raise ValueError("a certificate ends too soon") from None
    return Certificate(issuer.whole, subject.whole, name, begins, ends, der)


def _der(pem: bytes, kind: bytes) -> bytes:
    found = _PEM.search(pem)
    if found is None or found[1] != kind:
        raise ValueError(f"this is not the PEM of a {kind.decode().lower()}")
    return binascii.a2b_base64(found[2])


def _elements(content: bytes) -> list[_Element]:
    """Return the DER elements that follow one another in the content."""
    found, at = [], 0
    while at < len(content):
        begin, length = at + 2, content[at + 1]
        if length >= 0x80:
            begin += length - 0x80
            length = int.from_bytes(content[at + 2 : begin])
        end = begin + length
        if end > len(content):
            raise ValueError("an element is longer than what holds it")
        found.append(_Element(content[at], content[at:end], content[begin:end]))
        at = end
    return found


def _common_names(name: _Element) -> list[str]:
    pairs = [
        _elements(pair.content)
        for part in _elements(name.content)
        for pair in _elements(part.content)
    ]
    return [value.content.decode() for kind, value in pairs if kind.content == _COMMON_NAME]


def _time(element: _Element) -> datetime.datetime:
    text = element.content.decode("ascii")
    if element.tag == _SHORT_TIME:
        text = ("19" if text[:2] >= "50" else "20") + text
    elif element.tag != _LONG_TIME:
        raise ValueError("a time in an unknown format")
    if re.fullmatch(r"\d{14}Z", text) is None:
        raise ValueError(f"{text!r} is not a time")
    parts = [text[:4], *(text[at : at + 2] for at in range(4, 14, 2))]
    year, *others = map(int, parts)
    month, day, hour, minute, second = others
    return datetime.datetime(year, month, day, hour, minute, second, tzinfo=datetime.UTC)
