"""The driver of docs/driver.md does what a driver owes."""

import re
from math import pi
from pathlib import Path

import pytest

from robot_agent.driver_file import make_driver

PAGE = Path(__file__).parents[2] / "docs" / "driver.md"
TICK = 10_000_000


@pytest.fixture
def base(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    file = tmp_path / "base.py"
    file.write_text(code)
    driver = make_driver(f"{file}:Base", 0.5)
    driver.step(TICK)
    assert driver.pose() is None
    driver.place(1.0, 2.0, 0.0)
    return driver


def test_it_drives_at_the_speed_it_is_told(base):
    base.drive(1.0, 0.0, 1.0)
    base.step(3 * TICK)
    assert base.pose() == pytest.approx((1.02, 2.0, 0.0))


def test_it_stops_without_a_command_after_the_watchdogs_time(base):
    base.drive(1.0, 0.0, 1.0)
    base.step(3 * TICK)
    base.step(100 * TICK)
    base.step(200 * TICK)
    assert base.pose() == pytest.approx((1.05, 2.0, 0.0))


def test_it_never_goes_farther_than_told(base):
    base.drive(1.0, 0.0, 0.015)
    base.step(3 * TICK)
    base.step(5 * TICK)
    assert base.pose() == pytest.approx((1.015, 2.0, 0.0))


def test_a_positive_curvature_and_a_positive_angle_turn_left(base):
    base.drive(1.0, 2.0, 1.0)
    base.step(2 * TICK)
    assert base.pose()[2] == pytest.approx(0.02)
    base.turn(pi / 2)
    base.step(3 * TICK)
    base.step(4 * TICK)
    assert base.pose()[2] == pytest.approx(0.02 + pi / 2)


def test_stop_holds(base):
    base.drive(1.0, 0.0, 1.0)
    base.stop()
    base.step(3 * TICK)
    assert base.pose() == (1.0, 2.0, 0.0)
