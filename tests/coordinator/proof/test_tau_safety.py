"""The proof is sharp both ways: it refuses what sampling finds unsafe, and nothing that is safe."""

import json

import pytest
from msgspec.structs import replace

from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.proof.verify import prove_document
from coordinator.scenario.margin import LEAST_MARGIN, RESOLUTION, TOLERANCE, between_robots
from coordinator.scenario.model import Link
from tests.oracles import least_clearance, least_slack, tracks
from tests.scenarios import a_robot, a_scenario, box


def crossing(accel=0.8, tau=0.6):
    robots = [
        a_robot("A", (1, 4), (9, 4), max_accel=accel),
        a_robot("B", (5, 1), (5, 7), max_accel=accel, max_speed=0.6, radius=0.3),
        a_robot("C", (1.5, 6.5), (8.5, 1.5), max_accel=accel, max_speed=0.7, radius=0.1),
    ]
    return a_scenario(robots, tau=tau, obstacles=[box(7.5, 5.5, 8.5, 6.5)])


@pytest.fixture(scope="module", params=[(0.8, 0.6), (float("inf"), 0.6), (0.8, 0.2), (0.8, 3.0)])
def planned(request):
    scenario = crossing(*request.param)
    return scenario, plan_scenario(scenario)


def changed(document, index, **fields):
    robots = list(document.robots)
    robots[index] = replace(robots[index], **fields)
    return agreeing(replace(document, robots=robots))


def agreeing(document):
    """The document with the times that its wire bytes give."""
    robots = []
    for robot, driven in zip(document.robots, drive(document), strict=True):
        arrivals = driven.timeline.arrivals[robot.start_time > 0.0 :]
        stops = [replace(s, arrive=t) for s, t in zip(robot.stops, arrivals, strict=True)]
        robots.append(replace(robot, finish_time=driven.timeline.finish, stops=stops))
    return replace(document, robots=robots)


def sampled(document):
    fleet = tracks(json.loads(to_json(document)))
    return least_slack(fleet, document.tau, document.margin, step=0.01)[0]


def check_sharp(document):
    """Hold the proof against the sampler; returns the sampled slack."""
    slack, proof = sampled(document), prove_document(document)
    if slack < -0.002:
        assert not proof.holds
        assert any("apart near" in failure for failure in proof.failures)
    if slack > -TOLERANCE + 0.0005:
        assert proof.holds, proof.failures
    return slack


def test_what_is_solid_and_other_robots_stop_even_the_smallest():
    robots = [a_robot("A", (1, 4), (9, 4)), a_robot("B", (1, 6), (9, 6))]
    document = replace(plan_scenario(a_scenario(robots), effort=0), margin=LEAST_MARGIN)
    wall = replace(document.workspace, obstacles=(box(4, 3, 6, 5),))
    tiny = replace(document, robots=[replace(r, radius=1e-3) for r in document.robots])
    assert prove_document(tiny).holds
    proof = prove_document(replace(tiny, workspace=wall))
    assert proof.failures == ["A's way leads through something solid near (4.03, 4.00)"]
    twins = replace(tiny, robots=[tiny.robots[0], replace(tiny.robots[0], id="B")])
    assert not prove_document(twins).holds


def test_a_margin_that_is_less_than_its_shares_does_not_hold():
    robots = [a_robot("A", (1, 4), (9, 4)), a_robot("B", (1, 6), (9, 6))]
    document = plan_scenario(a_scenario(robots), effort=0)
    shares = between_robots(0, 0).total
    assert prove_document(replace(document, margin=shares)).holds
    (failure,) = prove_document(replace(document, margin=shares - 1e-5)).failures
    assert failure.startswith("the margin is 0.00194 m, but must cover 0.00195 m: how far")


def test_a_valid_plan_is_accepted(planned):
    scenario, document = planned
    assert check_sharp(document) > -TOLERANCE
    assert prove_document(document, scenario) == document.proof


