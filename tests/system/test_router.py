"""Coordinators and robots as clients of a router that was there before, each a process."""

import contextlib
import json
import signal
import time

import pytest

from coordinator.log.log_file import read_log
from coordinator.scenario_files.scenario_reader import read_scenario
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Command
from protocol.zenoh_transport import ZenohTransport
from sim.judging.judge import judge
from tests.system.fleet_tools import (
    TWO_ROBOTS,
    free_endpoint,
    line_with,
    processes_of,
    splinefleet,
    started,
    wait_for,
)
from tests.system.router import router
from tests.system.test_faults import ROBOTS, THREE_ROBOTS
from tests.system.test_refusals import only_line

SOON_S = 0.5
"""How soon a killed robot is named; silence alone would take longer."""


class Hall:
    """A router, and the fleets that meet at it; everything is ended with the stack."""

    def __init__(self, stack, folder):
        self.stack, self.folder = stack, folder
        self.endpoint = free_endpoint()
        self.start_router()

    def start_router(self):
        self.router = self.stack.enter_context(router(self.endpoint))

    def scenario(self, name, text):
        file = self.folder / f"{name}.toml"
        file.write_text(text)
        return file

    def coordinator(self, scenario, log, *more):
        process = self.stack.enter_context(
            started(
                *("coordinator", scenario, f"--connect={self.endpoint}", f"--log={log}"),
                *("--json", *more),
            )
        )
        line_with(process, '"listening"', 60.0)
        return process

    def agents(self, scenario, box):
        box.mkdir()
        asked = read_scenario(scenario)
        return {
            one.id: self.stack.enter_context(
                started(
                    *("agent", one.id, f"--connect={self.endpoint}", f"--fleet={asked.name}"),
                    *(f"--max-accel={one.max_accel}", f"--blackbox={box / f'{one.id}.csv'}"),
                    *("--give-up=60", "--quiet"),
                )
            )
            for one in asked.robots
        }


@pytest.fixture
def hall(tmp_path):
    with contextlib.ExitStack() as stack:
        yield Hall(stack, tmp_path)
    assert processes_of(tmp_path) == []


@pytest.fixture
def three(hall):
    """Three robots under way through the router: hall, coordinator, agents."""
    scenario = hall.scenario("three", THREE_ROBOTS)
    coordinator = hall.coordinator(scenario, hall.folder / "run.mcap")
    agents = hall.agents(scenario, hall.folder / "blackbox")
    line_with(coordinator, '"R3 is moving"', 40.0)
    return hall, coordinator, agents


def summary_of(coordinator):
    summary = json.loads(line_with(coordinator, '"summary"', 60.0))
    coordinator.wait(20.0)
    return summary


def arrived(summary):
    return {robot["id"] for robot in summary["robots"] if robot["arrived"] is not None}


def epochs_of(log):
    commands = (decode("command", one.payload) for one in read_log(log).records)
    return {command.epoch for command in commands if isinstance(command, Command)}


def log_agrees(log):
    done = splinefleet("replay", log, "--check")
    assert done.returncode == 0, done.stderr


def test_a_fleet_arrives_through_a_router_and_is_recorded_beside(hall):
    scenario = hall.scenario("two", TWO_ROBOTS)
    log, beside = hall.folder / "run.mcap", hall.folder / "beside.mcap"
    coordinator = hall.coordinator(scenario, log)
    with started("record", f"--connect={hall.endpoint}", "-o", beside) as recorder:
        wait_for(beside.exists)
        hall.agents(scenario, hall.folder / "blackbox")
        assert summary_of(coordinator)["arrived"]
        assert recorder.wait(20.0) == 0
    assert judge(hall.folder).collisions == 0
    assert {r.key for r in read_log(beside).records} >= {"splinefleet/two/command"}
    log_agrees(log)


def test_two_fleets_at_one_router_hear_nothing_of_each_other(hall):
    runs = {}
    for name in ("east", "west"):
        text = TWO_ROBOTS.replace('name = "two"', f'name = "{name}"')
        scenario = hall.scenario(name, text)
        runs[name] = (hall.coordinator(scenario, hall.folder / f"{name}.mcap"), scenario)
    for name, (_, scenario) in runs.items():
        hall.agents(scenario, hall.folder / f"box-{name}")
    for name, (coordinator, _) in runs.items():
        summary = summary_of(coordinator)
        assert summary["arrived"]
        assert summary["bad_messages"] == 0
        said = {
            record.key.split("/")[1] for record in read_log(hall.folder / f"{name}.mcap").records
        }
        assert said == {name}


def test_of_two_coordinators_of_one_fleet_the_lower_boot_id_ends_and_says_so(hall):
    scenario = hall.scenario("two", TWO_ROBOTS)
    both = [hall.coordinator(scenario, hall.folder / f"{name}.mcap") for name in "ab"]
    boots = []
    for name in "ab":
        log = hall.folder / f"{name}.mcap"
        wait_for(lambda log=log: log.stat().st_size > 5_000)
        boots.append(int(read_log(log).metadata["boot"]))
    lower, higher = both if boots[0] < boots[1] else reversed(both)
    assert "another coordinator leads" in line_with(lower, '"superseded"', 10.0)
    assert lower.wait(10.0) == 1
    hall.agents(scenario, hall.folder / "blackbox")
    assert summary_of(higher)["arrived"]


