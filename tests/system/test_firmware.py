"""Firmware in the loop: robots whose core is the C agent, in processes of their own, over Zenoh."""

import json

import pytest

from coordinator.log.log_file import read_log
from protocol.codec import decode
from sim.judging.blackbox import read_blackbox
from tests.firmware.building import IN_PARTS, host
from tests.system.fleet_tools import ROOT, processes_of, splinefleet
from tests.system.stalls import without_stalls, witness

SCENARIO = ROOT / "examples" / "paper_five_real.toml"
IN_C = ("R1", "R3", "R5")
FAULTS = ("stall:R1@3:2", "cut:R3@4:2", "kill:R5@6")
TRIES = 2


def run(folder):
    """Run the five robots, three of them with the C core; return the summary."""
    core = host(*IN_PARTS)
    cores = [f"--core={robot}={core}" for robot in IN_C]
    faults = [f"--fault={fault}" for fault in FAULTS]
    done = splinefleet("run", SCENARIO, "--out", folder, *cores, *faults, "--json", timeout=200.0)
    assert done.returncode == 1, done.stderr
    assert processes_of(core) == []
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def five(tmp_path_factory):
    """The run's folder and its summary, of a try in which the machine did not stall."""
    folder = tmp_path_factory.mktemp("c")

    def attempt(number):
        return folder / f"{number}", run(folder / f"{number}")

    with witness() as stalls:
        return without_stalls(stalls, TRIES, attempt)


def test_nobody_touches_and_everybody_arrives_but_the_robot_that_was_killed(five):
    _, summary = five
    verdict = summary["judge"]
    assert verdict["collisions"] == 0
    assert [one["id"] for one in verdict["robots"] if one["arrived"]] == ["R1", "R2", "R3", "R4"]


def test_three_robots_said_hello_with_the_sizes_of_the_c_core(five):
    folder, _ = five
    hellos = {
        record.key.rpartition("/")[2]: decode("hello", record.payload)
        for record in read_log(folder / "run.mcap").records
        if "/hello/" in record.key
    }
    assert {name for name, hello in hellos.items() if hello.points == 64} == set(IN_C)


def test_robots_with_the_c_core_keep_to_their_paths_and_know_the_time(five):
    folder, summary = five
    for robot in summary["judge"]["robots"]:
        assert robot["tracking_error"] < 0.01
        assert robot["clock_error"] is not None
    assert read_blackbox(folder / "blackbox" / "R1.csv").phases[-1] == "done"