def test_starting_earlier_or_later_is_refused_exactly_when_it_is_unsafe(planned):
    _, document = planned
    slacks = []
    for index, robot in enumerate(document.robots):
        for shift in (-4.0, -2.0, -1.0, -0.5, -0.2, -0.1, -0.05, 0.05, 0.3, 1.0, 3.0):
            start = max(robot.start_time + shift, 0.0)
            slacks.append(check_sharp(changed(document, index, start_time=start)))
    assert min(slacks) < -0.1


def test_removed_and_shortened_stops_are_refused_exactly_when_it_is_unsafe(planned):
    _, document = planned
    for index, robot in enumerate(document.robots):
        for k, stop in enumerate(robot.stops):
            rest = robot.stops[:k] + robot.stops[k + 1 :]
            check_sharp(changed(document, index, stops=rest))
            for part in (0.0, 0.5, 0.9, 0.97, 1.0):
                depart = stop.arrive + part * (stop.depart - stop.arrive)
                stops = list(robot.stops)
                stops[k] = replace(stop, depart=depart)
                check_sharp(changed(document, index, stops=stops))


def test_larger_radius_margin_or_tau_is_refused_exactly_when_it_is_unsafe(planned):
    _, document = planned
    slack = sampled(document)
    slacks = []
    for more in (0.0, 0.5 * slack, slack, slack + 0.003, slack + 0.05):
        robot = document.robots[1]
        slacks.append(check_sharp(changed(document, 1, radius=robot.radius + more)))
        slacks.append(check_sharp(replace(document, margin=document.margin + more)))
    for tau in (document.tau + more for more in (0.01, 0.1, 0.5, 2.0)):
        slacks += [check_sharp(replace(document, tau=tau))]
    assert min(slacks) < -0.01


def test_the_least_separation_is_that_of_sampling(planned):
    _, document = planned
    bare = changed(document, 0, radius=0.0)
    bare = changed(changed(bare, 1, radius=0.0), 2, radius=0.0)
    least = sampled(replace(bare, margin=0.0))
    assert document.proof.least_separation == pytest.approx(least, abs=1e-3 + RESOLUTION)


def test_clearance_is_that_of_sampling_and_is_refused_when_short():
    walls = [box(3, 0, 3.2, 5), box(6, 3, 6.2, 8)]
    scenario = a_scenario([a_robot("A", (1, 1), (9, 7))], obstacles=walls)
    document = plan_scenario(scenario)
    fleet = tracks(to_json(document))
    least = least_clearance(fleet, scenario.workspace.boundary, walls)
    assert document.proof.least_clearance == pytest.approx(least, abs=1e-3)
    spare = least - document.margin
    assert prove_document(changed(document, 0, radius=0.2 + spare - 0.001)).holds
    refused = prove_document(changed(document, 0, radius=0.2 + spare + 0.003))
    assert not refused.holds
    assert "A comes within" in refused.failures[0]
    through = replace(scenario.workspace, obstacles=(*walls, box(4, 2, 5, 6)))
    assert not prove_document(document, replace(scenario, workspace=through)).holds


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("max_speed", 0.7, "drives faster than 0.7 m/s"),
        ("max_accel", 0.35, "changes speed faster than 0.35 m/s^2"),
        ("max_lateral_accel", 0.05, "takes a bend above 0.05 m/s^2 at "),
        ("min_turn_radius", 3.0, "turns tighter than 3 m at "),
    ],
)
def test_limits_that_are_not_kept_are_named(field, value, words):
    scenario = a_scenario([a_robot("A", (1, 1), (9, 7), via=((7, 2),))])
    document = plan_scenario(scenario)
    slower = replace(scenario, robots=(replace(scenario.robots[0], **{field: value}),))
    proof = prove_document(document, slower)
    assert not proof.holds
    assert any(words in failure for failure in proof.failures)


@pytest.mark.parametrize("factor", [1.005, 1.2])
def test_a_faster_profile_is_refused(factor):
    document = plan_scenario(a_scenario([a_robot("A", (1, 1), (9, 7))], speed_reserve=0.0))
    fast = [(s, v * factor) for s, v in document.robots[0].profile]
    assert not prove_document(changed(document, 0, profile=fast)).holds


