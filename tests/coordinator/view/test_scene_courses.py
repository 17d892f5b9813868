"""Robots on their further courses: the page has them where they truly were."""

from itertools import pairwise

import numpy as np
import pytest

from coordinator.exchange.foxglove import poses_of
from coordinator.exchange.motion_story import story_of_log
from coordinator.view.live_course import LiveCourse
from coordinator.view.scene_log import scene_of_logs
from protocol import keys
from protocol.codec import decode
from protocol.messages import Plan
from protocol.phases import GO
from protocol.timing import SECOND
from tests.coordinator.a_day import AWAY_S, STOPPED_S
from tests.coordinator.view.test_page_and_export import shown


def assert_where_they_were(scene, boxes):
    assert [body.id for body in scene.robots] == ["R1", "R2", "R3", "R4"]
    for name, box in boxes.items():
        times = np.arange(max(box.t[0], 0.0), box.t[-1], 0.1)
        off = np.hypot(*(shown(scene, name, times) - box.at(times)).T)
        off = off[~np.isnan(off)]
        assert len(off) > 0.5 * len(times), name
        assert off.max() < 0.2, (name, times[np.argmax(off)])
        assert np.median(off) < 0.03, name


def test_the_page_of_a_day_has_robots_where_they_truly_were(day):
    logs, boxes = day
    scene = scene_of_logs([(str(n), log) for n, log in enumerate(logs)])
    assert_where_they_were(scene, boxes)
    stop, away = scene.epochs[0].stops
    assert (stop.until - stop.since) == pytest.approx(STOPPED_S, abs=1.0)
    assert (away.until - away.since) == pytest.approx(AWAY_S, abs=1.0)
    assert 0.0 < stop.late < away.late < STOPPED_S + AWAY_S + 2.0
    told = [(mark.kind, mark.text) for mark in scene.marks]
    assert told[:3] == [
        ("go", "epoch 1: 3 robots go"),
        ("freeze", "told to stop"),
        ("go", "told to go on"),
    ]


def test_a_robot_that_got_its_next_course_on_its_way_is_drawn_from_course_to_course(day):
    """It was told of it before it was there, and drives it once it is."""
    logs, _ = day
    scene = scene_of_logs([(str(n), log) for n, log in enumerate(logs)])
    index = [body.id for body in scene.robots].index("R3")
    *_, before, after = [ride for ride in scene.epochs[0].rides if ride.robot == index]
    assert before.ends == pytest.approx(before.legs[-1][1], abs=1e-3)
    assert after.told + 0.5 < after.since
    states = {order.id: order.steps for order in scene.orders if order.id in ("b", "f")}
    under_way = {name: steps[-2][0] for name, steps in states.items()}
    assert under_way["f"] < states["b"][-1][0] <= after.since + 0.3


def test_the_export_of_a_day_has_robots_where_they_truly_were(day):
    (_, log), boxes = day
    story = story_of_log(log)
    for name, legs in story.of_robots().items():
        assert all(one.end <= other.begin + 0.25 for one, other in pairwise(legs)), name
        times = np.arange(max(boxes[name].t[0], legs[0].begin), boxes[name].t[-1], 0.1)
        off = np.hypot(*(poses_of(legs, times)[:, :2] - boxes[name].at(times)).T)
        assert off.max() < 0.2, (name, times[np.argmax(off)])


def heard(logs, skip=()):
    """What a listener knows that heard all of the logs but some courses (robot, revision)."""
    course = LiveCourse(None, None)
    for log in logs:
        for record in log.records:
            place = keys.split(record.key)
            message = decode(place[1], record.payload) if place and place[1] == "plan" else None
            if isinstance(message, Plan) and (message.robot, message.revision) in skip:
                continue
            course.hear(record.key, record.payload, record.log_ns / SECOND)
    return course


def test_the_page_of_a_running_fleet_has_robots_where_they_truly_were(day):
    logs, boxes = day
    course = heard(logs)
    assert course.unheard.robots == set()
    assert_where_they_were(course.scene(), boxes)


def test_a_listener_asks_for_a_course_that_it_missed_and_draws_it_from_its_beginning(day):
    logs, _ = day
    whole = heard(logs).scene()
    newest = max(ride.revision for ride in whole.epochs[0].rides if ride.robot == 0)
    course = heard(logs, [("R1", newest)])
    assert course.unheard.robots == {"R1"}
    plans = [record for log in logs for record in log.records if "/plan/R1" in record.key]
    (missed, *_) = [one for one in plans if decode("plan", one.payload).revision == newest]
    end = logs[-1].records[-1].log_ns / SECOND
    assert course.hear(missed.key, missed.payload, end + 1.0)
    assert course.unheard.robots == set()
    (ride,) = (
        one for one in course.scene().epochs[0].rides if (one.robot, one.revision) == (0, newest)
    )
    (same,) = (one for one in whole.epochs[0].rides if (one.robot, one.revision) == (0, newest))
    assert (ride.path, ride.legs, ride.since) == (same.path, same.legs, same.since)


def test_a_listener_that_comes_late_has_robots_right_from_what_it_asks_for(day):
    (log, *_), boxes = day
    zero_ns = next(
        command.start_ns
        for record in log.records
        if record.key.endswith("/command")
        and (command := decode("command", record.payload)).phase == GO
    )
    came_ns = zero_ns + round(5.0 * SECOND)
    course, plans = LiveCourse(None, None), {}
    for record in log.records:
        if record.log_ns >= came_ns:
            course.hear(record.key, record.payload, record.log_ns / SECOND)
            for robot in course.unheard.robots & plans.keys():
                old = plans[robot]
                course.hear(old.key, old.payload, record.log_ns / SECOND)
        elif "/plan/" in record.key:
            plans[record.key.rpartition("/")[2]] = record
    assert course.unheard.robots == set()
    scene = course.scene()
    for name, box in boxes.items():
        times = np.arange(6.0, scene.end, 0.1)
        off = np.hypot(*(shown(scene, name, times) - box.at(times)).T)
        assert np.nanmax(off) < 0.2, name


def test_a_course_that_was_sent_and_is_not_driven_yet_is_told_as_such(day):
    logs, _ = day
    course, seen = LiveCourse(None, None), []
    for record in logs[0].records:
        changed = course.hear(record.key, record.payload, record.log_ns / SECOND)
        if changed and "/plan/" in record.key:
            seen += [one for one in course.scene().epochs[0].rides if one.told is not None][-1:]
    assert any(one.since is None for one in seen)


def test_a_page_that_was_open_for_long_forgets_what_robots_drove_long_ago(day, monkeypatch):
    monkeypatch.setattr("coordinator.view.live_course._KEPT", 15 * SECOND)
    logs, boxes = day
    whole, scene = scene_of_logs([(str(n), log) for n, log in enumerate(logs)]), heard(logs).scene()
    assert scene.begin == pytest.approx(scene.end - 15.0, abs=0.01)
    assert len(scene.epochs[0].rides) < len(whole.epochs[0].rides)
    assert [mark for mark in scene.marks if mark.t < scene.begin] == []
    for name, box in boxes.items():
        times = np.arange(scene.begin, box.t[-1], 0.1)
        off = np.hypot(*(shown(scene, name, times) - box.at(times)).T)
        assert np.nanmax(off, initial=0.0) < 0.2, name
