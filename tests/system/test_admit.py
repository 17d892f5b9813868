"""Robots that are lost and come back: started again (on an operator's word), or heard again."""

import contextlib
import json
import signal

from coordinator.scenario_files.scenario_reader import read_scenario
from sim.judging.blackbox import read_blackbox
from tests.system.fleet_tools import (
    free_endpoint,
    line_with,
    processes_of,
    splinefleet,
    started,
)
from tests.system.test_faults import ROBOTS, THREE_ROBOTS


def test_a_restarted_robot_is_taken_in_where_it_stands_and_arrives(tmp_path):
    scenario, endpoint = tmp_path / "three.toml", free_endpoint()
    scenario.write_text(THREE_ROBOTS)
    robots = {robot.id: robot for robot in read_scenario(scenario).robots}

    def agent(name, *more):
        limits = (f"--radius={robots[name].radius}", f"--max-accel={robots[name].max_accel}")
        box = f"--blackbox={tmp_path / f'{name}.csv'}"
        return started("agent", name, f"--connect={endpoint}", *limits, box, *more)

    log = tmp_path / "run.mcap"
    with contextlib.ExitStack() as stack:
        coordinator = stack.enter_context(
            started("coordinator", scenario, f"--listen={endpoint}", f"--log={log}", "--json")
        )
        line_with(coordinator, '"listening"', 60.0)
        agents = {name: stack.enter_context(agent(name)) for name in ROBOTS}
        line_with(coordinator, '"R3 is moving"', 40.0)
        agents["R3"].kill()
        line_with(coordinator, '"R3 has lost its link"', 30.0)
        box = read_blackbox(tmp_path / "R3.csv")
        x, y = box.places[-1] if len(box.t) else robots["R3"].start[:2]
        stack.enter_context(agent("R3", "--at", str(x), str(y), "1.5708"))
        line_with(coordinator, '"back"', 30.0)
        done = splinefleet("admit", "R3", f"--connect={endpoint}")
        assert done.returncode == 0, done.stderr
        summary = json.loads(line_with(coordinator, '"summary"', 60.0))
        assert coordinator.wait(20.0) == 0
    assert summary["arrived"]
    assert splinefleet("replay", log, "--check").returncode == 0
    verdict = json.loads(splinefleet("judge", tmp_path, "--json").stdout)
    assert verdict["collisions"] == 0
    assert all(one["arrived"] and one["tracking_error"] < 0.01 for one in verdict["robots"])
    assert all(one["clock_error"] is not None for one in verdict["robots"])
    assert processes_of(tmp_path) == []


def test_a_robot_that_hung_until_it_was_lost_goes_on_by_itself_and_arrives(tmp_path):
    scenario, endpoint = tmp_path / "three.toml", free_endpoint()
    scenario.write_text(THREE_ROBOTS)
    with contextlib.ExitStack() as stack:
        coordinator = stack.enter_context(
            started("coordinator", scenario, f"--listen={endpoint}", "--json")
        )
        line_with(coordinator, '"listening"', 60.0)
        agents = {
            name: stack.enter_context(started("agent", name, f"--connect={endpoint}"))
            for name in ROBOTS
        }
        line_with(coordinator, '"R3 is moving"', 40.0)
        agents["R1"].send_signal(signal.SIGSTOP)
        line_with(coordinator, '"R1 has lost its link"', 40.0)
        agents["R1"].send_signal(signal.SIGCONT)
        assert "R1 is heard again; it goes on" in line_with(coordinator, '"back"', 30.0)
        summary = json.loads(line_with(coordinator, '"summary"', 60.0))
        assert coordinator.wait(20.0) == 0
    assert summary["arrived"]
    assert processes_of(tmp_path) == []


def test_nobody_is_admitted_who_has_not_come_back(tmp_path):
    scenario, endpoint = tmp_path / "three.toml", free_endpoint()
    scenario.write_text(THREE_ROBOTS)
    with started("coordinator", scenario, f"--listen={endpoint}", "--json") as coordinator:
        line_with(coordinator, '"listening"', 60.0)
        done = splinefleet("admit", "R3", f"--connect={endpoint}", "--wait", "1.5")
        stranger = splinefleet("admit", "RX", f"--connect={endpoint}")
    assert done.returncode == stranger.returncode == 1
    assert "R3 has not come back: start its program first" in done.stderr
    assert "RX is not in fleet three, which has R1, R2, R3" in stranger.stderr
