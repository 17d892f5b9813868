"""Every kind of fault on real processes over real Zenoh.

Three robots, two of whose paths cross, and tau = "auto", so that nobody may touch whatever fails.
A robot that is not let run for 50 ms stops, as its motors' watchdog demands; where a witness beside
the fleet was not let run either, the machine did that, and the fleet drives again.
"""

import asyncio
import contextlib
import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import pytest

from coordinator.findings.info import summarise
from coordinator.log.log_file import read_log
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.service.replay import check_log
from protocol.codec import decode
from protocol.messages import Command
from protocol.phases import FREEZE
from sim.judging.blackbox import read_blackbox
from sim.judging.judge import Verdict, judge
from sim.processes.local_fleet import LocalFleet, Outcome
from sim.world.fault_text import parse_faults
from tests.system.fleet_tools import processes_of
from tests.system.stalls import without_stalls, witness

DEADLINE_S = 90.0
ROBOTS = ("R1", "R2", "R3")

THREE_ROBOTS = """
name = "three"
[workspace]
bounds = [0.0, 0.0, 3.2, 3.0]
[[robots]]
id = "R1"
start = [0.4, 1.5]
goal = [1.8, 1.5]
priority = 1
radius = 0.15
max_speed = 0.6
max_accel = 1.2
[[robots]]
id = "R2"
start = [1.3, 2.2]
goal = [1.3, 0.8]
radius = 0.15
max_speed = 0.6
max_accel = 1.2
[[robots]]
id = "R3"
start = [2.7, 0.8]
goal = [2.7, 2.2]
radius = 0.15
max_speed = 0.6
max_accel = 1.2
"""


@dataclass
class Run:
    """A run that has ended."""

    folder: Path
    outcome: Outcome
    verdict: Verdict

    @property
    def info(self):
        return summarise(read_log(self.folder / "run.mcap"))

    @property
    def named(self):
        """The robots whose faults the coordinator or the log tells of."""
        told = {event["robot"] for event in self.outcome.events if event["event"] == "fault"}
        return (told | {fault["robot"] for fault in self.info["faults"]}) - {""}

    @property
    def faults(self):
        return [event["text"] for event in self.outcome.events if event["event"] == "fault"]

    @property
    def struck(self):
        return [event["text"] for event in self.outcome.events if event["event"] == "strike"]

    @property
    def arrived(self):
        return {robot.id for robot in self.verdict.robots if robot.arrived}

    @property
    def froze(self):
        """Whether the coordinator said FREEZE."""
        records = read_log(self.folder / "run.mcap").records
        heard = (decode("command", r.payload) for r in records if r.key.endswith("/command"))
        return any(isinstance(m, Command) and m.phase == FREEZE for m in heard)

    def box(self, robot):
        return read_blackbox(self.folder / "blackbox" / f"{robot}.csv")

    def went_well(self):
        everybody = self.arrived == set(ROBOTS)
        return self.outcome.code == 0 and everybody and not self.named and not self.froze


LOST = ("kill:R1@1.2", "hang:R1@1.2", "stall:R1@1.2")
FOR_A_WHILE = ("cut:R1@1.2:4", "hang:R1@1.2:2", "skid:R1@1.2")
LATE = ("slow:R1@1.2:0.5", "stall:R1@1.2:2")
HARMLESS = ("cut:R1@1.2:0.15", "slow:R1@1.2:0.98")
CLOCK_STEPS = ("clock-step:R1@1.2:3600", "clock-step:R2@1.5:-86400")
TWO_DEATHS = ("kill:R1@1.2", "hang:R3@1.2")
ALONE = (
    *LOST,
    *FOR_A_WHILE,
    *LATE,
    *HARMLESS,
    "coordinator-kill@1.2",
    "coordinator-hang@1.2:2",
    "skid:R1@1.2:0.2",
    "cut:R1@1.2:30",
    "corrupt:R1@0.5:2",
    "coordinator-restart@1.2:2",
    "kill:R1@500",
)
TOGETHER = 3
"""Fleets that run at a time: each mostly waits, and machines have few cores."""
TRIES = 3
"""So often at most a fleet drives on a machine that stalls."""


def run_fleet(folder, texts):
    """Run the three robots with faults, to their end; nobody may have touched or be left over."""
    folder.mkdir()
    file = folder / "three.toml"
    file.write_text(THREE_ROBOTS)
    fleet = LocalFleet(
        read_scenario(file),
        folder / "out",
        speed=1.0,
        effort=20,
        faults=parse_faults(texts, ROBOTS),
    )
    watch = threading.Timer(DEADLINE_S, end_processes_of, (folder,))
    watch.start()
    try:
        outcome = fleet.run()
    finally:
        in_time = watch.is_alive()
        watch.cancel()
    assert in_time, f"not ended after {DEADLINE_S} s: {outcome.events[-5:]}"
    verdict = judge(folder / "out")
    assert verdict.collisions == 0
    assert processes_of(folder) == []
    return Run(folder / "out", outcome, verdict)


