"""A robot learns that its coordinator runs on the same machine while it runs, and only then."""

import os
import sys

import pytest

from protocol.shared_clock import announce_clock, shares_clock

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such names")


def test_a_clock_is_shared_with_the_coordinator_that_runs_here_and_with_no_other():
    boot = os.getpid()
    assert not shares_clock(boot)
    with announce_clock(boot):
        assert shares_clock(boot)
        assert not shares_clock(boot + 1)
    assert not shares_clock(boot)


def test_a_name_that_is_taken_stops_nobody():
    boot = os.getpid()
    with announce_clock(boot), announce_clock(boot):
        assert shares_clock(boot)


def test_clocks_of_different_time_namespaces_are_not_shared(monkeypatch):
    boot = os.getpid()
    with announce_clock(boot):
        here = os.stat("/proc/self/ns/time")
        other = os.stat_result((here.st_mode, here.st_ino + 1, *here[2:]))
        monkeypatch.setattr("os.stat", lambda _path: other)
        assert not shares_clock(boot)


def test_without_such_sockets_no_clock_is_shared_and_nothing_fails(monkeypatch):
    def refuse():
        raise OSError("address family not supported")

    monkeypatch.setattr("protocol.shared_clock._socket", refuse)
    with announce_clock(1):
        assert not shares_clock(1)
