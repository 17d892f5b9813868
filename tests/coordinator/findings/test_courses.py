"""Distances and tracking errors that `info` tells, against the planner's curves and the judge."""

import math

import numpy as np
import pytest

from coordinator.base.errors import InputError
from coordinator.findings.info import courses_of, summarise
from coordinator.findings.plan_facts import summarise_plan
from coordinator.findings.ride_samples import ride_of_message, ride_of_plan
from coordinator.findings.traffic_numbers import every_start
from coordinator.findings.true_course import read_course
from coordinator.log.log_file import read_log
from coordinator.log.recorder import Recorder
from coordinator.plan.trajectory import sample
from coordinator.plan.wire import address, drive, pack
from coordinator.planning.planner import plan_scenario
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Command, Report, Rest
from protocol.phases import DONE, FREEZE, FROZEN, GO, MOVING
from protocol.timing import SECOND
from sim.judging.blackbox import read_blackbox
from sim.judging.judge import judge_boxes, least_separation
from tests.scenarios import a_robot, a_scenario

WALL = [((4.0, 3.0), (6.0, 3.0), (6.0, 5.0), (4.0, 5.0))]
HEADER = "t,x,y,heading,s,phase\n"
BEGIN = 50 * SECOND


@pytest.fixture(scope="module")
def document():
    robots = [
        a_robot("R1", (1.0, 1.0), (9.0, 7.0)),
        a_robot("R2", (1.0, 7.0), (9.0, 1.0)),
        a_robot("R3", (5.0, 7.0), (5.0, 1.0)),
    ]
    return plan_scenario(a_scenario(robots, obstacles=WALL), effort=1)


def test_a_path_and_its_motion_are_sampled_as_the_planner_has_them(document):
    for number, (robot, driven) in enumerate(zip(document.robots, drive(document), strict=True)):
        times = np.linspace(-1.0, driven.timeline.finish + 1.0, 400)
        truth = sample(driven, times.tolist())
        message = decode("plan", pack(document, robot, number))
        for ride in (ride_of_message(message), ride_of_plan(robot)):
            s = ride.driven_at(times)
            assert np.abs(s - truth[:, 3]).max() < 1e-5
            assert np.hypot(*(ride.places_at(s) - truth[:, :2]).T).max() < 2e-4


def write_run(folder, document, boxes=(), frozen=None):
    """A log of a run: the plans, GO at 1 s; a FREEZE at `frozen` [s] and where all rest then."""
    path = folder / "run.mcap"
    with Recorder(path, metadata={"fleet": "f"}, wall_offset_ns=0) as log:

        def say(seconds, key, message):
            payload = message if isinstance(message, bytes) else encode(message)
            log.record(key, payload, BEGIN + round(seconds * SECOND))

        for number, robot in enumerate(document.robots):
            say(0.0, keys.plan("f", robot.id), address(pack(document, robot, number), 9))
        say(0.6, keys.command("f"), Command(9, 1, 1, 1, GO, BEGIN + SECOND, BEGIN + SECOND))
        for number, one in enumerate(drive(document)):
            key, end = keys.report("f", one.id), one.timeline.finish
            say(1.2, key, Report(9, 1, 1, MOVING))
            if frozen is None:
                say(1.0 + end, key, Report(9, 2, 1, DONE))
            elif number == 0:  # falls silent
                say(1.0 + frozen - 0.6, key, Report(9, 2, 1, MOVING))
        if frozen is not None:
            say(1.0 + frozen, keys.command("f"), Command(9, 1, 2, 1, FREEZE, BEGIN + SECOND, BEGIN))
            for one in drive(document)[1:]:
                rest = Rest(rests_at(one, frozen), 1)
                say(9.0 + frozen, keys.report("f", one.id), Report(9, 3, 1, FROZEN, 0, rest))
    for name, rows in dict(boxes).items():
        (folder / f"{name}.csv").write_text(HEADER + "".join(rows))
    return path


def rests_at(driven, t):
    rate = driven.plan.brake_mmps2 / 1000.0
    return driven.timeline.s_at(t) + driven.timeline.v_at(t) ** 2 / (2.0 * rate)


def row(t, x, y, phase):
    return f"{t:.6f},{x:.6f},{y:.6f},0,0,{phase}\n"


def box_rows(driven, late=0.0, aside=0.0):
    """A black box that keeps to the plan, so much late [s] and to the right of it [m]."""
    times = np.arange(0.0, driven.timeline.finish + late + 1.0, 0.01)
    truth = sample(driven, (times - late).tolist())
    done = truth[:, 3] >= driven.curve.length - 1e-9
    x = truth[:, 0] + aside * np.sin(truth[:, 2])
    y = truth[:, 1] - aside * np.cos(truth[:, 2])
    return [
        row(*numbers, "done" if over else "moving")
        for *numbers, over in zip(times, x, y, done, strict=True)
    ]


def told_of(path, folder=None):
    log = read_log(path)
    return summarise(log, courses_of(log, [folder or path.parent]))["robots"]