def test_a_robot_killed_behind_the_router_is_named_at_once_and_the_others_go_on(three):
    hall, coordinator, agents = three
    killed = time.monotonic()
    agents["R3"].kill()
    line_with(coordinator, '"R3 has lost its link"', 5.0)
    assert time.monotonic() - killed < SOON_S
    assert arrived(summary_of(coordinator)) == {"R1", "R2"}
    assert judge(hall.folder).collisions == 0
    log_agrees(hall.folder / "run.mcap")


def test_a_fleet_whose_router_dies_goes_on_in_the_same_epoch_when_it_is_back(three):
    hall, coordinator, _ = three
    hall.router.kill()
    line_with(coordinator, '"the router is gone"', 5.0)
    hall.router.wait(5.0)
    hall.start_router()
    line_with(coordinator, '"the router is back"', 10.0)
    assert arrived(summary_of(coordinator)) == set(ROBOTS)
    assert epochs_of(hall.folder / "run.mcap") == {1}
    assert judge(hall.folder).collisions == 0
    log_agrees(hall.folder / "run.mcap")


def test_a_fleet_whose_router_hangs_goes_on_in_the_same_epoch_when_it_does(three):
    hall, coordinator, _ = three
    hall.router.send_signal(signal.SIGSTOP)
    line_with(coordinator, '"the router is gone"', 20.0)
    hall.router.send_signal(signal.SIGCONT)
    assert arrived(summary_of(coordinator)) == set(ROBOTS)
    assert epochs_of(hall.folder / "run.mcap") == {1}
    assert judge(hall.folder).collisions == 0
    log_agrees(hall.folder / "run.mcap")


def test_a_coordinator_that_dies_behind_the_router_is_gone_on_for_from_its_log(three):
    hall, coordinator, _ = three
    coordinator.send_signal(signal.SIGKILL)
    coordinator.wait(5.0)
    resumed = hall.coordinator(
        hall.folder / "three.toml",
        hall.folder / "run-2.mcap",
        f"--resume={hall.folder / 'run.mcap'}",
    )
    assert arrived(summary_of(resumed)) == set(ROBOTS)
    assert judge(hall.folder).collisions == 0
    log_agrees(hall.folder / "run-2.mcap")


def test_a_run_at_a_router_bears_a_cut_network_and_a_restarted_coordinator(hall):
    scenario = hall.scenario("three", THREE_ROBOTS)
    faults = ("--fault=cut:R3@1:3", "--fault=coordinator-restart@6")
    out = hall.folder / "run"
    done = splinefleet("run", scenario, f"--connect={hall.endpoint}", f"--out={out}", *faults)
    assert done.returncode == 0, done.stderr
    assert judge(out).collisions == 0
    log_agrees(sorted(out.glob("run*.mcap"))[0])


def test_an_operator_and_a_page_reach_the_fleet_through_the_router(hall):
    scenario = hall.scenario("two", TWO_ROBOTS)
    hall.coordinator(scenario, hall.folder / "run.mcap")
    done = splinefleet("admit", "RX", f"--connect={hall.endpoint}")
    assert "RX is not in fleet two" in only_line(done, code=1)
    with started("view", f"--connect={hall.endpoint}", "--no-open") as page:
        assert "http://127.0.0.1" in line_with(page, "http")


def test_an_operator_who_names_no_fleet_speaks_to_one_alone(hall):
    heard = []
    hold = encode(Command(1, 1, 1, 1, 0, 0, 0))
    with ZenohTransport.connect(hall.endpoint) as fleets:
        fleets.subscribe(keys.admit("*", "*"), lambda key, _p, _t: heard.append(key))
        with started("admit", "R1", f"--connect={hall.endpoint}", "--wait=3") as operator:

            def ended():
                for name in ("east", "west"):
                    fleets.put(keys.command(name), hold)
                return operator.poll() is not None

            wait_for(ended)
            assert operator.wait() == 1
    assert len(heard) > 1
    assert len(set(heard)) == 1


@pytest.mark.parametrize("command", ["coordinator", "run"])
def test_a_router_that_does_not_answer_is_told_in_one_line_in_time(tmp_path, command):
    scenario, nobody = tmp_path / "two.toml", free_endpoint()
    scenario.write_text(TWO_ROBOTS)
    out = [f"--out={tmp_path}"] if command == "run" else []
    done = splinefleet(command, scenario, f"--connect={nobody}", *out, timeout=60.0)
    assert only_line(done, code=1) == f"{nobody}: nobody answers; is the router running?"


@pytest.mark.parametrize(
    "options", [["--connect=udp/x"], ["--connect=tcp/a:1", "--listen=tcp/b:2"]]
)
def test_a_bad_place_to_meet_is_told_in_one_line(tmp_path, options):
    scenario = tmp_path / "two.toml"
    scenario.write_text(TWO_ROBOTS)
    line = only_line(splinefleet("coordinator", scenario, *options))
    assert "udp/x" in line or "--connect" in line
