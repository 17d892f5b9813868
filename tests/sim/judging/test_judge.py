"""The judge against motions whose truth is known."""

import io
import math

import numpy as np
import pytest
import shapely
from msgspec.structs import replace
from rich.console import Console
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Robot, Scenario, Workspace
from protocol.phases import DONE, MOVING
from protocol.timing import MILLISECOND, SECOND
from robot_agent import blackbox
from robot_agent.core.clock_sync import ClockSync
from sim.cli.run_commands import commands
from sim.judging.blackbox import BlackBox, read_blackbox
from sim.judging.judge import judge, judge_boxes, least_separation
from sim.processes import summary


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


def test_a_robot_that_sets_out_again_long_after_its_arrival_is_not_late(document):
    boxes = {}
    for name, box in driven_boxes(document).items():
        t = np.append(box.t, box.t[-1] + 10.0)
        places, s = np.vstack((box.places, box.places[-1:])), np.append(box.s, box.s[-1])
        boxes[name] = BlackBox(t, places, s, (*box.phases, "moving"))
    assert max(robot.lateness for robot in judge_boxes(document, boxes).robots) < 0.02


@pytest.mark.parametrize("late", [0.2, 3.0])
def test_lateness_is_no_tracking_error_but_is_told(document, late):
    verdict = judge_boxes(document, driven_boxes(document, shift=late))
    for robot in verdict.robots:
        assert robot.tracking_error < 1e-3
        assert robot.lateness == pytest.approx(late, abs=0.02)


def test_being_ahead_of_the_plan_is_a_tracking_error(document):
    verdict = judge_boxes(document, driven_boxes(document, shift=-0.5))
    ahead = 0.475 * (0.5 - 0.02)
    assert max(robot.tracking_error for robot in verdict.robots) == pytest.approx(ahead, abs=0.01)


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


START_NS = 100 * SECOND


def write_boxes(folder, document, wrong, cut=lambda line: line):
    """Leave what a run leaves of robots that drive by their own estimates of the time.

    wrong: how far ahead [s] of the host's clock the answers are that a robot got about it; cut:
    what is left of a line of a black box.
    """
    folder.mkdir(exist_ok=True)
    (folder / "plan.json").write_bytes(to_json(document))
    for driven in drive(document):
        begin_ns = START_NS - SECOND
        told_ns = begin_ns + round(wrong.get(driven.id, 0.0) * SECOND)
        sync = ClockSync()
        sync.ask(begin_ns - MILLISECOND)
        assert sync.add(begin_ns - MILLISECOND, told_ns, told_ns, begin_ns + MILLISECOND)
        path = folder / f"{driven.id}.csv"
        box = blackbox.BlackBox(path)
        box.begin(7, START_NS)
        for now_ns in range(begin_ns, begin_ns + 20 * SECOND, 10 * MILLISECOND):
            estimate_ns = now_ns + sync.offset_ns
            s = driven.timeline.s_at((estimate_ns - START_NS) / SECOND)
            x, y = driven.curve.at_arc([s])[0]
            phase = DONE if s >= driven.curve.length - 1e-6 else MOVING
            box.write(now_ns, estimate_ns, (x, y, 0.0), s, phase)
        box.close()
        lines = path.read_text().splitlines()
        path.write_text("".join(f"{cut(line)}\n" for line in lines))
    return folder


@pytest.fixture
def one_machine(monkeypatch):
    monkeypatch.setattr("robot_agent.blackbox.shares_clock", lambda _boot: True)


def shown(verdict):
    text = io.StringIO()
    Console(file=text, width=200).print(summary.render_verdict(verdict))
    return text.getvalue()


@pytest.mark.usefixtures("one_machine")
def test_a_robot_that_a_stranger_made_late_is_judged_in_true_time(document, tmp_path):
    right = judge(write_boxes(tmp_path / "right", document, {}))
    wrong = judge(write_boxes(tmp_path / "wrong", document, {"A": -3.0}))
    assert [robot.clock_error for robot in right.robots] == [0.0, 0.0]
    assert [robot.clock_error for robot in wrong.robots] == [3.0, 0.0]
    assert wrong.robots[0].lateness == pytest.approx(3.0, abs=0.03)
    assert wrong.robots[0].t == pytest.approx(right.robots[0].t + 3.0, abs=0.02)
    assert wrong.robots[1] == right.robots[1]
    assert wrong.least_separation < right.least_separation
    assert "3000.0" in shown(wrong)
    assert "unknown" not in shown(wrong)


@pytest.mark.parametrize("columns", [6, 7])
def test_where_only_estimates_are_known_no_clock_error_is_told_and_that_is_said(
    document, tmp_path, columns
):
    def cut(line):
        return ",".join(line.split(",")[:columns])

    verdict = judge(write_boxes(tmp_path, document, {"A": -3.0}, cut))
    assert [robot.clock_error for robot in verdict.robots] == [None, None]
    assert verdict.robots[0].lateness < 0.02
    assert "clock errors of all robots are unknown" in shown(verdict)


def test_robots_keep_their_distance_from_the_edge_of_the_floor(document):
    verdict = judge_boxes(document, driven_boxes(document))
    assert verdict.collisions_with_obstacles == 0
    assert verdict.least_clearance == pytest.approx(0.8, abs=0.01)
    assert [robot.least_clearance for robot in verdict.robots] == [verdict.least_clearance] * 2


def test_a_robot_that_touches_an_obstacle_has_collided_with_it(document, tmp_path):
    block = [(2.0, 3.19), (2.5, 3.19), (2.5, 4.0)]
    floor = replace(document.workspace, obstacles=[block])
    walled = replace(document, workspace=floor)
    verdict = judge_boxes(walled, driven_boxes(document))
    assert verdict.collisions_with_obstacles == 1
    assert verdict.collisions == 0
    assert verdict.least_clearance == pytest.approx(-0.01, abs=1e-5)
    assert verdict.robots[0].least_clearance == verdict.least_clearance
    assert verdict.robots[1].least_clearance > 0.0
    t, x, y = verdict.robots[0].nearest_solid
    corner_apart = shapely.Polygon(block).distance(shapely.Point(x, y))
    assert corner_apart == pytest.approx(0.2 - 0.01, abs=1e-3)
    assert all(robot.arrived for robot in verdict.robots)
    assert not summary.succeeded(0, verdict)
    where = f"A at ({x:.2f}, {y:.2f}), {t:.2f} s"
    assert f"collisions with obstacles 1: {where}" in " ".join(shown(verdict).split())
    done = CliRunner().invoke(commands, ["judge", str(write_boxes(tmp_path, walled, {}))])
    assert done.exit_code == 1, done.output


def test_without_a_floor_obstacles_are_not_judged_and_that_is_said(document):
    verdict = judge_boxes(replace(document, workspace=None), driven_boxes(document))
    assert verdict.collisions_with_obstacles is None
    assert verdict.least_clearance is None
    assert verdict.robots[0].least_clearance is None
    assert summary.succeeded(0, verdict)
    assert "collisions with obstacles are unknown: the plan holds no floor" in shown(verdict)