def test_without_black_boxes_distances_are_those_of_the_plans(tmp_path, document):
    told = told_of(write_run(tmp_path, document))
    assert all(robot["tracking_error"] is robot["true_arrival"] is None for robot in told.values())
    times = np.arange(0.0, max(r.finish_time for r in document.robots) + 1.0, 0.005).tolist()
    places = {one.id: sample(one, times)[:, :2] for one in drive(document)}
    for name, robot in told.items():
        near = robot["nearest"]
        apart = {o: np.hypot(*(places[o] - places[name]).T) for o in places if o != name}
        nearest = min(apart, key=lambda other: apart[other].min())
        assert (near["robot"], near["source"]) == (nearest, "plans")
        assert near["distance"] == pytest.approx(apart[nearest].min(), abs=1e-3)
        at = np.interp(near["t"], times, apart[nearest])
        assert at == pytest.approx(near["distance"], abs=2e-3)
    planned = summarise_plan(document)["robots"]
    assert {n: r["nearest"]["robot"] for n, r in planned.items()} == {
        n: r["nearest"]["robot"] for n, r in told.items()
    }
    assert planned["R1"]["nearest"]["distance"] == pytest.approx(
        told["R1"]["nearest"]["distance"], abs=1e-3
    )


def test_with_black_boxes_all_is_what_the_judge_says(tmp_path, document):
    lates, sides = (0.0, 0.1, 0.6), (0.0, 0.012, 0.15)
    boxes = {
        one.id: box_rows(one, late, side)
        for one, late, side in zip(drive(document), lates, sides, strict=True)
    }
    told = told_of(write_run(tmp_path, document, boxes))
    read = {name: read_blackbox(tmp_path / f"{name}.csv") for name in boxes}
    verdict = judge_boxes(document, read)
    for judged in verdict.robots:
        robot = told[judged.id]
        assert robot["true_arrival"] == judged.t
        assert robot["tracking_error"] == pytest.approx(judged.tracking_error, abs=2e-4)
        others = {o: least_separation(read[judged.id], read[o])[0] for o in read if o != judged.id}
        assert robot["nearest"]["robot"] == min(others, key=others.get)
        assert robot["nearest"]["distance"] == pytest.approx(min(others.values()), abs=1e-3)
        assert robot["nearest"]["source"] == "black boxes"
    assert max(robot.tracking_error for robot in verdict.robots) > 0.1


def test_a_robot_that_broke_off_is_held_against_where_its_plan_had_it_so_far(tmp_path, document):
    one = drive(document)[0]
    times = np.arange(0.0, 4.0, 0.01)
    truth = sample(one, np.minimum(times, 3.0).tolist())
    rows = [
        row(t, x, y + 0.004 * (t > 3.0), "moving" if t <= 3.0 else "braking")
        for t, x, y in zip(times, *truth[:, :2].T, strict=True)
    ]
    told = told_of(write_run(tmp_path, document, {"R1": rows}, frozen=3.0))
    verdict = judge_boxes(
        document,
        {n.id: read_blackbox(tmp_path / "R1.csv") for n in document.robots},
    )
    assert told["R1"]["tracking_error"] == pytest.approx(verdict.robots[0].tracking_error, abs=2e-4)
    assert told["R1"]["nearest"]["source"] == "plans"  # not every robot has a black box


def test_in_a_frozen_fleet_robots_stand_where_they_said_or_were_last_heard(tmp_path, document):
    frozen = 3.0
    told = told_of(write_run(tmp_path, document, frozen=frozen))
    driven = drive(document)
    silent = sample(driven[0], [frozen - 0.6])[0, :2]
    rests = [one.curve.at_arc([rests_at(one, frozen)])[0] for one in driven[1:]]
    times = np.linspace(0.0, frozen, 1000).tolist()
    moving = [sample(one, times)[:, :2] for one in driven]
    moving[0] = sample(driven[0], np.minimum(times, frozen - 0.6).tolist())[:, :2]
    at_rest = [math.dist(silent, place) for place in rests]
    before = [np.hypot(*(moving[0] - other).T).min() for other in moving[1:]]
    least = min(*at_rest, *before)
    assert told["R1"]["nearest"]["distance"] == pytest.approx(least, abs=5e-3)


def test_a_file_that_is_no_black_box_is_named_with_its_line(tmp_path):
    path = tmp_path / "R1.csv"
    path.write_text(HEADER + row(0.0, 1.0, 2.0, "moving") + "0.01,1,2")
    assert len(read_course(path).t) == 1
    for text, said in (
        ("x,y\n", "line 1: the columns are not t,x,y"),
        (HEADER + "0,a,2,0,0,moving\n1,1,2,0,0,moving\n", "line 2: is not a row"),
        (HEADER + "1,1,2,0,0,moving\n0,1,2,0,0,moving\n", "its times do not increase"),
        (HEADER + "0,1,2\n1,1,2,0,0,moving\n", "line 2: is not a row"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=said):
            read_course(path)


def test_black_boxes_with_and_without_estimates_say_the_same(tmp_path):
    path = tmp_path / "R1.csv"
    for header, end in ((HEADER, ""), (f"{HEADER.rstrip()},estimate\n", ",0.5")):
        path.write_text(f"{header}0,1,2,0,0,moving{end}\n1,3,4,0,0,done{end}\n")
        course = read_course(path)
        assert course.places.tolist() == [[1.0, 2.0], [3.0, 4.0]]
        assert course.arrival == 1.0


def test_a_black_box_of_another_run_is_named_and_not_taken_for_this_one(tmp_path, document):
    path = write_run(tmp_path, document, {one.id: box_rows(one) for one in drive(document)})
    start = tmp_path / "R1.csv.start"
    (go_ns,) = every_start([read_log(path)])
    start.write_text(f"1 {go_ns}")
    assert told_of(path)["R1"]["nearest"]["source"] == "black boxes"
    start.write_text(f"1 {go_ns - 90 * SECOND}")
    with pytest.raises(InputError, match=r"R1\.csv: is of another run than the log"):
        told_of(path)
