"""What the core takes on a Cortex-M4F at its default sizes."""

from __future__ import annotations

import re

import pytest

from tests.firmware.building import CORTEX_M4F, FIRMWARE, code_size, objects, state_size

pytestmark = pytest.mark.processes


@pytest.fixture(scope="module")
def files():
    return objects(CORTEX_M4F)  # A stack frame of more than 512 bytes is an error here.


def test_state_fits_12_kilobytes():
    assert state_size() <= 12 * 1024


def test_code_fits_13_kilobytes(files):
    assert sum(code_size(files).values()) <= 13 * 1024


def test_nothing_is_computed_in_double_precision(files):
    names = {name for file in files for name in re.findall(rb"__\w+", file.read_bytes())}
    assert names & {b"__aeabi_ldivmod"}
    assert not [name for name in names if re.match(rb"__aeabi_(d|cd|f2d|l2d|i2d|ui2d|ul2d)", name)]


def test_nothing_of_a_system_is_called(files):
    words = b" ".join(file.read_bytes() for file in files)
    assert not re.findall(rb"\b(malloc|free|printf|memcpy_s|time|exit)\b", words)


def test_the_public_header_is_short():
    assert len((FIRMWARE / "include" / "splinefleet.h").read_text().splitlines()) < 110
