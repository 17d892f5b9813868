"""What programs that run for long tell on the terminal carries the time of day."""

import contextlib
import re
import signal
import time

import pytest

from tests.system.fleet_tools import TWO_ROBOTS, free_endpoint, line_with, splinefleet, started

TIMED = re.compile(r"(\d\d):(\d\d):(\d\d) \S")


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """The lines of every program of a fleet that has arrived, and when it began and ended."""
    folder = tmp_path_factory.mktemp("two")
    scenario, endpoint = folder / "two.toml", free_endpoint()
    scenario.write_text(TWO_ROBOTS)
    connect = f"--connect={endpoint}"
    began = time.time()
    with contextlib.ExitStack() as stack:
        programs = {
            name: stack.enter_context(started(*command))
            for name, command in {
                "coordinator": ("coordinator", scenario, f"--listen={endpoint}"),
                "record": ("record", connect, "-o", folder / "beside.mcap", "--wait=60"),
                "R1": ("agent", "R1", connect, "--wait=60"),
                "R2": ("agent", "R2", connect, "--wait=60"),
            }.items()
        }
        lines = {name: one.communicate(timeout=90.0)[1] for name, one in programs.items()}
        assert [one.returncode for one in programs.values()] == [0] * 4, lines
    return {name: text.splitlines() for name, text in lines.items()}, began, time.time()


@pytest.mark.parametrize(
    ("program", "said"),
    [("coordinator", "GO"), ("record", "two: recording into"), ("R1", "R1: moving")],
)
def test_every_line_of_a_program_that_runs_for_long_begins_with_the_time(told, program, said):
    lines, began, ended = told
    found = [TIMED.match(line) for line in lines[program]]
    assert all(found), lines[program]
    (line,) = (line for line in lines[program] if line[9:].startswith(said))
    seconds = range(int(began), int(ended) + 1)
    moments = {time.strftime("%H:%M:%S", time.localtime(second)) for second in seconds}
    assert line[:8] in moments


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_coordinator_that_is_ended_while_robots_drive_says_what_they_do_and_how_to_go_on(
    tmp_path, number
):
    scenario, endpoint, log = tmp_path / "two.toml", free_endpoint(), tmp_path / "run.mcap"
    scenario.write_text(TWO_ROBOTS)
    with contextlib.ExitStack() as stack:
        coordinator = stack.enter_context(
            started("coordinator", scenario, f"--listen={endpoint}", f"--log={log}", "--json")
        )
        line_with(coordinator, '"listening"', 60.0)
        for name in ("R1", "R2"):
            stack.enter_context(started("agent", name, f"--connect={endpoint}"))
        line_with(coordinator, "is moving", 40.0)
        coordinator.send_signal(number)
        line = line_with(coordinator, '"interrupted"', 20.0)
        assert coordinator.wait(20.0) == 130
    assert f"--resume {log}" in line
    assert splinefleet("verify", log).returncode == 0
