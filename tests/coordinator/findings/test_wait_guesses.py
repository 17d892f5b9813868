"""For whom robots wait, found from plans alone, beside what the planner says."""

import pytest
from msgspec.structs import replace

from coordinator.findings.wait_guesses import with_reasons
from coordinator.planning.planner import plan_scenario
from sim.floors.generator import generate
from tests.oracle_waits import rests, share


def bare(document):
    """Return a plan as the wire tells it: nobody says for whom he waits."""
    robots = [
        replace(
            robot, start_yields_to="", stops=[replace(stop, yields_to="") for stop in robot.stops]
        )
        for robot in document.robots
    ]
    return replace(document, robots=robots, waits=[])


@pytest.mark.parametrize(("kind", "robots", "seed"), [("circle", 8, 3), ("warehouse", 12, 5)])
def test_the_planners_reasons_are_found_again_or_others_that_are_as_true(kind, robots, seed):
    document = plan_scenario(generate(kind, robots, seed), effort=3)
    found = with_reasons(bare(document))
    assert len(rests(document)) > 3
    others = set(rests(found)) - set(rests(document))
    assert len(others) <= 1
    assert all(share(document, *other) > 0.4 for other in others)
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
