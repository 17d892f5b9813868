"""New times for a late robot: proven, the past untouched, paths and orders kept."""

from __future__ import annotations

import random

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.fleet.fleet_from_plan import times_of
from coordinator.plan.document import Limits
from coordinator.plan.fault_budget import budget_for
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import drive, packed
from coordinator.planning.planner import plan_scenario
from coordinator.planning.retiming import retime
from coordinator.proof.verify import prove_document
from coordinator.scenario.model import Link
from coordinator.schedule.lateness import Lateness
from protocol.codec import decode
from protocol.plan_parts import unpack_motion
from protocol.timeline import Timeline
from sim.floors.generator import generate
from tests.oracle_dense import closest
from tests.oracles import tracks

FLOORS = [("open", 6, 1), ("cross-town", 5, 2), ("ring", 6, 3), ("polygons", 9, 1)]


def new_times(scenario, document, late):
    """The document with new times, which the messages that come with it are made of."""
    plan = retime(scenario, document, late)
    assert plan is None or plan == packed(plan.document)
    return None if plan is None else plan.document


def planned(kind, count, seed):
    scenario = replace(generate(kind, count, seed), tau="auto", link=Link(delay=0.005))
    return scenario, plan_scenario(scenario, effort=5)


def settling(scenario):
    budget = budget_for([Limits.of(robot) for robot in scenario.robots], scenario.link)
    return budget.lease + budget.travel + budget.brake + budget.clocks


@pytest.fixture(scope="module", params=FLOORS, ids=lambda floor: floor[0])
def retimed(request):
    """Return scenario, plan and all new plans found for robots that are late at drawn moments."""
    scenario, document = planned(*request.param)
    chance, found = random.Random(5), []
    for _ in range(8):
        robot = chance.choice(document.robots)
        stood = chance.uniform(robot.start_time, robot.finish_time - 0.3)
        late = Lateness(robot.id, stood, stood + 1.0 + settling(scenario))
        fresh = new_times(scenario, document, late)
        if fresh is not None:
            found.append((late, fresh))
    assert found
    return scenario, document, found


def timelines(document):
    return {one.id: one.timeline for one in drive(document)}


def test_new_times_are_proven_and_a_dense_sampler_agrees(retimed):
    scenario, _, found = retimed
    for _, fresh in found:
        assert fresh.proof.holds
        assert prove_document(fresh, scenario).holds
        worst = closest(tracks(to_json(fresh)), fresh.tau, fresh.margin, step=0.05)
        assert worst.slack >= -2e-3


def test_nobody_but_the_late_robot_drives_otherwise_before_the_switch(retimed):
    _, document, found = retimed
    before = timelines(document)
    for late, fresh in found:
        for name, after in timelines(fresh).items():
            if name != late.robot:
                for time in np.linspace(0.0, late.switch, 300):
                    assert after.s_at(time) == pytest.approx(before[name].s_at(time), abs=1e-4)


def test_the_late_robot_stands_where_it_stood_until_the_switch_at_least(retimed):
    _, document, found = retimed
    before = timelines(document)
    for late, fresh in found:
        after, s = timelines(fresh)[late.robot], before[late.robot].s_at(late.stood)
        for time in np.linspace(late.stood + 1.5, late.switch, 10):
            assert after.s_at(time) == pytest.approx(s, abs=2e-4)
        assert after.finish > before[late.robot].finish


def test_paths_stay_and_only_robots_that_others_delay_are_told(retimed):
    _, document, found = retimed
    for late, fresh in found:
        assert [r.path for r in fresh.robots] == [r.path for r in document.robots]
        assert (fresh.epoch, fresh.revision) == (document.epoch, 1)
        told = times_of(packed(fresh), document, 77)
        assert late.robot in told
        for name, message in told.items():
            times = decode("plan", message)
            assert (times.epoch, times.boot, times.revision) == (document.epoch, 77, 1)
            assert vars_of(Timeline(*unpack_motion(times))) == vars_of(timelines(fresh)[name])


def vars_of(timeline):
    return timeline.t0, timeline.t1, timeline.s0, timeline.s1


def test_two_robots_that_both_have_new_times_pass_each_crossing_in_the_order_they_had(retimed):
    _, document, found = retimed
    for _, fresh in found:
        changed = {
            new.id for new, old in zip(fresh.robots, document.robots, strict=True) if new != old
        }
        for new, old in zip(fresh.crossings, document.crossings, strict=True):
            if {new.a, new.b} <= changed:
                assert (new.t_a < new.t_b) == (old.t_a < old.t_b)


def test_a_robot_that_stands_in_the_way_of_another_that_cannot_stop_in_time_gets_no_new_times():
    scenario, document = planned("open", 6, 1)
    crossing = min(
        (c for c in document.crossings if abs(c.t_a - c.t_b) < 4.0),
        key=lambda c: abs(c.t_a - c.t_b),
    )
    first, t = min((crossing.t_a, crossing.a), (crossing.t_b, crossing.b))[::-1]
    assert new_times(scenario, document, Lateness(first, t, t + 30.0)) is None


def test_new_times_keep_the_order_even_where_the_late_robot_alone_could_go_later(monkeypatch):
    scenario, document = planned("polygons", 9, 1)

    def nobody_alone(found):
        found.motions = found._as_driven()

    monkeypatch.setattr("coordinator.planning.retiming._Retiming._alone", nobody_alone)
    chance, found = random.Random(5), 0
    for _ in range(12):
        robot = chance.choice(document.robots)
        stood = chance.uniform(robot.start_time, robot.finish_time - 0.3)
        late = Lateness(robot.id, stood, stood + 1.0 + settling(scenario))
        fresh = new_times(scenario, document, late)
        if fresh is None:
            continue
        found += 1
        s = timelines(document)[robot.id].s_at(stood)
        assert timelines(fresh)[robot.id].s_at(late.switch) == pytest.approx(s, abs=2e-4)
        changed = {n.id for n, o in zip(fresh.robots, document.robots, strict=True) if n != o}
        for new, old in zip(fresh.crossings, document.crossings, strict=True):
            if {new.a, new.b} & changed:
                assert (new.t_a < new.t_b) == (old.t_a < old.t_b)
    assert found > 3


def test_the_same_lateness_gives_the_same_new_times(retimed):
    scenario, document, found = retimed
    late, fresh = found[0]
    assert new_times(scenario, document, late) == fresh


def test_a_robot_may_be_late_twice(retimed):
    scenario, _, found = retimed
    for late, fresh in found:
        robot = fresh.robot(late.robot)
        stood = 0.5 * (late.switch + robot.finish_time)
        again = new_times(scenario, fresh, Lateness(late.robot, stood, stood + 3.0))
        if again is not None:
            assert (again.revision, again.proof.holds) == (2, True)
            assert again.robot(late.robot).finish_time > robot.finish_time
            return
    pytest.fail("nobody could be late twice on this floor")


def test_a_robot_that_the_scenario_does_not_hold_gets_no_new_times():
    scenario, document = planned("open", 6, 1)
    fewer = replace(scenario, robots=scenario.robots[1:])
    assert new_times(fewer, document, Lateness(scenario.robots[1].id, 1.0, 4.0)) is None


@pytest.mark.parametrize("beyond", [-1e-4, 0.0, 1e-9, 0.005, 100.0])
def test_a_robot_that_says_to_stand_at_its_goal_gets_no_new_times(beyond):
    scenario, document = planned("open", 6, 1)
    robot = document.robots[0]
    late = Lateness(robot.id, robot.finish_time + beyond, robot.finish_time + 3.0)
    assert new_times(scenario, document, late) is None
