"""Certificates read from their bytes, held against the cryptography package."""

import base64
import contextlib
import datetime
from itertools import pairwise

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import NameOID
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.security.certificate_authority import new_authority, new_certificate
from protocol.badge import Badge
from protocol.certificate import read_certificate

QUICK = settings(derandomize=True, max_examples=300, database=None, deadline=None)
BEGIN, END = b"-----BEGIN CERTIFICATE-----\n", b"\n-----END CERTIFICATE-----\n"
NOW = datetime.datetime(2026, 11, 21, 12, 0, 3, tzinfo=datetime.UTC)
AUTHORITY = new_authority(NOW)
LONG_AGO = NOW - datetime.timedelta(days=9000)
BADGES = [
    Badge("robot", "R1", 1),
    Badge("coordinator", "coordinator", 99),
    Badge("observer", 32 * "x", 7),
]
PAIRS = [
    AUTHORITY,
    *(new_certificate(AUTHORITY, badge, NOW, 1) for badge in BADGES),
    *(new_certificate(AUTHORITY, badge, LONG_AGO, 3650) for badge in BADGES),
]
FAR = new_certificate(new_authority(NOW, 40_000), Badge("robot", "R1", 1), NOW, 39_000)


@pytest.mark.parametrize("pair", [*PAIRS, FAR])
def test_names_and_times_are_those_that_another_reader_finds(pair):
    expected = x509.load_pem_x509_certificate(pair.certificate)
    found = read_certificate(pair.certificate)
    (name,) = expected.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    assert found.common_name == name.value
    assert found.begins == expected.not_valid_before_utc
    assert found.ends == expected.not_valid_after_utc
    assert found.issuer == expected.issuer.public_bytes()
    assert found.subject == expected.subject.public_bytes()
    assert found.der == expected.public_bytes(Encoding.DER)


def test_a_certificate_belongs_to_the_private_key_that_it_was_made_for_alone():
    for one, other in pairwise(PAIRS):
        assert read_certificate(one.certificate).belongs_to(one.private)
        assert not read_certificate(one.certificate).belongs_to(other.private)
        assert not read_certificate(one.certificate).belongs_to(one.certificate)
        assert not read_certificate(one.certificate).belongs_to(b"")


def test_an_authority_is_told_by_its_name():
    issuer = read_certificate(PAIRS[1].certificate).issuer
    assert issuer == read_certificate(AUTHORITY.certificate).subject
    assert issuer != read_certificate(new_authority(NOW).certificate).subject


def pem_of(der):
    return BEGIN + base64.encodebytes(der) + END


@QUICK
@given(st.binary(max_size=200))
def test_bytes_that_are_no_certificate_are_told_and_nothing_else_happens(content):
    for pem in (content, BEGIN + content + END, pem_of(content)):
        with pytest.raises(ValueError, match=r"."):
            read_certificate(pem)


@QUICK
@given(st.integers(0, 10_000), st.integers(1, 255), st.booleans())
def test_a_damaged_certificate_is_read_or_told(place, change, cut):
    der = bytearray(read_certificate(PAIRS[1].certificate).der)
    der[place % len(der)] ^= change
    with contextlib.suppress(ValueError):
        read_certificate(pem_of(bytes(der[: place % len(der)] if cut else der)))
