"""Arcs on one side and the pace on them; whole circles of robots that cross."""

import math

import numpy as np
import pytest

from benchmarks.flow import circle
from coordinator.bends.same_side import BULGES, Mover, arc, same_side
from coordinator.bends.traffic_kernels import gathered
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Robot, Scenario, Workspace

MARGIN, TAU = 0.05, 1.0


def ring(count, spacing=1.0):
    """Return robots on a circle, their neighbours at a spacing [m], who go to the other side."""
    radius = count * spacing / (2.0 * math.pi)
    turns = 2.0 * math.pi * np.arange(count) / count
    starts = radius * np.column_stack((np.cos(turns), np.sin(turns)))
    return [Mover(start, -start, 0.2, 0.8, 0.8) for start in starts]


def anywhere(_index, _way):
    return True


def flat(_index, way):
    return len(way) < 9


def not_the_third(index, _way):
    return index != 3


def gather(parts):
    owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return gathered(np.concatenate(parts), owner, -20.0, -20.0, 0.6, 67, 67)


def distance(movers, arcs, pace, tau):
    """Return the least distance of any two robots up to tau [s] apart, densely sampled."""
    times = np.arange(0.0, 60.0, 0.05)
    tracks = []
    for one, way in zip(movers, arcs, strict=True):
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
        speed = min(one.speed, pace)
        s = speed * np.maximum(times - 0.5 * speed / one.accel, 0.0)
        tracks.append(np.column_stack([np.interp(s, along, way[:, axis]) for axis in (0, 1)]))
    least = math.inf
    for i, mine in enumerate(tracks):
        for theirs in tracks[:i]:
            for shift in range(-round(tau / 0.05), round(tau / 0.05) + 1):
                a = mine[max(shift, 0) : len(times) + min(shift, 0)]
                b = theirs[max(-shift, 0) : len(times) - max(shift, 0)]
                least = min(least, float(np.hypot(*(a - b).T).min()))
    return least


@pytest.mark.parametrize("bulge", BULGES)
def test_an_arc_is_a_piece_of_a_circle_that_goes_aside_as_far_as_asked(bulge):
    start, goal = np.array((1.0, 2.0)), np.array((5.0, -1.0))
    way = arc(start, goal, bulge)
    assert way[0] == pytest.approx(start)
    assert way[-1] == pytest.approx(goal)
    right = np.array((-3.0, -4.0)) / 5.0
    assert ((way - 0.5 * (start + goal)) @ right).max() == pytest.approx(2.5 * bulge)
    a, b, c = way[0], way[len(way) // 2], way[-1]
    middle = np.linalg.solve(
        2.0 * np.array((b - a, c - a)), np.array((b @ b - a @ a, c @ c - a @ a))
    )
    assert np.ptp(np.hypot(*(way - middle).T)) < 1e-9


def test_on_the_arcs_of_a_circle_nobody_comes_near_anybody():
    movers = ring(10, spacing=3.0)
    found = same_side(movers, anywhere, gather, MARGIN, TAU)
    assert found
    assert [one.arrivals for one in found] == sorted(one.arrivals for one in found)
    for one in found[:2]:
        assert distance(movers, one.arcs, one.pace, TAU) > 0.4 + MARGIN - 0.03


def test_arcs_that_the_floor_has_no_room_for_are_left_out():
    movers = ring(10, spacing=3.0)
    some, all_ = (same_side(movers, keeps, gather, MARGIN, TAU) for keeps in (flat, anywhere))
    assert 0 < len(some) < len(all_)
    assert same_side(movers, not_the_third, gather, MARGIN, TAU) == []


def test_robots_that_cannot_flow_at_any_pace_have_no_arcs():
    movers = [
        Mover(np.array((0.0, 0.0)), np.array((6.0, 0.0)), 0.2, 0.8, 0.8),
        Mover(np.array((2.0, 5.0)), np.array((6.0, 0.1)), 0.2, 0.8, 0.8),
    ]
    assert same_side(movers, anywhere, gather, MARGIN, TAU) == []


def test_a_circle_of_seventeen_takes_hardly_longer_than_driving_alone():
    limits = {"radius": 0.25, "max_speed": 0.8, "max_accel": 0.8, "max_lateral_accel": 0.8}
    turns = 2.0 * np.pi * np.arange(17) / 17
    places = 12.0 + 9.0 * np.column_stack((np.cos(turns), np.sin(turns)))
    robots = tuple(
        Robot(id=f"R{n}", start=tuple(place), goal=tuple(24.0 - place), **limits)
        for n, place in enumerate(places)
    )
    floor = ((0.0, 0.0), (24.0, 0.0), (24.0, 24.0), (0.0, 24.0))
    workspace = Workspace(boundary=floor, obstacles=())
    document = plan_scenario(Scenario(name="c", workspace=workspace, robots=robots, tau=TAU))
    assert document.proof.holds
    assert max(robot.finish_time for robot in document.robots) < 1.3 * (18.0 / 0.76 + 0.95)


@pytest.mark.parametrize("count", [8, 12, 16])
def test_a_circle_of_robots_arrives_no_later_than_round_about_at_one_pace(
    count,
):
    scenario = circle(count)
    one, plan = scenario.robots[0], plan_scenario(scenario)
    need = 2.0 * one.radius + scenario.margin
    pace = min(scenario.planned_speed(one), (1.0 - need) / plan.tau)
    by_hand = 0.5 * count / pace + pace / one.max_accel
    arrivals = [robot.finish_time for robot in plan.robots]
    assert max(arrivals) < by_hand
    assert sum(arrivals) < count * by_hand
