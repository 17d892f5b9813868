"""Robots with the C agent in a fleet with the Python coordinator, in virtual time, with faults."""

from __future__ import annotations

from pathlib import Path

import pytest

from coordinator.scenario_files.scenario_reader import read_scenario
from sim.campaigns.campaign import run_seed
from sim.world.fault_text import parse_faults
from sim.world.virtual_fleet import World
from tests.firmware.c_service import CRobots

SCENARIO = Path(__file__).parents[2] / "examples" / "paper_five_real.toml"


@pytest.mark.processes
@pytest.mark.parametrize("names", [("R1", "R3", "R5"), ()])
def test_a_fleet_of_c_agents_keeps_clear_and_arrives_whatever_fails(robot_core, monkeypatch, names):
    robots = CRobots(robot_core, names)
    monkeypatch.setattr(World, "_service", robots.wrap(World._service))
    scenario = read_scenario(SCENARIO)
    ids = [robot.id for robot in scenario.robots]
    faults = parse_faults(["stall:R1@6:3", "cut:R3@9:2", "kill:R5@12"], ids)
    outcome = run_seed(scenario, 1, faults=faults)
    robots.end()
    assert outcome.violations == ()
    assert outcome.touches == ()
    assert outcome.arrived == outcome.expected == 4
    assert len(robots.services) == (len(names) or 5)
