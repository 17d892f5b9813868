"""Computes the robots' motions over a whole log, or in a plan.

Robots send no positions, so the motions follow from the plans.

Decides: which plan a robot drove when, and where it came to rest.  Must not know: file formats of
other tools (foxglove.py).

Times of a story are seconds since the GO of its first epoch, as in black boxes and CSV files.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Final

import msgspec
import numpy as np

from coordinator.base.errors import InputError
from coordinator.curves.nurbs import Array
from coordinator.findings.braking import Driving, Said
from coordinator.findings.info import summarise
from coordinator.findings.info_fields import Summary
from coordinator.findings.progress import Progress
from coordinator.findings.traffic_numbers import clock_lag, is_own
from coordinator.log.log_file import readable_logs_before
from coordinator.log.log_writer import WALL_OFFSET
from coordinator.log.records import Log
from coordinator.plan import plan_file, trajectory
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import Driven, drive, unpack
from protocol import codec, keys, phases
from protocol.messages import Command, Hello, Plan, Report

_UNKNOWN_RADIUS: Final = 0.15
"""The radius [m] used to draw a robot that never stated its own."""


@dataclass(frozen=True, eq=False)
class Leg:
    """One course that a robot drove, and how; the time zero of its epoch is `start` [s].

    `since`: the time of the plan at which the robot began it.  `ends`: the plan time at which it
    changed to its next course, infinite if it did not.
    """

    epoch: int
    driven: Driven
    start: float
    driving: Driving = field(default_factory=lambda: Driving(Progress()))
    since: float = 0.0
    ends: float = math.inf

    @property
    def begin(self) -> float:
        """The time [s] at which the robot began the course."""
        return self.start + self.since

    @property
    def end(self) -> float:
        """The time [s] at which the robot came to rest, or to its next course."""
        line, (progress, brake, rate) = self.driven.timeline, self.driving
        slowing = line.v_at(brake) / rate if brake < line.finish and rate > 0.0 else 0.0
        return self.start + progress.when(min(min(brake, line.finish) + slowing, self.ends))

    def sample(self, times: Array) -> Array:
        """Return x, y [m], heading [rad], s [m], v [m/s] at times of the story, (m, 5)."""
        line = self.driven.timeline
        progress, brake, rate = self.driving
        passed = np.minimum(progress.at(times - self.start), self.ends)
        by_plan = np.minimum(passed, brake)
        s = np.array([line.s_at(t) for t in by_plan.tolist()])
        v = np.array([line.v_at(t) for t in by_plan.tolist()])
        slowing = passed - by_plan
        if rate > 0.0:
            slowing = np.minimum(slowing, v / rate)
            s += slowing * (v - 0.5 * rate * slowing)
            v -= rate * slowing
        else:
            v[slowing > 0.0] = 0.0
        return trajectory.at_arcs(self.driven, s, v)


@dataclass(frozen=True, eq=False)
class Story:
    """The legs of all robots, in the order of their epochs, and the plans and summary of the log.

    `zero_ns`: the story's time zero in ns since 1970 (0 for a plan).  `first`, `last` [s]: when the
    story begins and ends.  `summary`: the summary of `info`, for a log.
    """

    name: str
    legs: list[Leg]
    documents: Mapping[int, PlanDocument]
    zero_ns: int
    first: float
    last: float
    summary: Summary | None = None

    def of_robots(self) -> dict[str, list[Leg]]:
        """Return every robot's legs."""
        found: dict[str, list[Leg]] = {}
        for leg in self.legs:
            found.setdefault(leg.driven.id, []).append(leg)
        return found


def story_of_plan(document: PlanDocument) -> Story:
    """Return the story of a plan as if it were driven from time 0 on."""
    legs = [Leg(document.epoch, one, 0.0) for one in drive(document)]
    last = max((leg.end for leg in legs), default=0.0)
    return Story(document.scenario, legs, {document.epoch: document}, 0, 0.0, last)


def story_of_log(log: Log) -> Story:
    """Return the story of a log, which consists of the epochs that got a GO."""
    lag_ns = clock_lag(log)
    heard = _Heard([*readable_logs_before(log), log], lag_ns)
    documents = documents_of(log)
    starts = [turn.start_ns for turn in heard.turns.values()]
    zero_ns = (min(starts) if starts else 0) + lag_ns
    legs = _legs(heard, _driven(heard, documents), zero_ns, lag_ns)
    ends = [record.log_ns for record in (log.records[:1] + log.records[-1:])] or [zero_ns]
    return Story(
        name=log.metadata.get("fleet", ""),
        legs=legs,
        documents=documents,
        zero_ns=zero_ns + int(log.metadata[WALL_OFFSET]),
        first=(ends[0] - zero_ns) / 1e9,
        last=(ends[-1] - zero_ns) / 1e9,
        summary=msgspec.convert(summarise(log, before=readable_logs_before(log)), Summary),
    )


def csv_lines(story: Story, step: float) -> Iterator[str]:
    """Yield CSV lines, header first: every leg from its start to its end; `step` in seconds."""
    yield trajectory.HEADER
    for leg in story.legs:
        times = [leg.begin + t for t in trajectory.until(step, max(leg.end - leg.begin, 0.0))]
        yield from trajectory.rows(leg.driven.id, times, leg.sample(np.array(times)))


