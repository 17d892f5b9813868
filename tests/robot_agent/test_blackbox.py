"""Black boxes: which clock their times are of, and that nothing in them is ever lost."""

import os
from pathlib import Path

import pytest

from protocol.phases import MOVING
from robot_agent.blackbox import BlackBox
from sim.judging.blackbox import read_blackbox
from tests.robot_agent.core.rides import SECOND

HERE = (1.0, 2.0, 0.5)


@pytest.fixture
def one_machine(monkeypatch):
    """Every coordinator runs on the robot's machine."""
    monkeypatch.setattr("robot_agent.blackbox.shares_clock", lambda _boot: True)


def rows_of(path, *stamps, start=100.0):
    """Rows that were written at these times [s] of the host's clock and of the robot's estimate."""
    box = BlackBox(path)
    box.begin(7, round(start * SECOND))
    for host, estimate in stamps:
        estimate_ns = None if estimate is None else round(estimate * SECOND)
        box.write(round(host * SECOND), estimate_ns, HERE, 0.25, MOVING)
    box.close()
    return path.read_text().splitlines()[1:]


@pytest.mark.usefixtures("one_machine")
def test_on_the_coordinators_machine_t_is_the_hosts_time_whatever_the_robot_believes(
    tmp_path,
):
    assert rows_of(tmp_path / "R1.csv", (101.0, 98.0), (101.5, 101.5)) == [
        "1.000000,1.000000,2.000000,0.500000,0.250000,moving,-2.000000",
        "1.500000,1.000000,2.000000,0.500000,0.250000,moving,1.500000",
    ]


@pytest.mark.usefixtures("one_machine")
def test_on_the_coordinators_machine_t_never_runs_backwards_either(tmp_path):
    rows_of(tmp_path / "R1.csv", (101.0, 101.0), (100.9, 101.0), (101.1, 101.1))
    assert times_in(tmp_path / "R1.csv") == [1.0, 1.0, 1.1]


@pytest.mark.usefixtures("one_machine")
def test_a_robot_that_has_no_estimate_is_stamped_all_the_same_on_the_coordinators_machine(
    tmp_path,
):
    (row,) = rows_of(tmp_path / "R1.csv", (101.0, None))
    assert row == "1.000000,1.000000,2.000000,0.500000,0.250000,moving,"


def test_on_another_machine_t_is_the_robots_estimate_and_nothing_stands_beside_it(tmp_path):
    (row,) = rows_of(tmp_path / "R1.csv", (5000.0, 101.0))
    assert row == "1.000000,1.000000,2.000000,0.500000,0.250000,moving,"


def test_on_another_machine_t_goes_on_with_the_host_while_there_is_no_estimate(tmp_path):
    stamps = ((5000.0, None), (5001.0, 101.0), (5003.0, None), (5004.0, None))
    rows_of(tmp_path / "R1.csv", *stamps)
    assert times_in(tmp_path / "R1.csv") == [1.0, 3.0, 4.0]


def test_on_another_machine_t_never_runs_backwards_when_the_estimate_does(tmp_path):
    rows_of(tmp_path / "R1.csv", (5001.0, 101.0), (5001.1, 100.9), (5001.3, 101.1))
    assert times_in(tmp_path / "R1.csv") == [1.0, 1.0, 1.1]


@pytest.mark.usefixtures("one_machine")
def test_estimates_are_read_beside_the_time_and_tell_the_greatest_clock_error(
    tmp_path,
):
    path = tmp_path / "R1.csv"
    rows_of(path, (101.0, None), (102.0, 99.0), (103.0, 103.5))
    box = read_blackbox(path)
    assert box.t.tolist() == [1.0, 2.0, 3.0]
    assert box.estimates[1:].tolist() == [-1.0, 3.5]
    assert box.clock_error() == 3.0
    assert box.between(2.5, 9.0, 1.0).clock_error() == 0.5
    assert box.between(0.5, 1.5, 0.0).clock_error() is None


def test_boxes_without_estimates_are_read_and_tell_no_clock_error(tmp_path):
    path = tmp_path / "R1.csv"
    path.write_text("t,x,y,heading,s,phase\n0.5,1,2,0,0.25,moving\n")
    box = read_blackbox(path)
    assert (box.t.tolist(), box.places.tolist(), box.phases) == ([0.5], [[1.0, 2.0]], ("moving",))
    assert box.clock_error() is None


@pytest.mark.usefixtures("one_machine")
def test_a_last_estimate_cut_short_is_not_taken_for_a_whole_one(tmp_path):
    path = tmp_path / "R1.csv"
    rows_of(path, (101.0, 101.0), (112.0, 112.0))
    whole = path.read_text()
    for cut in range(1, 10):
        path.write_text(whole[:-cut])
        assert read_blackbox(path).clock_error() == 0.0


def a_box(path, boot: int, start_s: float, *times_s: float, end: str = "") -> None:
    """The box of one program: rows at these times, and what a kill left of one more."""
    box = BlackBox(path)
    box.begin(boot, round(start_s * SECOND))
    for time in times_s:
        now_ns = round(time * SECOND)
        box.write(now_ns, now_ns, (time, 0.0, 0.0), time, MOVING)
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