def test_a_plan_of_another_scenario_is_refused(planned):
    scenario, document = planned
    robots = scenario.robots
    others = {
        "start is not": [replace(robots[0], start=(1.2, 4.0)), *robots[1:]],
        "goal is not": [replace(robots[0], goal=(9.0, 4.1)), *robots[1:]],
        "not in the scenario": robots[1:],
        "has no plan": [*robots, a_robot("D", (9, 1), (9.2, 2.5))],
        "planned with radius": [replace(robots[0], radius=0.25), *robots[1:]],
    }
    for words, changed_robots in others.items():
        proof = prove_document(document, replace(scenario, robots=tuple(changed_robots)))
        assert any(words in failure for failure in proof.failures)
        assert not proof.holds
    for fields in ({"tau": document.tau + 0.1}, {"margin": 0.06}):
        assert not prove_document(document, replace(scenario, **fields)).holds


def test_moving_the_whole_fleet_changes_nothing(planned):
    _, document = planned
    moved = document
    for index, robot in enumerate(document.robots):
        points = [(x + 8.0, y - 4.0) for x, y in robot.path.control_points]
        moved = changed(moved, index, path=replace(robot.path, control_points=points))
    moved = replace(moved, workspace=None)
    proof = prove_document(moved)
    assert proof.holds
    assert proof.least_clearance is None
    assert proof.least_separation == pytest.approx(document.proof.least_separation, abs=2e-3)


@pytest.fixture(scope="module")
def real():
    scenario = crossing()
    return scenario, plan_scenario(scenario)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"margin": 1.0}, "margin is 1 m, the scenario asks for 0.05 m"),
        ({"margin": 0.04}, "margin is 0.04 m"),
        ({"tau": 3.0}, "tau is 3 s, the scenario asks for"),
        ({"link": Link(delay=5.0)}, "link.delay is 5 s, the scenario's is 0 s"),
        ({"link": Link(loss=0.5)}, "link.loss is 0.5, the scenario's is 0"),
    ],
)
def test_terms_on_the_wire_that_the_scenario_does_not_ask_for_are_failures(real, fields, words):
    scenario, document = real
    proof = prove_document(replace(document, **fields), scenario)
    assert not proof.holds
    assert proof.survives == []
    assert any(words in failure for failure in proof.failures)


@pytest.mark.parametrize("accel", [0.05, 1e9, None])
def test_brakes_that_are_not_the_robots_are_a_failure(real, accel):
    scenario, document = real
    limits = replace(document.robots[0].limits, max_accel=accel)
    proof = prove_document(changed(document, 0, limits=limits), scenario)
    told = "none" if accel is None else f"{accel:g} m/s^2"
    assert proof.failures[0] == (
        f"{document.robots[0].id}'s limits.max_accel is {told}, the scenario's is "
        f"{scenario.robots[0].max_accel:g} m/s^2"
    )


def test_all_terms_that_are_not_the_scenarios_are_told(real):
    scenario, document = real
    other = replace(document, margin=0.5, tau=9.0, link=Link(delay=1.0, loss=0.1))
    other = changed(other, 0, limits=replace(other.robots[0].limits, max_accel=None, max_speed=9.0))
    assert len(prove_document(other, scenario).failures) >= 6


def test_limits_that_the_file_does_not_tell_leave_a_robot_without_a_brake(real):
    scenario, document = real
    first, second = prove_document(changed(document, 0, limits=None), scenario).failures
    assert "limits.max_accel is none" in first
    assert "is told to brake at 0 m/s^2 (0 is at once)" in second


def test_wider_turns_than_the_scenario_asks_for_are_no_failure(real):
    scenario, document = real
    wide = replace(document.robots[0].limits, min_turn_radius=0.05)
    assert prove_document(changed(document, 0, limits=wide), scenario).holds


def test_speeds_that_leave_no_reserve_for_catching_up_are_a_failure(real):
    scenario, document = real
    asked = replace(scenario, speed_reserve=0.2)
    failures = prove_document(document, asked).failures
    assert len(failures) == 3
    assert failures[0].startswith("A is planned at up to 0.")
    assert failures[0].endswith("m/s are left by speed_reserve")