def documents_of(log: Log) -> dict[int, PlanDocument]:
    """Return by epoch the plans in a log and in the logs that it resumes from."""
    found: dict[int, PlanDocument] = {}
    for part in (*readable_logs_before(log), log):
        for name, data in part.attachments.items():
            if plan_file.is_plan_name(name):
                try:
                    document = plan_file.from_json(data, name)
                except InputError:
                    continue
                found[document.epoch] = document
    return dict(sorted(found.items()))


@dataclass
class _Turn:
    """An epoch that got a GO: its plan's time zero, and when it ended [ns]."""

    start_ns: int
    frozen_ns: int | None = None


@dataclass
class _Heard:
    """What the messages of logs say about who drove when; each log resumes the one before.

    `lag_ns`: how far the logs' clock is ahead of the coordinator's.
    """

    logs: Sequence[Log]
    lag_ns: int
    turns: dict[int, _Turn] = field(default_factory=dict)
    radii: dict[str, float] = field(default_factory=dict)
    plans: dict[tuple[int, str], bytes] = field(default_factory=dict)
    courses: dict[tuple[int, str, int], bytes] = field(default_factory=dict)
    """Further courses of an epoch, by revision."""

    said: Said = field(default_factory=Said)

    def __post_init__(self) -> None:
        for log in self.logs:
            self._hear(log)

    def _hear(self, log: Log) -> None:
        for record in log.records:
            place = keys.split(record.key)
            if place is None or place[1] == "alive":
                continue
            message = codec.decode(place[1], record.payload)
            if isinstance(message, Command):
                if is_own(log, message):
                    self._hear_command(message, record.log_ns)
            elif isinstance(message, Hello) and message.radius_m > 0.0:
                self.radii[place[2]] = message.radius_m
            elif isinstance(message, Plan) and message.revision:
                self.courses[message.epoch, place[2], message.revision] = record.payload
            elif isinstance(message, Plan):
                self.plans[message.epoch, place[2]] = record.payload
            elif isinstance(message, Report):
                self.said.take(message, place[2], record.log_ns)

    def _hear_command(self, command: Command, log_ns: int) -> None:
        if command.phase == phases.GO:
            self.turns.setdefault(command.epoch, _Turn(command.start_ns))
            self.said.begin(command, self.lag_ns)
        elif command.phase == phases.FREEZE and command.epoch in self.turns:
            turn = self.turns[command.epoch]
            turn.frozen_ns = log_ns if turn.frozen_ns is None else turn.frozen_ns


def _driven(heard: _Heard, documents: Mapping[int, PlanDocument]) -> dict[int, dict[str, Driven]]:
    """Return by epoch what every robot drove, from attached plans, else from messages."""
    found: dict[int, dict[str, Driven]] = {}
    radii = heard.radii
    for epoch in heard.turns:
        if epoch in documents:
            found[epoch] = {one.id: one for one in drive(documents[epoch])}
            radii = radii | {name: one.radius for name, one in found[epoch].items()}
    for (epoch, robot), payload in heard.plans.items():
        if epoch in heard.turns and robot not in found.setdefault(epoch, {}):
            try:
                found[epoch][robot] = unpack(payload, radii.get(robot, _UNKNOWN_RADIUS))
            except (ValueError, OverflowError):
                continue
    return found


def _legs(
    heard: _Heard, driven: Mapping[int, Mapping[str, Driven]], zero_ns: int, lag_ns: int
) -> list[Leg]:
    """Return the legs of all robots.

    In a frozen epoch, a robot's leg ends where the robot reported that it rests.  Without such a
    report, it ends where the plan has the robot at the time at which it was last heard.
    """
    courses = {
        (epoch, robot, 0): one
        for epoch in heard.turns
        for robot, one in driven.get(epoch, {}).items()
    }
    for (epoch, robot, revision), payload in heard.courses.items():
        if epoch in heard.turns and heard.said.of(epoch, robot, revision).last_ns is not None:
            radius = heard.radii.get(robot, _UNKNOWN_RADIUS)
            courses[epoch, robot, revision] = unpack(payload, radius)
    legs: list[Leg] = []
    ends: dict[tuple[int, str], float] = {}
    for (epoch, robot, revision), one in sorted(courses.items(), key=itemgetter(0), reverse=True):
        turn, words = heard.turns[epoch], heard.said.of(epoch, robot, revision)
        start_ns = turn.start_ns + lag_ns
        driving = words.driving(
            one.timeline, one.plan.brake_mmps2 / 1000.0, start_ns, turn.frozen_ns
        )
        begin = 0.001 * one.plan.begin_ms
        since = words.since(one.timeline, begin) if begin > 0.0 else None
        since = begin if since is None else since
        until = ends.get((epoch, robot), math.inf)
        legs.append(Leg(epoch, one, (start_ns - zero_ns) / 1e9, driving, since, until))
        ends[epoch, robot] = begin
    return sorted(legs, key=lambda leg: leg.begin)
