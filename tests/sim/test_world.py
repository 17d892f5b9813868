"""Fleet core and robots together in virtual time, on good links and bad ones."""

import numpy as np
import pytest

from coordinator.planner import plan_scenario
from coordinator.scenario_file import parse_scenario
from protocol.phases import DONE, FREEZE, FROZEN, OVER
from protocol.timing import MILLISECOND
from sim.judge import judge_boxes
from sim.memory_transport import MemoryNetwork
from sim.world import World

SCENARIO = b"""
name = "three"
margin = 0.05
[workspace]
bounds = [0.0, 0.0, 5.0, 5.0]
obstacles = [[[3.6, 3.6], [4.2, 3.6], [4.2, 4.2], [3.6, 4.2]]]
[[robots]]
id = "R1"
start = [0.6, 2.0]
goal = [4.4, 2.0]
radius = 0.15
max_speed = 0.6
[[robots]]
id = "R2"
start = [2.0, 0.6]
goal = [2.0, 4.4]
radius = 0.2
max_speed = 0.5
[[robots]]
id = "R3"
start = [4.4, 4.7]
goal = [1.0, 1.0]
radius = 0.15
max_speed = 0.4
"""


@pytest.fixture(scope="module")
def document():
    return plan_scenario(parse_scenario(SCENARIO, "three.toml"))


def test_on_a_good_link_everybody_arrives_when_planned(document):
    world = World(document, MemoryNetwork(0, delay_ns=(MILLISECOND, 3 * MILLISECOND)))
    world.run(120.0)
    assert world.fleet.phase == OVER
    verdict = judge_boxes(document, world.blackboxes())
    assert verdict.collisions == 0
    for robot in verdict.robots:
        assert robot.arrived
        assert robot.t == pytest.approx(document.robot(robot.id).finish_time, abs=0.1)
        assert robot.tracking_error < document.margin / 2


def test_the_same_seed_gives_the_same_run(document):
    rows = []
    for _ in range(2):
        network = MemoryNetwork(3, loss=0.1, delay_ns=(0, 50 * MILLISECOND), doubling=0.1)
        world = World(document, network, seed=3)
        world.run(60.0)
        rows.append({name: robot.rows for name, robot in world.robots.items()})
    assert rows[0] == rows[1]


@pytest.mark.parametrize("seed", range(12))
def test_on_a_bad_link_nobody_touches_and_everybody_arrives_or_stops(document, seed):
    network = MemoryNetwork(
        seed,
        loss=0.02 * seed,
        delay_ns=(0, 10 * seed * MILLISECOND),
        doubling=0.1,
        reordering=0.1,
    )
    world = World(document, network, seed=seed)
    world.run(180.0)
    for _ in range(3000):
        world.step()
    verdict = judge_boxes(document, world.blackboxes())
    assert verdict.collisions == 0
    assert verdict.least_separation > 0.3
    phases = {robot.service.agent.phase for robot in world.robots.values()}
    assert phases <= {DONE, FROZEN}


@pytest.mark.parametrize("dead", ["R1", "R2", "R3"])
@pytest.mark.parametrize("time", [0.5, 2.5, 5.0, 7.5])
def test_when_a_robot_dies_the_others_rest_within_tau(document, dead, time):
    network = MemoryNetwork(5, delay_ns=(MILLISECOND, 20 * MILLISECOND))
    world = World(document, network, seed=5, kills={dead: time})
    world.run(60.0)
    if world.fleet.phase == OVER:
        pytest.fail("a robot died under way and nobody noticed")
    assert world.fleet.phase == FREEZE
    assert world.fleet.members[dead].lost
    boxes = world.blackboxes()
    assert judge_boxes(document, boxes).collisions == 0
    for box in boxes.values():
        moved = np.flatnonzero(np.hypot(*np.diff(box.places, axis=0).T) > 1e-9)
        assert len(moved) == 0 or box.t[moved[-1] + 1] <= time + document.tau


def test_the_robots_say_little_under_way(document):
    world = World(document, MemoryNetwork(0, delay_ns=(MILLISECOND, 2 * MILLISECOND)))
    world.run(120.0)
    seconds = max(robot.rows[-1][0] for robot in world.robots.values())
    assert world.bytes_to_coordinator / len(world.robots) / seconds < 100
