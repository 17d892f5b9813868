"""The proof of staircases refuses what is damaged, and nothing else."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from coordinator.base.errors import PlanError
from coordinator.plan.course import Course
from coordinator.plan.staircases import NO_STAIRCASES
from coordinator.planning.planner import plan_fleet
from coordinator.proof.course_proof import pair_failures
from coordinator.proof.motion_pieces import Flights, Pieces
from coordinator.proof.precedence import staircase_failures
from coordinator.scenario.margin import RESOLUTION, TOLERANCE
from sim.floors.generator import generate
from tests.scenarios import a_robot, a_scenario, random_scenario
from tests.sweeps import seeds

LOWER = 250
"""By how much [ms] a damaged staircase is lower: more than it may lie above its conflicts."""


def planned(scenario):
    plan = plan_fleet(scenario, effort=0)
    driven, terms = plan.driven, plan.document
    return driven, plan.staircases, terms.margin


def named(failures, driven, staircases, pair):
    """Whether a failure names both robots of a pair."""
    names = [driven[staircases.behind[pair]].id, driven[staircases.ahead[pair]].id]
    return any(f"{names[0]} at" in text and f"near {names[1]} at" in text for text in failures)


@pytest.mark.parametrize("seed", seeds(60))
def test_staircases_of_random_plans_are_proven(seed):
    try:
        driven, staircases, margin = planned(random_scenario(seed))
    except PlanError:
        pytest.skip("no plan")
    assert staircase_failures(Flights(driven), staircases, margin) == []


@pytest.mark.parametrize("kind", ["warehouse", "rooms", "ring", "circle", "open", "u-traps"])
def test_staircases_of_whole_floors_are_proven(kind):
    driven, staircases, margin = planned(generate(kind, 12, 2))
    assert staircase_failures(Flights(driven), staircases, margin) == []


@pytest.fixture(scope="module")
def plan():
    return planned(generate("warehouse", 8, 4))


def test_a_staircase_left_out_is_found(plan):
    driven, staircases, margin = plan
    for pair in range(len(staircases.ahead)):
        kept = np.arange(len(staircases.ahead)) != pair
        knots = np.repeat(kept, np.diff(staircases.first))
        rest = replace(
            staircases,
            ahead=staircases.ahead[kept],
            behind=staircases.behind[kept],
            first=np.append(0, np.cumsum(np.diff(staircases.first)[kept])),
            at=staircases.at[knots],
            need=staircases.need[knots],
        )
        assert named(staircase_failures(Flights(driven), rest, margin), driven, staircases, pair)


def test_a_staircase_too_low_is_found(plan):
    driven, staircases, margin = plan
    for pair in range(len(staircases.ahead)):
        need = staircases.need.copy()
        need[staircases.first[pair] : staircases.first[pair + 1]] -= LOWER
        failures = staircase_failures(Flights(driven), replace(staircases, need=need), margin)
        assert named(failures, driven, staircases, pair)


def test_a_staircase_too_late_is_found(plan):
    driven, staircases, margin = plan
    for pair in range(len(staircases.ahead)):
        at = staircases.at.copy()
        at[staircases.first[pair] : staircases.first[pair + 1]] += LOWER
        failures = staircase_failures(Flights(driven), replace(staircases, at=at), margin)
        assert named(failures, driven, staircases, pair)


def test_one_step_too_low_is_found(plan):
    """Each knot lowered alone leaves a conflict between its neighbours uncovered."""
    driven, staircases, margin = plan
    found = looked = 0
    for knot in range(1, len(staircases.at)):
        need = staircases.need.copy()
        need[knot] = max(need[knot] - LOWER, need[knot - 1])
        pair = int(np.searchsorted(staircases.first, knot, side="right")) - 1
        if knot == staircases.first[pair] or need[knot] > staircases.need[knot] - LOWER:
            continue
        looked += 1
        failures = staircase_failures(Flights(driven), replace(staircases, need=need), margin)
        found += named(failures, driven, staircases, pair)
    assert looked > 5
    assert found == looked


def test_more_failures_than_can_be_read_are_counted(plan):
    driven, staircases, margin = plan
    none = replace(
        staircases,
        ahead=staircases.ahead[:0],
        behind=staircases.behind[:0],
        first=staircases.first[:1],
        at=staircases.at[:0],
        need=staircases.need[:0],
    )
    count = len(staircases.ahead)
    failures = staircase_failures(Flights(driven), none, margin)
    assert len(failures) == min(count, 21)


@pytest.mark.parametrize(("short", "is_found"), [(0.9, False), (1.1, True)])
def test_a_conflict_is_accepted_up_to_a_fixed_shortfall_of_the_distance(short, is_found):
    """R2 passes everywhere 5 s after R1, on a line beside its, and no staircase holds it back."""
    margin, radius = 0.05, 0.2
    apart = 2.0 * radius + margin - short * (TOLERANCE + RESOLUTION)
    rows = np.array([[0.0, 10.0, 0.0, 0.0, 10.0, 0.0, 0.0], [5.0, 15.0, 0, apart, 10, apart, 0.0]])
    ones = np.arange(2)
    flights = SimpleNamespace(
        driven=[SimpleNamespace(id=name, radius=radius) for name in ("R1", "R2")],
        asked=np.ones(2, np.bool_),
        pieces=lambda _: Pieces(rows, ones, ones),
    )
    failures = staircase_failures(flights, replace(NO_STAIRCASES, tau_ms=600), margin)
    assert [text.split()[0] for text in failures] == ["R2"] * is_found


def test_the_proof_of_a_course_looks_at_every_other_one():
    """R1's course meets that of R3 alone, which is the last of the others."""
    places = [((1.0, 4.0), (9.0, 4.0)), ((1.0, 7.5), (9.0, 7.5)), ((5.0, 1.0), (5.0, 7.0))]
    robots = [a_robot(f"R{k}", *ends) for k, ends in enumerate(places, start=1)]
    courses = [Course(plan_fleet(a_scenario([robot], tau=0.6)).driven[0], 0.0) for robot in robots]
    none = replace(NO_STAIRCASES, tau_ms=600)
    for others in (courses[1:], courses[:0:-1]):
        failures = pair_failures([courses[0], *others], none, 0.05)
        assert failures
        assert all("R1" in text and "R3" in text for text in failures)
