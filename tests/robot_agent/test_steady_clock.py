from __future__ import annotations

from threading import Thread

from hypothesis import given
from hypothesis import strategies as st

from robot_agent.core.agent import LATE_TICK
from robot_agent.steady_clock import LEAP, SteadyClock

MS = 1_000_000


def readings(*values: int) -> list[int]:
    source = iter(values)
    clock = SteadyClock(lambda: next(source))
    return [clock() for _ in values[1:]]


def test_a_clock_that_runs_on_is_read_as_it_is():
    assert readings(5, 7, 7, 100 * MS) == [7, 7, 100 * MS]


def test_a_clock_that_was_set_back_goes_on_a_late_tick_after_where_it_was():
    assert LEAP > LATE_TICK
    assert readings(9_000 * MS, 9_010 * MS, 3_000 * MS, 3_010 * MS) == [
        9_010 * MS,
        9_010 * MS + LEAP,
        9_020 * MS + LEAP,
    ]


def test_threads_that_read_at_once_make_no_leap():
    assert readings(10 * MS, 20 * MS, 20 * MS - 1, 20 * MS) == [20 * MS, 20 * MS, 20 * MS]


def test_a_thread_that_loses_the_processor_amid_a_reading_makes_no_leap():
    times, other = iter((0, 10 * MS, 60 * MS)), Thread(target=lambda: clock())

    def read() -> int:
        now_ns = next(times)
        if now_ns == 10 * MS:
            other.start()
            other.join(0.05)
        return now_ns

    clock = SteadyClock(read)
    assert clock() == 10 * MS
    other.join()
    assert clock.read_before(60 * MS) == 60 * MS


@given(st.lists(st.integers(-(10**12), 10**12), min_size=2))
def test_the_time_never_falls(values):
    read = readings(*values)
    assert read == sorted(read)
