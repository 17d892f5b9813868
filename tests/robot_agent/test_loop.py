from __future__ import annotations

import pytest

from robot_agent.loop import FixedRateLoop


class Times:
    """A clock and a sleep in virtual time."""

    def __init__(self) -> None:
        self.now = 1_000

    def clock(self) -> int:
        return self.now

    def sleep(self, ns: int) -> None:
        self.now += ns


def run_ticks(durations: list[int], period: int = 100) -> tuple[FixedRateLoop, list[int]]:
    times, began = Times(), []
    left = list(durations)

    def tick(now_ns: int) -> bool:
        began.append(now_ns)
        times.now += left.pop(0)
        return bool(left)

    loop = FixedRateLoop(tick, (), times.clock, times.sleep, period)
    loop.run()
    return loop, began


def test_ticks_begin_at_multiples_of_the_period_however_long_they_take():
    loop, began = run_ticks([10, 99, 0, 50])
    assert began == [1_000, 1_100, 1_200, 1_300]
    assert loop.overruns == 0


def test_an_overrun_is_counted_and_made_up_for_at_once():
    loop, began = run_ticks([10, 130, 10, 10])
    assert began == [1_000, 1_100, 1_230, 1_300]
    assert loop.overruns == 1


def test_deadlines_that_have_gone_by_are_left_out():
    loop, began = run_ticks([10, 550, 10, 10])
    assert began == [1_000, 1_100, 1_650, 1_700]
    assert loop.overruns == 1


def test_a_failed_tick_calls_every_rescue_and_the_loop_goes_on():
    times, seen = Times(), []

    def tick(_now_ns: int) -> bool:
        if len(seen) < 4:
            raise ZeroDivisionError("motor")
        return False

    def broken(error: Exception) -> None:
        seen.append("stop")
        raise OSError(str(error))

    loop = FixedRateLoop(
        tick, (broken, lambda error: seen.append(str(error))), times.clock, times.sleep
    )
    loop.run()
    assert seen == ["stop", "motor"] * 2
    assert loop.failures == 4


def test_an_interrupt_ends_the_loop():
    def tick(_now_ns: int) -> bool:
        raise KeyboardInterrupt

    times = Times()
    with pytest.raises(KeyboardInterrupt):
        FixedRateLoop(tick, (), times.clock, times.sleep).run()
