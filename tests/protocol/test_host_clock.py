from __future__ import annotations

import time

import pytest

from protocol.host_clock import host_clock_ns


@pytest.mark.skipif(not hasattr(time, "CLOCK_BOOTTIME"), reason="the system has no such clock")
def test_the_hosts_clock_counts_the_time_that_it_was_suspended():
    before = time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    assert before <= host_clock_ns() <= time.clock_gettime_ns(time.CLOCK_BOOTTIME)
