"""For whom robots wait, found from plans alone, beside what the planner says."""

import pytest
from msgspec.structs import replace

from coordinator.live_reasons import with_reasons
from coordinator.plan import to_json
from coordinator.planner import plan_scenario
from sim.generator import generate
from tests.oracle_dense import closest
from tests.oracles import tracks


def bare(document):
    """Return a plan as the wire tells it: nobody says for whom he waits."""
    robots = [
        replace(
            robot, start_yields_to="", stops=[replace(stop, yields_to="") for stop in robot.stops]
        )
        for robot in document.robots
    ]
    return replace(document, robots=robots, waits=[])


def owners(document):
    return [
        (robot.id, number, owner)
        for robot in document.robots
        for number, owner in enumerate(
            [robot.start_yields_to] * (robot.start_time > 0.0)
            + [stop.yields_to for stop in robot.stops]
        )
    ]


def forces(document, robot, number, owner):
    """Tell whether a robot that left a rest 50 ms sooner would come too near to another one."""
    one = document.robot(robot)
    at_start = one.start_time > 0.0
    if at_start and number == 0:
        sooner = replace(one, start_time=one.start_time - 0.05)
    else:
        stops = list(one.stops)
        k = number - at_start
        stops[k] = replace(stops[k], depart=stops[k].depart - 0.05)
        sooner = replace(one, stops=stops)
    robots = [sooner if other.id == robot else other for other in document.robots]
    both = [t for t in tracks(to_json(replace(document, robots=robots))) if t.id in (robot, owner)]
    return closest(both, document.tau, document.margin).slack < -2e-3


@pytest.mark.parametrize(("kind", "robots", "seed"), [("circle", 8, 3), ("warehouse", 12, 5)])
def test_the_planners_reasons_are_found_again_or_others_that_are_as_true(kind, robots, seed):
    document = plan_scenario(generate(kind, robots, seed), effort=3)
    found = with_reasons(bare(document))
    assert len(owners(document)) > 3
    others = set(owners(found)) - set(owners(document))
    assert len(others) <= 1
    assert all(forces(document, *other) for other in others)
    known = {(one.robot, round(one.s, 3), one.yields_to): one for one in document.waits}
    for one in found.waits:
        if (one.robot, round(one.s, 3), one.yields_to) not in known:
            continue
        true = known[one.robot, round(one.s, 3), one.yields_to]
        assert one.wait == pytest.approx(true.wait, abs=1e-6)
        for mine, theirs in ((one.zone, true.zone), (one.their_zone, true.their_zone)):
            assert mine[0] < theirs[1]
            assert theirs[0] < mine[1]


def test_a_plan_without_waits_has_no_reasons():
    document = plan_scenario(generate("open", 2, 1), effort=0)
    alone = replace(document, robots=[replace(document.robots[0], stops=[], start_time=0.0)])
    assert with_reasons(alone).waits == []
