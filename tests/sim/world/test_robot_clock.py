from __future__ import annotations

from sim.world.robot_clock import RobotClock

SECOND = 10**9


class Truth:
    now = 100 * SECOND

    def __call__(self) -> int:
        return self.now


def test_a_clock_is_ahead_and_gains():
    truth = Truth()
    clock = RobotClock(truth, 3, 50)
    assert clock() == truth.now + 3
    truth.now += 2 * SECOND
    assert clock() == truth.now + 3 + 100_000


def test_a_stopped_clock_goes_on_from_where_it_stands():
    truth = Truth()
    clock = RobotClock(truth, 0, 0)
    clock.stop()
    truth.now += 6 * SECOND
    assert clock() == 100 * SECOND
    clock.go_on()
    clock.go_on()
    assert clock() == 100 * SECOND
    truth.now += 1
    assert clock() == 100 * SECOND + 1


def test_a_clock_can_be_set_while_it_runs_and_while_it_stands():
    truth = Truth()
    clock = RobotClock(truth, 0, 0)
    clock.set(-2 * SECOND)
    assert clock() == 98 * SECOND
    clock.stop()
    clock.set(5 * SECOND)
    clock.go_on()
    assert clock() == 103 * SECOND
