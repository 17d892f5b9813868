"""What info tells of robots on their further courses, and of a log that goes on from another."""

import pytest

from coordinator.findings.info import summarise
from coordinator.findings.true_course import read_course
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Plan
from protocol.phases import GO
from tests.coordinator.a_day import AWAY_S, STOPPED_S


def courses(logs):
    """Each robot's last course, and the time zero of its plan when it was sent [ns]."""
    start, found = 0, {}
    for log in logs:
        for record in log.records:
            place = keys.split(record.key)
            if place is None or place[1] not in ("command", "plan"):
                continue
            message = decode(place[1], record.payload)
            if isinstance(message, Command) and message.phase == GO:
                start = message.start_ns
            elif isinstance(message, Plan):
                found.setdefault(
                    (message.robot, message.revision), (message, start, len(record.payload))
                )
    return {robot: found[robot, revision] for robot, revision in sorted(found)}


def test_planned_and_late_are_those_of_the_last_course_of_each_robot(day):
    logs, boxes = day
    told = summarise(logs[-1], before=logs[:-1])
    states = {one["id"]: one for one in told["orders"]}
    assert set(told["robots"]) == set(boxes)
    for robot in told["robots"].values():
        assert robot["late"] == pytest.approx(robot["arrived"] - robot["planned_finish"])
    for order, name in {"c": "R1", "f": "R3", "e": "R4"}.items():
        robot, one = told["robots"][name], states[order]
        assert robot["planned_finish"] == pytest.approx(one["planned_arrival"], abs=0.01), order
        assert robot["arrived"] == pytest.approx(one["arrived"], abs=0.11)
        assert one["late"] == pytest.approx(one["arrived"] - one["planned_arrival"])
    assert -0.1 < states["c"]["late"] < 1.0
    stops = STOPPED_S + AWAY_S  # Both came while R3 was on its way.
    assert stops < states["b"]["late"] < stops + 4.0
    assert states["e"]["late"] > AWAY_S
    assert -1.0 < told["robots"]["R2"]["late"] < 1.0  # It had arrived before the restart.


def test_a_log_that_goes_on_from_another_tells_tau_plans_and_times(day):
    logs, _ = day
    told = summarise(logs[-1], before=logs[:-1])
    assert len(logs) == 2
    first = summarise(logs[0])
    assert told["tau"] == first["tau"] > 0.0
    for name, (plan, _, size) in courses(logs).items():
        robot = told["robots"][name]
        assert robot["plan_bytes"] >= size
        assert robot["control_points"] == len(plan.points) // 8, name
        assert robot["planned_finish"] is not None
    assert told["largest_plan_bytes"] == max(one["plan_bytes"] for one in told["robots"].values())


def test_the_true_arrival_is_that_at_the_goal_of_the_last_course(tmp_path):
    rows = [(0.0, "moving"), (5.0, "done"), (6.0, "done"), (7.0, "moving"), (9.5, "done")]
    lines = ["t,x,y,heading,s,phase", *(f"{t},1,2,0,0,{phase}" for t, phase in rows)]
    (tmp_path / "R1.csv").write_text("\n".join(lines) + "\n")
    assert read_course(tmp_path / "R1.csv").arrival == 9.5
