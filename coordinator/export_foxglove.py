"""A story as an MCAP file that Foxglove and Lichtblick open directly.

Decides: topics, and when what appears.  Must not know: shapes (export_scene.py).

Topics: /tf (FrameTransforms), /floor, /robots, /paths, /zones (SceneUpdate), /log (Log).
"""

from __future__ import annotations

import heapq
import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import msgspec
import numpy as np
from mcap.writer import Writer

from coordinator.export import Leg, Story
from coordinator.export_scene import (
    FRAME,
    colour_of,
    floor_entities,
    frame_of,
    path_entity,
    robot_entity,
    zone_entity,
)
from coordinator.export_schema import (
    ERROR,
    INFO,
    MATCHING_ID,
    WARNING,
    Color,
    FrameTransform,
    FrameTransforms,
    Log,
    Quaternion,
    SceneEntityDeletion,
    SceneUpdate,
    Time,
    Vector3,
    WellKnown,
    json_schema,
    schema_name,
)
from coordinator.nurbs import Array
from coordinator.plan import PlanDocument, Reason
from coordinator.recorder import begin_file

_SECOND: Final = 1_000_000_000
_LEVELS: Final = {"freeze": WARNING, "refusal": WARNING}

Progress = Callable[[Sequence[float], str], Iterable[float]]


class Told(NamedTuple):
    """A message on a topic at a time of the story [s]."""

    t: float
    topic: str
    message: WellKnown


def write_scene(story: Story, step: float, progress: Progress = lambda times, _: times) -> bytes:
    """Return the file's bytes; robots are placed every `step` seconds.

    `progress` is given the times of all frames and yields them.
    """
    stream = io.BytesIO()
    writer = begin_file(stream)
    file = _File(writer, story.zero_ns)
    for told in heapq.merge(_scenes(story), _frames(story, step, progress), key=lambda one: one.t):
        file.add(told)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


class _File:
    def __init__(self, writer: Writer, zero_ns: int) -> None:
        self._writer = writer
        self._zero_ns = zero_ns
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    def add(self, told: Told) -> None:
        if told.topic not in self._channels:
            self._channels[told.topic] = self._register(told.topic, type(told.message))
        at = _time_ns(self._zero_ns, told.t)
        data = msgspec.json.encode(told.message)
        self._writer.add_message(self._channels[told.topic], at, data, at)

    def _register(self, topic: str, kind: type[WellKnown]) -> int:
        name = schema_name(kind)
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(
                name, "jsonschema", json_schema(kind)
            )
        return self._writer.register_channel(topic, "json", self._schemas[name])


def _time_ns(zero_ns: int, t: float) -> int:
    return max(zero_ns + round(t * _SECOND), 0)


def _scenes(story: Story) -> list[Told]:
    """Return all that is not motion, sorted by time."""
    colours = {name: colour_of(i) for i, name in enumerate(sorted(story.of_robots()))}
    told = [*_static(story, colours), *_paths(story, colours), *_zones(story), *_lines(story)]
    return sorted(told, key=lambda one: one.t)


def _static(story: Story, colours: dict[str, Color]) -> Iterator[Told]:
    now = Time.of(_time_ns(story.zero_ns, story.first))
    document = next(iter(story.documents.values()), None)
    if document is not None and document.workspace is not None:
        entities = floor_entities(document.workspace, now)
        yield Told(story.first, "/floor", SceneUpdate(entities=entities))
    robots = [robot_entity(legs[0], colours[name], now) for name, legs in story.of_robots().items()]
    yield Told(story.first, "/robots", SceneUpdate(entities=robots))


