"""Black boxes: their time is the coordinator's, and nothing in them is ever lost."""

import os
from pathlib import Path

from protocol.phases import MOVING
from robot_agent.blackbox import BlackBox, CoordinatorTime
from robot_agent.clock_sync import ClockSync
from sim.blackbox import read_blackbox
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
    sync.start_over(now_ns)
    assert time.now() == 110 * SECOND


def test_the_time_never_runs_backwards_when_a_better_exchange_comes():
    sync, now_ns = ClockSync(), 10 * SECOND
    time = CoordinatorTime(lambda: now_ns, sync)
    exchanged(sync, now_ns, 100 * SECOND, 9 * MS, MS)
    before = time.now()
    exchanged(sync, now_ns, 100 * SECOND, MS, MS)
    assert sync.offset_ns + now_ns < before
    assert time.now() == before


def a_box(path, boot: int, start_s: float, *times_s: float, end: str = "") -> None:
    """The box of one program: rows at these times, and what a kill left of one more."""
    box = BlackBox(path)
    box.begin(boot, round(start_s * SECOND))
    for time in times_s:
        box.write(round(time * SECOND), (time, 0.0, 0.0), time, MOVING)
    box.close()
    with path.open("a") as file:
        file.write(end)


def times_in(path) -> list[float]:
    return read_blackbox(path).t.tolist()


def test_a_robot_that_is_started_again_in_the_same_run_goes_on_in_its_black_box(tmp_path):
    path = tmp_path / "R1.csv"
    a_box(path, 7, 10.0, 10.0, 10.5, end="0.6,1.0,2")
    BlackBox(path).close()
    a_box(path, 7, 30.0, 29.0, 31.0)
    a_box(path, 7, 40.0, 42.0)
    assert times_in(path) == [0.0, 0.5, 19.0, 21.0, 32.0]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["R1.csv", "R1.csv.start"]


def test_the_black_box_of_another_run_is_kept_beside_the_new_one(tmp_path):
    path = tmp_path / "R1.csv"
    a_box(path, 7, 10.0, 10.5)
    a_box(path, 8, 20.0, 21.0)
    a_box(path, 9, 30.0, 32.0)
    assert [times_in(tmp_path / f"R1.csv{number}") for number in (".1", ".2", "")] == [
        [0.5],
        [1.0],
        [2.0],
    ]


def test_a_robot_killed_before_its_first_row_goes_on_counting_from_the_first_go(tmp_path):
    path = tmp_path / "R1.csv"
    a_box(path, 7, 10.0, 10.5)
    a_box(path, 8, 20.0)
    a_box(path, 8, 25.0, 26.0)
    assert times_in(path) == [6.0]
    assert times_in(tmp_path / "R1.csv.1") == [0.5]


def test_a_black_box_may_be_no_file():
    a_box(Path(os.devnull), 7, 10.0, 10.5)
    assert not Path(f"{os.devnull}.start").exists()
