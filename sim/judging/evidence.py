"""The files that a run has left: its plans, when each began, and the robots' black boxes.

Decides: where in a folder these are looked for, so that programs that were started one by one can
be judged like a run.  Must not know: what a collision is.

A folder holds `plan.json` or a log of the coordinator (`run.mcap`, `run-2.mcap`, ..., or one other
`*.mcap`), and the black box of every robot: `blackbox/ROBOT.csv` or `ROBOT.csv`.  Naming a log
instead means its folder, without the other logs in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from coordinator.base.errors import InputError
from coordinator.log.log_file import logs_before, read_log
from coordinator.log.records import Log
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import from_json, plan_name, read
from protocol import keys
from protocol.codec import decode
from protocol.messages import Command, Plan, Report
from protocol.phases import GO
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


class Evidence(NamedTuple):
    """The first plan, the later epochs according to the logs, and the black boxes by robot.

    `courses`: what robots got besides, by robot, in the order of their times.
    """

    document: PlanDocument
    later: list[Epoch]
    boxes: dict[str, BlackBox]
    courses: dict[str, list[FurtherCourse]]


class _Told(NamedTuple):
    """From the logs: plans by name, the first Command and the time zero of each epoch [ns]."""

    plans: dict[str, bytes]
    begins: dict[int, int]
    starts: dict[int, int]
    courses: dict[tuple[str, int, int], bytes]
    """Plan messages of further courses, by robot, epoch and revision."""

    begun: dict[tuple[str, int, int], int]
    """When robots first reported to drive them [ns]."""


def gather(source: Path) -> Evidence:
    """Return the evidence in a folder, or in a log and its folder.

    Raises InputError when there is no plan, no black box of a robot, or a file cannot be read.
    """
    folder = source if source.is_dir() else source.parent
    told = _told(_logs(source))
    document = _first_plan(folder, source, told.plans)
    boxes = _boxes(folder, document, told.starts)
    return Evidence(document, _later(told), boxes, _courses(told))


def _logs(source: Path) -> list[Log]:
    """Return the logs in order; a log comes after those that it was resumed from."""
    if not source.is_dir():
        log = read_log(source)
        return [*logs_before(log), log]
    paths = sorted(source.glob("run*.mcap"), key=lambda path: (len(path.name), path.name))
    paths = paths or sorted(source.glob("*.mcap"))[:1]
    newest = [read_log(path) for path in paths]
    return [one for log in newest for one in (*logs_before(log), log)]


def _told(logs: Sequence[Log]) -> _Told:
    told = _Told({}, {}, {}, {}, {})
    for log in logs:
        told.plans.update(log.attachments)
        for record in log.records:
            place = keys.split(record.key)
            message = None if place is None else decode(place[1], record.payload)
            if isinstance(message, Command):
                told.begins.setdefault(message.epoch, record.log_ns)
                if message.phase == GO:
                    told.starts.setdefault(message.epoch, message.start_ns)
            elif isinstance(message, Plan | Report) and place is not None and message.revision:
                course = (place[2], message.epoch, message.revision)
                if isinstance(message, Plan):
                    told.courses[course] = record.payload
                else:
                    told.begun.setdefault(course, record.log_ns)
    return told


def _first_plan(folder: Path, source: Path, plans: Mapping[str, bytes]) -> PlanDocument:
    """Return the plan of the first epoch, from a log's attachment, else from its file."""
    if "plan-1.json" in plans:
        return from_json(plans["plan-1.json"], f"{source}: plan-1.json")
    if source.is_dir() and (folder / "plan.json").exists():
        return read(folder / "plan.json")
    wanted = "plan.json, or a log that the coordinator wrote (--log run.mcap)"
    raise InputError([f"{source}: holds no plan; `judge` needs {wanted}"])


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
    for course, begun_ns in sorted(told.begun.items(), key=lambda item: item[1]):
        robot, epoch, _ = course
        if course in told.courses and epoch in told.starts:
            begin = (begun_ns - told.starts[first]) / SECOND
            start = (told.starts[epoch] - told.starts[first]) / SECOND
            found.setdefault(robot, []).append(FurtherCourse(told.courses[course], begin, start))
    return found


def _boxes(folder: Path, document: PlanDocument, starts: Mapping[int, int]) -> dict[str, BlackBox]:
    """Read the black boxes; InputError states all problems, with missing boxes on one line.

    starts: the time zero of each epoch by the logs [ns]; a box that began at another GO is of
    another run.
    """
    boxes: dict[str, BlackBox] = {}
    missing: list[str] = []
    problems: list[str] = []
    for robot in document.robots:
        places = [folder / "blackbox" / f"{robot.id}.csv", folder / f"{robot.id}.csv"]
        found = next((place for place in places if place.exists()), None)
        if found is None:
            missing.append(robot.id)
            continue
        if not _is_of_run(found, starts):
            problems.append(f"{found}: is of another run than the log")
            continue
        try:
            boxes[robot.id] = read_blackbox(found)
        except InputError as error:
            problems += error.problems
    if missing:
        one = missing[0]
        wanted = f"{folder}/{one}.csv or {folder}/blackbox/{one}.csv"
        how = f"`splinefleet agent {one} --blackbox {one}.csv` writes one"
        problems.insert(0, f"no black box of {', '.join(missing)}: there is no {wanted}; {how}")
    if problems:
        raise InputError(problems)
    return boxes


def _is_of_run(box: Path, starts: Mapping[int, int]) -> bool:
    """Return whether a black box began at one of these times; True where that is not known."""
    try:
        began = box.with_name(f"{box.name}.start").read_text(encoding="ascii").split()
    except (OSError, UnicodeDecodeError):
        return True
    return not starts or began[-1:] in [[str(start)] for start in starts.values()]
