"""The files that a run has left: its plans, when each began, and the robots' black boxes.

Decides: where in a folder these are looked for, so that programs that were started one by one can
be judged like a run.  Must not know: what a collision is.

A folder holds `plan.json` or a log of the coordinator (log/log_file.py says which), and the black
box of every robot: `blackbox/ROBOT.csv` or `ROBOT.csv`.  Naming a log instead means its folder,
without the other logs in it.  Robots that joined may lack a black box.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from coordinator.base.errors import InputError
from coordinator.findings.attendance import Attendance
from coordinator.findings.attendance import Stay as Present
from coordinator.findings.true_course import STOPPED
from coordinator.log.box_file import boxes_of_run
from coordinator.log.log_file import logs_before, read_folder, read_log
from coordinator.log.log_folder import box_folders, hint_below
from coordinator.log.records import Log, Record
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import from_json, plan_name, read
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Message, Plan, Report
from protocol.phases import GO, MOVING, PHASE_NAMES
from protocol.timing import SECOND
from sim.judging.blackbox import BlackBox, read_blackbox


class Epoch(NamedTuple):
    """A plan, when it was first sent to robots, and when it started [s since the first GO]."""

    document: PlanDocument
    begin: float
    start: float


class FurtherCourse(NamedTuple):
    """A course that a robot got while the fleet drove: its Plan message, and since when.

    begin: when the robot began it; start: the time zero of its epoch [s since the first GO].
    """

    payload: bytes
    begin: float
    start: float


class Stay(NamedTuple):
    """A time that a robot was in the fleet, and its radius [m] then; times [s since the first GO].

    The times are infinite if it was there from the beginning, or to the end.
    """

    radius: float
    since: float = -math.inf
    until: float = math.inf


class Evidence(NamedTuple):
    """The first plan, the later epochs according to the logs, and the black boxes by robot.

    `courses`: what robots got besides, by robot, in the order of their times.  `stays`: when robots
    that joined or left were in the fleet.  `remarks`: what one has to know of the log's files.
    """

    document: PlanDocument
    later: list[Epoch]
    boxes: dict[str, BlackBox]
    courses: dict[str, list[FurtherCourse]]
    stays: dict[str, list[Stay]]
    remarks: list[str]


_Which = tuple[str, int, int, int]
"""A further course: its robot, epoch, number and revision."""


class _Told:
    """What the logs say; times in ns."""

    def __init__(self) -> None:
        self.plans: dict[str, bytes] = {}
        self.begins: dict[int, int] = {}
        """When each epoch's first Command was sent."""

        self.starts: dict[int, int] = {}
        """The time zero of each epoch."""

        self.start_now: dict[int, int] = {}
        """The time zero that holds now: it is put off while the fleet stands still."""

        self.every_start: set[int] = set()
        """Every time zero that has held."""

        self.courses: dict[_Which, bytes] = {}
        self.begun: dict[_Which, int] = {}
        """When robots first reported to drive them; the first one of a robot that joins: when it
        was sent."""

        self.zeros: dict[_Which, int] = {}
        """The time zero that held when each course was begun."""

        self._newest: dict[tuple[str, int, int], _Which] = {}

    def take(self, message: Message | None, record: Record, robot: str) -> None:
        """Take in a message of the fleet."""
        if isinstance(message, Command):
            self.begins.setdefault(message.epoch, record.log_ns)
            if message.phase == GO:
                self.starts.setdefault(message.epoch, message.start_ns)
                self.every_start.add(message.start_ns)
                self.start_now[message.epoch] = message.start_ns
        elif isinstance(message, Plan) and (message.revision or message.begin_ms):
            which = (robot, message.epoch, message.number, message.revision)
            self.courses[which] = record.payload
            self._newest[robot, message.epoch, message.revision] = which
            if not message.revision:
                self._begin(which, record.log_ns)
        elif isinstance(message, Report):
            found = self._newest.get((robot, message.epoch, message.revision))
            if found is not None:
                self._begin(found, record.log_ns)

    def _begin(self, course: _Which, log_ns: int) -> None:
        """Take in that a robot drives a course, the first time that it says so."""
        _, epoch, _, _ = course
        if course not in self.begun:
            self.begun[course] = log_ns
            if epoch in self.start_now:
                self.zeros[course] = self.start_now[epoch]


def gather(source: Path) -> Evidence:
    """Return the evidence in a folder, or in a log and its folder.

    Raises InputError when there is no plan, no black box of a robot, or a file cannot be read.
    """
    folder = source if source.is_dir() else source.parent
    logs, told = _logs(source), _Told()
    for log in logs:
        told.plans.update(log.attachments)
    document = _first_plan(folder, source, told.plans)
    present = Attendance(robot.id for robot in document.robots)
    for record in (record for log in logs for record in log.records):
        place = keys.split(record.key)
        message = None if place is None else decode(place[1], record.payload)
        present.take(message, record.log_ns)
        told.take(message, record, "" if place is None else place[2])
    stays = _stays(document, present, told)
    boxes = _boxes(source, document, present.stays, told)
    remarks = [*logs[-1].remarks, *_driven_later(logs[-1], told, boxes)] if logs else []
    return Evidence(document, _later(told), boxes, _courses(told), stays, remarks)


