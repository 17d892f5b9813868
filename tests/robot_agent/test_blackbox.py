"""The time in black boxes: the coordinator's, whatever host the robot is on."""

from robot_agent.blackbox import CoordinatorTime
from robot_agent.clock_sync import ClockSync
from tests.robot_agent.rides import MS, SECOND


def exchanged(sync: ClockSync, now_ns: int, ahead_ns: int, there_ns: int, back_ns: int) -> None:
    """One exchange heard at now_ns with a coordinator whose clock is ahead."""
    sent_ns = now_ns - there_ns - back_ns
    heard_ns = sent_ns + there_ns + ahead_ns
    assert sync.add(sent_ns, heard_ns, heard_ns, now_ns)


def test_on_the_coordinators_host_the_time_is_the_hosts_own_to_the_nanosecond():
    sync, now_ns = ClockSync(), 10 * SECOND
    exchanged(sync, now_ns, 0, 5 * MS, MS)
    assert sync.offset_ns != 0
    assert CoordinatorTime(lambda: now_ns, sync).now() == now_ns


def test_on_another_host_the_time_is_the_coordinators_as_the_exchange_tells():
    sync, now_ns = ClockSync(), 10 * SECOND
    exchanged(sync, now_ns, -7 * SECOND, MS, MS)
    assert CoordinatorTime(lambda: now_ns, sync).now() == 3 * SECOND


def test_without_an_exchange_there_is_no_time_and_a_known_one_stays_when_it_is_forgotten():
    sync, now_ns = ClockSync(), 10 * SECOND
    time = CoordinatorTime(lambda: now_ns, sync)
    assert time.now() is None
    exchanged(sync, now_ns, 100 * SECOND, MS, MS)
    assert time.now() == 110 * SECOND
    sync.reset(now_ns)
    assert time.now() == 110 * SECOND


def test_the_time_never_runs_backwards_when_a_better_exchange_comes():
    sync, now_ns = ClockSync(), 10 * SECOND
    time = CoordinatorTime(lambda: now_ns, sync)
    exchanged(sync, now_ns, 100 * SECOND, 9 * MS, MS)
    before = time.now()
    exchanged(sync, now_ns, 100 * SECOND, MS, MS)
    assert sync.offset_ns + now_ns < before
    assert time.now() == before
