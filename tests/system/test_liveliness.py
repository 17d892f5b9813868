"""Robots as real processes that die or hang, and how soon the link tells."""

import signal
import time

import pytest

from protocol import keys
from protocol.zenoh_transport import ZenohTransport
from tests.system.fleet_tools import free_endpoint, started, wait_for

KEY = keys.alive("f", "R1")


@pytest.fixture
def hall():
    """A coordinator that watches a robot's process: the process, and the changes with times."""
    endpoint, told = free_endpoint(), []
    with ZenohTransport.listen(endpoint) as coordinator:
        coordinator.watch_alive(
            keys.alive("f", "*"), lambda key, alive: told.append((key, alive, time.monotonic()))
        )
        with started("agent", "R1", f"--connect={endpoint}", "--fleet=f", "--quiet") as robot:
            wait_for(lambda: told)
            yield robot, told


def changes(told):
    return [(key, alive) for key, alive, _ in told]


def test_a_killed_robot_is_gone_long_before_any_lease_runs_out(hall):
    robot, told = hall
    began = time.monotonic()
    robot.send_signal(signal.SIGKILL)
    wait_for(lambda: len(told) == 2)
    assert changes(told) == [(KEY, True), (KEY, False)]
    assert told[1][2] - began < 0.3


def test_a_stopped_robot_is_gone_after_the_lease_and_back_when_it_goes_on(hall):
    robot, told = hall
    began = time.monotonic()
    robot.send_signal(signal.SIGSTOP)
    wait_for(lambda: len(told) == 2)
    assert 0.5 < told[1][2] - began < 5.0
    robot.send_signal(signal.SIGCONT)
    wait_for(lambda: len(told) == 3)
    assert changes(told) == [(KEY, True), (KEY, False), (KEY, True)]