def end_processes_of(folder):
    for process in processes_of(folder):
        with contextlib.suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """All runs of this module by their faults, some at a time."""

    def drive(stalls, folder, texts):
        folders = [folder / f"try {number}" for number in range(TRIES)]
        return without_stalls(stalls, TRIES, lambda number: run_fleet(folders[number], texts))

    with witness() as stalls, ThreadPoolExecutor(TOGETHER) as pool:
        yield {
            texts: pool.submit(drive, stalls, tmp_path_factory.mktemp("fleet"), texts)
            for texts in (*((text,) for text in ALONE), CLOCK_STEPS, TWO_DEATHS)
        }


@pytest.fixture
def run_with(runs):
    async def run(*texts):
        return await asyncio.wrap_future(runs[texts])

    return run


@pytest.mark.parametrize("fault", LOST)
async def test_a_robot_that_is_lost_is_named_and_nobody_touches(run_with, fault):
    """R2 is held by R1 and sent around it; on a machine that stalls, others may be late too."""
    run = await run_with(fault)
    assert "R1" in run.named
    assert "others go around R1" in run.faults
    assert not run.froze
    assert run.outcome.code == 1
    assert run.arrived == {"R2", "R3"}


@pytest.mark.parametrize("fault", FOR_A_WHILE)
async def test_a_robot_that_fails_for_a_while_is_named_and_nobody_touches(run_with, fault):
    run = await run_with(fault)
    assert run.named == {"R1"}
    assert run.arrived >= {"R2", "R3"}
    assert "R1" in run.arrived or fault.startswith("skid")
    assert not run.froze


@pytest.mark.parametrize("fault", LATE)
async def test_a_late_robot_drives_on_and_holds_the_one_behind_it_and_nobody_freezes(
    run_with, fault
):
    run = await run_with(fault)
    assert run.went_well(), run.outcome
    assert {(held["robot"], held["by"]) for held in run.info["held"]} == {("R2", "R1")}
    assert check_log(read_log(run.folder / "run.mcap")).difference == ""
    assert max(robot.tracking_error for robot in run.verdict.robots) < 0.01


async def test_a_skidding_body_truly_slides(run_with):
    run = await run_with("skid:R1@1.2:0.2")
    box = run.box("R1")
    aside = abs(box.places[:, 1] - 1.5)
    struck = box.t[aside > 0.01][0]
    assert 1.2 <= struck < 1.4
    assert 0.1 < aside[box.t < struck + 0.4].max() < 0.21


async def test_a_robot_cut_off_stops_by_itself_before_the_network_is_back(run_with):
    run = await run_with("cut:R1@1.2:30")
    box = run.box("R1")
    moving = box.t[:-1][abs(box.s[1:] - box.s[:-1]) > 1e-6]
    assert moving.max() < 1.2 + 1.5 + 0.3
    assert box.phases[-1] == "moving"


@pytest.mark.parametrize("fault", HARMLESS)
async def test_what_can_be_borne_stops_nobody(run_with, fault):
    run = await run_with(fault)
    assert run.went_well(), run.outcome


async def test_a_step_of_the_wall_clock_changes_nothing(run_with):
    run = await run_with(*CLOCK_STEPS)
    assert run.struck == list(CLOCK_STEPS)
    assert run.went_well(), run.outcome


async def test_random_bytes_on_its_keys_change_nothing(run_with):
    run = await run_with("corrupt:R1@0.5:2")
    assert run.info["bad_messages"] > 50
    assert run.went_well(), run.outcome


async def test_without_a_coordinator_all_robots_stop_by_themselves(run_with):
    run = await run_with("coordinator-kill@1.2")
    assert run.outcome.code == -signal.SIGKILL
    assert run.arrived == set()
    for robot in ROBOTS:
        box = run.box(robot)
        assert box.phases[-1] == "moving"
        assert box.s[-1] == box.s[box.t > box.t[-1] - 1.0][0] < box.s[0] + 1.4


async def test_a_coordinator_that_hung_goes_on_in_the_same_epoch(run_with):
    run = await run_with("coordinator-hang@1.2:2")
    assert run.arrived == set(ROBOTS)
    assert not run.froze


async def test_a_coordinator_that_was_killed_is_started_again(run_with):
    run = await run_with("coordinator-restart@1.2:2")
    assert run.struck == [
        "coordinator-restart@1.2:2",
        "coordinator-restart@1.2:2: resume",
    ]
    assert run.arrived == set(ROBOTS)


async def test_several_robots_may_fail_in_one_run(run_with):
    run = await run_with(*TWO_DEATHS)
    assert run.outcome.code == 1
    assert run.named == {"R1", "R3"}
    assert run.arrived == {"R2"}


async def test_a_fault_after_the_end_does_not_strike(run_with):
    run = await run_with("kill:R1@500")
    assert run.struck == []
    assert run.went_well(), run.outcome