def _driven_later(log: Log, told: _Told, boxes: Mapping[str, BlackBox]) -> list[str]:
    """Return a remark if robots drove on long after a log's end: by a log that resumes it."""
    if not (log.records and told.starts):
        return []
    end = (log.records[-1].log_ns - min(told.starts.values())) / SECOND
    later = [
        name
        for name, box in boxes.items()
        if (np.array(box.phases)[box.t > end + STOPPED] == PHASE_NAMES[MOVING]).any()
    ]
    names = ", ".join(sorted(later))
    what = "drove on later: if another log resumes this one, judge that"
    return [f"the log ends at {end:.1f} s, and {names} {what}"] if later else []


def _stays(document: PlanDocument, present: Attendance, told: _Told) -> dict[str, list[Stay]]:
    """Return when the robots that joined or left were in the fleet."""
    radii = {robot.id: robot.radius for robot in document.robots}
    first = min(told.starts.values(), default=0)

    def stay(robot: str, one: Present) -> Stay:
        radius = radii[robot] if one.join is None else one.join.radius_m
        since, until = (
            None if ns is None else (ns - first) / SECOND for ns in (one.since_ns, one.until_ns)
        )
        return Stay(
            radius, -math.inf if since is None else since, math.inf if until is None else until
        )

    return {
        robot: [stay(robot, one) for one in stays]
        for robot, stays in present.stays.items()
        if stays != [Present()]
    }


def _logs(source: Path) -> list[Log]:
    """Return the logs in order; a log comes after those that it was resumed from."""
    log = read_folder(source) if source.is_dir() else read_log(source)
    return [] if log is None else [*logs_before(log), log]


def _first_plan(folder: Path, source: Path, plans: Mapping[str, bytes]) -> PlanDocument:
    """Return the plan of the first epoch, from a log's attachment, else from its file."""
    if "plan-1.json" in plans:
        return from_json(plans["plan-1.json"], f"{source}: plan-1.json")
    if source.is_dir() and (folder / "plan.json").exists():
        return read(folder / "plan.json")
    wanted = "plan.json, or a log that the coordinator wrote (--log run.mcap)"
    raise InputError([f"{source}: holds no plan; `judge` needs {wanted}{hint_below(folder)}"])


def _later(told: _Told) -> list[Epoch]:
    """Return the plans after the first whose epochs started, in the order of their times."""
    first = min(told.starts, default=0)
    return [
        Epoch(
            from_json(told.plans[name], name),
            (begin_ns - told.starts[first]) / SECOND,
            (told.starts[epoch] - told.starts[first]) / SECOND,
        )
        for epoch, begin_ns in sorted(told.begins.items())
        if epoch != first and epoch in told.starts and (name := plan_name(epoch)) in told.plans
    ]


def _courses(told: _Told) -> dict[str, list[FurtherCourse]]:
    """Return the courses that robots have begun while the fleet drove."""
    found: dict[str, list[FurtherCourse]] = {}
    first = min(told.starts, default=0)
    for which, begun_ns in sorted(told.begun.items(), key=lambda item: item[1]):
        robot, epoch, _, _ = which
        if epoch in told.starts:
            begin = (begun_ns - told.starts[first]) / SECOND
            start = (told.zeros.get(which, told.starts[epoch]) - told.starts[first]) / SECOND
            found.setdefault(robot, []).append(FurtherCourse(told.courses[which], begin, start))
    return found


def _boxes(
    source: Path, document: PlanDocument, robots: Iterable[str], told: _Told
) -> dict[str, BlackBox]:
    """Read the black boxes; InputError states all problems, with missing boxes on one line.

    A box that began at a GO that the logs do not know is of another run.
    """
    boxes: dict[str, BlackBox] = {}
    folders = box_folders(source)
    missing: list[str] = []
    problems: list[str] = []
    needed = {robot.id for robot in document.robots}
    first = min(told.starts.values(), default=None)
    for robot in robots:
        places = [folder / f"{robot}.csv" for folder in folders]
        found = next((place for place in places if place.exists()), None)
        if found is None:
            missing += [robot] if robot in needed else []
            continue
        files = boxes_of_run(found, told.every_start)
        if not files:
            problems.append(f"{found}: is of another run than the log")
            continue
        try:
            boxes[robot] = read_blackbox(files[-1], first, files[:-1])
        except InputError as error:
            problems += error.problems
    if missing:
        one = missing[0]
        wanted = f"{folders[1]}/{one}.csv or {folders[0]}/{one}.csv"
        how = f"`splinefleet agent {one} --blackbox {one}.csv` writes one"
        problems.insert(0, f"no black box of {', '.join(missing)}: there is no {wanted}; {how}")
    if problems:
        raise InputError(problems)
    return boxes