def _paths(story: Story, colours: dict[str, Color]) -> Iterator[Told]:
    """Yield every epoch's paths when it begins, the first one's at once; older ones go."""
    shown: set[str] = set()
    epochs: dict[int, list[Leg]] = {}
    for leg in story.legs:
        epochs.setdefault(leg.epoch, []).append(leg)
    for number, legs in enumerate(epochs.values()):
        t = legs[0].start if number else story.first
        now = Time.of(_time_ns(story.zero_ns, t))
        names = {f"path/{leg.driven.id}" for leg in legs}
        gone = [SceneEntityDeletion(now, MATCHING_ID, name) for name in sorted(shown - names)]
        entities = [path_entity(leg, colours[leg.driven.id], now) for leg in legs]
        yield Told(t, "/paths", SceneUpdate(deletions=gone, entities=entities))
        shown = names


def _zones(story: Story) -> Iterator[Told]:
    """Yield the zones that robots wait for, lit while they do."""
    for epoch, document in story.documents.items():
        legs = {leg.driven.id: leg for leg in story.legs if leg.epoch == epoch}
        for number, reason in enumerate(document.waits):
            mine, theirs = legs.get(reason.robot), legs.get(reason.yields_to)
            if mine is None or theirs is None:
                continue
            depart = mine.start + _departure(document, reason)
            end = min(depart, mine.end)
            for t, lit in ((mine.start, False), (depart - reason.wait, True), (end, False)):
                if t <= end:
                    now = Time.of(_time_ns(story.zero_ns, t))
                    name = f"zone/{epoch}/{number}"
                    entity = zone_entity(name, reason, mine, theirs, lit, now)
                    yield Told(t, "/zones", SceneUpdate(entities=[entity]))


def _departure(document: PlanDocument, reason: Reason) -> float:
    """Return when the wait of a reason ends by the plan [s]."""
    robot = document.robot(reason.robot)
    departs = {stop.s: stop.depart for stop in robot.stops} | {0.0: robot.start_time}
    return departs[min(departs, key=lambda s: abs(s - reason.s))]


def _lines(story: Story) -> Iterator[Told]:
    """Yield what happened as lines of text."""
    if story.summary is None:
        return
    begin = story.first + (story.summary.zero or 0.0)
    for epoch in story.summary.epochs:
        for change in epoch.phases:
            yield _line(story, begin + change.t, INFO, f"epoch {epoch.epoch}: {change.phase}", "")
        for robot, t in epoch.arrivals.items():
            yield _line(story, begin + t, INFO, f"{robot} has arrived", robot)
    for fault in story.summary.faults:
        yield _line(
            story, begin + fault.t, _LEVELS.get(fault.kind, ERROR), fault.fault, fault.robot
        )


def _line(story: Story, t: float, level: int, text: str, robot: str) -> Told:
    now = Time.of(_time_ns(story.zero_ns, t))
    return Told(t, "/log", Log(now, level, text, robot or "coordinator"))


def _frames(story: Story, step: float, progress: Progress) -> Iterator[Told]:
    """Yield where every robot is, every `step` seconds."""
    count = max(math.ceil((story.last - story.first) / step), 0)
    times = np.append(story.first + step * np.arange(count), story.last)
    poses = {name: _poses(legs, times) for name, legs in story.of_robots().items()}
    for number, t in enumerate(progress(times.tolist(), "placing robots")):
        now = Time.of(_time_ns(story.zero_ns, t))
        transforms = [_transform(now, name, pose[number]) for name, pose in poses.items()]
        yield Told(t, "/tf", FrameTransforms(transforms))


def _poses(legs: Sequence[Leg], times: Array) -> Array:
    """Return a robot's x, y [m] and heading [rad] at times, (n, 3): at rest between its legs."""
    begins = np.array([leg.start for leg in legs])
    which = np.maximum(np.searchsorted(begins, times, side="right") - 1, 0)
    poses = np.empty((len(times), 3))
    for number, leg in enumerate(legs):
        mine = which == number
        poses[mine] = leg.sample(times[mine])[:, :3]
    return poses


def _transform(now: Time, name: str, pose: Array) -> FrameTransform:
    x, y, heading = pose.tolist()
    turned = Quaternion(z=math.sin(0.5 * heading), w=math.cos(0.5 * heading))
    return FrameTransform(now, FRAME, frame_of(name), Vector3(x, y), turned)
