"""The judge against motions whose truth is known."""

import math

import numpy as np
import pytest

from coordinator.errors import InputError
from coordinator.planner import plan_scenario
from coordinator.scenario import Robot, Scenario, Workspace
from coordinator.wire import drive
from sim.blackbox import BlackBox, read_blackbox
from sim.judge import judge_boxes, least_separation


@pytest.fixture(scope="module")
def document():
    robots = tuple(
        Robot(
            id=name,
            start=start,
            goal=goal,
            radius=0.2,
            max_speed=0.5,
            max_accel=math.inf,
            max_lateral_accel=math.inf,
        )
        for name, start, goal in (("A", (1.0, 3.0), (5.0, 3.0)), ("B", (3.0, 1.0), (3.0, 5.0)))
    )
    floor = Workspace(boundary=((0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0)))
    return plan_scenario(Scenario(name="cross", workspace=floor, robots=robots, tau=0.5))


def box(t, places, phases):
    t = np.array(t, dtype=float)
    return BlackBox(t, np.array(places, dtype=float), 0.0 * t, tuple(phases))


def driven_boxes(document, shift=0.0, aside=0.0):
    """Return black boxes that keep to the plan, `shift` s late and `aside` m to the right."""
    boxes = {}
    for driven in drive(document):
        t = np.arange(0.0, driven.timeline.finish + 1.0, 0.01)
        s = np.array([driven.timeline.s_at(time - shift) for time in t])
        place, first = driven.curve.derivatives(driven.curve.parameter_at(s), 1)
        normal = np.column_stack((first[:, 1], -first[:, 0])) / np.hypot(*first.T)[:, None]
        done = s >= driven.curve.length - 1e-6
        phases = ["done" if over else "moving" for over in done]
        boxes[driven.id] = BlackBox(t, place + aside * normal, s, tuple(phases))
    return boxes


def test_robots_that_keep_to_the_plan_are_judged_well(document):
    verdict = judge_boxes(document, driven_boxes(document))
    assert verdict.collisions == 0
    assert verdict.least_separation >= 0.4 + document.margin - 1e-3
    for robot in verdict.robots:
        assert robot.arrived
        assert robot.tracking_error < 1e-4
        assert robot.lateness < 0.02
        assert robot.fault == ""


def test_lateness_within_its_share_of_tau_is_no_tracking_error_but_is_told(document):
    verdict = judge_boxes(document, driven_boxes(document, shift=0.2))
    for robot in verdict.robots:
        assert robot.tracking_error < 1e-3
        assert robot.lateness == pytest.approx(0.2, abs=0.02)


def test_lateness_beyond_its_share_is_a_tracking_error(document):
    verdict = judge_boxes(document, driven_boxes(document, shift=0.5))
    behind = 0.475 * (0.5 - 0.25 - 0.02)
    assert max(robot.tracking_error for robot in verdict.robots) == pytest.approx(behind, abs=0.01)


def test_a_robot_beside_its_path_is_told_by_how_much(document):
    verdict = judge_boxes(document, driven_boxes(document, aside=0.03))
    for robot in verdict.robots:
        assert robot.tracking_error == pytest.approx(0.03, abs=1e-3)
        assert not robot.arrived


def test_a_touch_between_two_rows_is_found():
    a = box([0.0, 1.0], [(0.0, 0.0), (10.0, 0.0)], ["moving"] * 2)
    b = box([0.0, 1.0], [(10.0, 0.1), (0.0, 0.1)], ["moving"] * 2)
    separation, t = least_separation(a, b)
    assert separation == pytest.approx(0.1)
    assert t == pytest.approx(0.5)


def test_the_least_separation_is_what_fine_sampling_finds():
    random = np.random.default_rng(4)
    for _ in range(20):
        boxes = []
        for _ in range(2):
            t = np.sort(random.uniform(0.0, 5.0, 12))
            boxes.append(box(t, random.uniform(0.0, 4.0, (12, 2)), ["moving"] * 12))
        fine = np.linspace(-1.0, 6.0, 40_001)
        apart = boxes[0].at(fine) - boxes[1].at(fine)
        sampled = np.hypot(*apart.T).min()
        assert sampled - 0.02 <= least_separation(*boxes)[0] <= sampled + 1e-9


def test_robots_that_touch_are_counted_as_a_collision(document):
    boxes = driven_boxes(document)
    goal = boxes["A"].places[-1]
    boxes["B"] = box([0.0, 60.0], [(3.0, 1.0), goal], ["moving", "moving"])
    verdict = judge_boxes(document, boxes)
    assert verdict.collisions == 1
    assert not verdict.robots[1].arrived
    assert verdict.robots[1].fault


def test_a_robot_that_never_moved_stands_at_its_start(document):
    boxes = driven_boxes(document)
    boxes["B"] = box([], np.empty((0, 2)), [])
    verdict = judge_boxes(document, boxes)
    assert verdict.collisions == 0
    assert not verdict.robots[1].arrived


@pytest.mark.parametrize("later", ["frozen", "idle"])
@pytest.mark.parametrize(("short", "arrived"), [(0.004, True), (0.04, False)])
def test_a_robot_that_froze_at_its_goal_but_for_some_millimetres_has_arrived(
    document, short, arrived, later
):
    boxes = driven_boxes(document)
    before = boxes["B"]
    kept = before.s <= before.s[-1] - short
    ahead = len(kept) - int(kept.sum())
    places = np.vstack((before.places[kept], [before.places[kept][-1]] * ahead))
    phases = ["moving"] * int(kept.sum()) + ["frozen"] * 10 + [later] * (ahead - 10)
    boxes["B"] = BlackBox(before.t, places, before.s, tuple(phases))
    verdict = judge_boxes(document, boxes).robots[1]
    assert verdict.arrived == arrived
    assert (verdict.fault == "") == arrived
    if arrived:
        reached = np.hypot(*(places - before.places[-1]).T) <= 0.5 * document.margin
        assert verdict.t == pytest.approx(before.t[reached][0], abs=1e-3)


def test_a_last_row_cut_short_is_left_out_and_other_damage_is_told(tmp_path):
    path = tmp_path / "R1.csv"
    path.write_text("t,x,y,heading,s,phase\n0.0,1,2,0,0,moving\n0.01,1,2,0")
    assert len(read_blackbox(path).t) == 1
    path.write_text("t,x,y,heading,s,phase\n0.0,1,zwei,0,0,moving\n0.01,1,2,0,0,moving\n")
    with pytest.raises(InputError, match="line 2"):
        read_blackbox(path)
    path.write_text("time,x\n")
    with pytest.raises(InputError, match="line 1"):
        read_blackbox(path)
