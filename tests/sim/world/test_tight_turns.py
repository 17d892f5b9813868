"""Where robots make room for each other, ways turn back within millimetres; robots keep to them."""

from __future__ import annotations

import math

import pytest

from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario, Workspace
from protocol.timing import MILLISECOND
from sim.campaigns.truth import touches
from sim.world.memory_transport import MemoryNetwork
from sim.world.virtual_fleet import USUAL_FLAWS, World
from tests.crowds import crowd, square


def floor(side, speed, accel, radius, margin, trips):
    """Return robots on a square floor; trips: each one's start and goal."""
    robots = crowd(trips, radius, speed, accel)
    return Scenario(
        name="crowd", workspace=Workspace(boundary=square(side)), robots=robots, margin=margin
    )


FLOORS = {
    "four of 1.5 m/s": floor(0.73, 1.5, 3.0, 0.1, 0.02, [
        ((0.316, 0.203), (0.324, 0.225)), ((0.561, 0.506), (0.15, 0.458)),
        ((0.231, 0.566), (0.551, 0.579)), ((0.599, 0.222), (0.594, 0.296)),
    ]),
    "three of 1 m/s": floor(0.4, 1.0, 2.0, 0.05, 0.03, [
        ((0.157, 0.108), (0.174, 0.264)), ((0.292, 0.293), (0.12, 0.092)),
        ((0.096, 0.308), (0.306, 0.138)),
    ]),
    "five that start at once": floor(0.46, 0.5, math.inf, 0.05, 0.02, [
        ((0.343, 0.08), (0.196, 0.201)), ((0.248, 0.243), (0.378, 0.26)),
        ((0.38, 0.362), (0.081, 0.336)), ((0.105, 0.15), (0.363, 0.083)),
        ((0.082, 0.356), (0.248, 0.377)),
    ]),
    "three of 3 m/s that start at once": floor(0.49, 3.0, math.inf, 0.05, 0.05, [
        ((0.17, 0.309), (0.181, 0.245)), ((0.246, 0.117), (0.361, 0.347)),
        ((0.368, 0.346), (0.366, 0.133)),
    ]),
}  # fmt: skip


@pytest.mark.parametrize("ticks", [10, 20, 50])
@pytest.mark.parametrize("name", list(FLOORS))
def test_nobody_leaves_its_path_at_tight_turns(name, ticks):
    """On each of these floors robots did, with every tick period here."""
    scenario = FLOORS[name]
    document = plan_scenario(scenario)
    network = MemoryNetwork(1, loss=0.0, delay_ns=(0, 5 * MILLISECOND))
    world = World(
        scenario,
        document,
        network,
        seed=1,
        flaws=USUAL_FLAWS,
        period_ns=ticks * MILLISECOND,
    )
    world.run(60.0)
    assert world.fleet.members.has_arrived
    assert [incident.text for incident in world.fleet.incidents if "path" in incident.text] == []
    assert touches(document, world.blackboxes()) == []
