"""Staircases, held against dense sampling of the same bytes."""

import numpy as np
import pytest

from coordinator.base.errors import PlanError
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_fleet
from coordinator.schedule.staircase_making import staircases_of
from sim.floors.generator import generate
from tests.oracle_staircases import sampled
from tests.oracles import tracks
from tests.scenarios import a_robot, a_scenario, random_scenario
from tests.sweeps import seeds

CELL = 0.01
"""A need begins where the robot behind comes to the cell [m] of a conflict."""

MOST_ABOVE = 0.05
"""How far [s] a staircase may lie above the sampled one: tolerance, and the step of sampling."""

WIDER = 0.005
"""A robot may rest right beside a conflict, so the upper bound is sampled for this more [m]."""


def planned(scenario):
    plan = plan_fleet(scenario, effort=0)
    return plan.document, plan.driven


def compared(document, driven):
    """Yield the sampled need, the staircase's, and the most that is right [s], if there are any.

    The most is the need one cell farther on, for a wider margin.
    """
    found = staircases_of(driven, document.tau, document.margin)
    pairs = {pair: k for k, pair in enumerate(zip(found.ahead, found.behind, strict=True))}
    fleet = tracks(to_json(document))
    times, need = sampled(fleet, document.margin)
    _, most = sampled(fleet, document.margin + WIDER)
    places = [track.arc(times) for track in fleet]
    farther = [np.searchsorted(s, s + CELL).clip(max=len(s) - 1) for s in places]
    for i, j, k in np.argwhere(need > -np.inf)[::5]:
        said = found.need_at(pairs[i, j], 1000.0 * times[k]) if (i, j) in pairs else -np.inf
        yield need[i, j, k], said / 1000.0, most[i, j, farther[j][k]]


@pytest.mark.parametrize("seed", seeds(40))
def test_no_sampled_conflict_lies_above_a_staircase_and_none_far_below(seed):
    try:
        document, driven = planned(random_scenario(seed))
    except PlanError:
        pytest.skip("no plan")
    for need, said, most in compared(document, driven):
        assert need - 1e-6 <= said <= most + MOST_ABOVE


@pytest.mark.parametrize("kind", ["warehouse", "rooms", "ring", "circle", "open"])
def test_staircases_of_whole_floors_are_close_and_compact(kind):
    document, driven = planned(generate(kind, 10, 3))
    above = [said - need for need, said, _ in compared(document, driven)]
    assert min(above) >= -1e-6
    assert np.median(above) < 0.05
    found = staircases_of(driven, document.tau, document.margin)
    assert 8 * len(found.at) / len(found.ahead) < 500


def test_two_robots_that_cross_have_one_staircase():
    robots = [a_robot("R1", (1.0, 4.0), (9.0, 4.0)), a_robot("R2", (5.0, 1.0), (5.0, 7.0))]
    document, driven = planned(a_scenario(robots))
    found = staircases_of(driven, document.tau, document.margin)
    assert len(found.ahead) == 1
    assert {found.ahead[0], found.behind[0]} == {0, 1}


def test_robots_that_never_come_near_have_none():
    robots = [a_robot("R1", (1.0, 1.0), (9.0, 1.0)), a_robot("R2", (1.0, 6.0), (9.0, 6.0))]
    document, driven = planned(a_scenario(robots))
    assert len(staircases_of(driven, document.tau, document.margin).ahead) == 0


def test_staircases_of_some_robots_are_those_of_the_whole_fleet():
    document, driven = planned(generate("open", 12, 5))
    whole = staircases_of(driven, document.tau, document.margin)
    some = staircases_of(driven, document.tau, document.margin, among=[3])
    chosen = [k for k in range(len(whole.ahead)) if 3 in (whole.ahead[k], whole.behind[k])]
    assert len(chosen) == len(some.ahead) > 0
    for k, other in zip(chosen, range(len(some.ahead)), strict=True):
        assert (whole.ahead[k], whole.behind[k]) == (some.ahead[other], some.behind[other])
        assert np.array_equal(whole.knots_of(k), some.knots_of(other))
