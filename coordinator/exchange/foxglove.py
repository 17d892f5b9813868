"""Writes a story (the motions of a log or plan) as an MCAP file for Foxglove, Lichtblick and Rerun.

Decides: the topics, and at which time each thing appears.  Must not know: shapes
(foxglove_scene.py, point_clouds.py).

Topics: /tf (FrameTransforms), /floor, /robots, /paths, /zones (SceneUpdate), /log (Log); for Rerun
/points/floor, /points/paths and /points/robots/NAME (PointCloud).  All messages are Protobuf,
encoded by foxglove-sdk.  The file is written like the project's logs, with all checksums.
"""

from __future__ import annotations

import heapq
import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from foxglove import Schema
from foxglove.messages import (
    FrameTransform,
    FrameTransforms,
    Log,
    LogLevel,
    PointCloud,
    Quaternion,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
    Timestamp,
    Vector3,
)
from mcap.writer import Writer

from coordinator.base.errors import InputError
from coordinator.curves.nurbs import Array
from coordinator.exchange.foxglove_scene import (
    FRAME,
    Colour,
    colour_of,
    floor_entities,
    frame_of,
    path_entity,
    robot_entity,
    zone_entity,
)
from coordinator.exchange.motion_story import Leg, Story
from coordinator.exchange.point_clouds import floor_cloud, paths_cloud, robot_cloud
from coordinator.log.log_writer import begin_file
from coordinator.plan.document import PlanDocument, Reason

_SECOND: Final = 1_000_000_000
_LAST_NS: Final = 2**32 * _SECOND - 1
"""The latest time that a Timestamp can hold, in 2106."""

_MOST_FRAMES: Final = 1_000_000

_LEVELS: Final = {"freeze": LogLevel.Warning, "refusal": LogLevel.Warning}

Message = SceneUpdate | PointCloud | FrameTransforms | Log
Progress = Callable[[Sequence[float], str], Iterable[float]]


class Told(NamedTuple):
    """A message on a topic at a time of the story [s]."""

    t: float
    topic: str
    message: Message


def write_scene(story: Story, step: float, progress: Progress = lambda times, _: times) -> bytes:
    """Return the file's bytes, which are the same for the same story.

    `step` is the time [s] between two frames, each with the places of all robots.  `progress` is
    called with the times of all frames and yields them.
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
            self._channels[told.topic] = self._register(told.topic, told.message.get_schema())
        at = _time_ns(self._zero_ns, told.t)
        self._writer.add_message(self._channels[told.topic], at, told.message.encode(), at)

    def _register(self, topic: str, schema: Schema) -> int:
        if schema.name not in self._schemas:
            self._schemas[schema.name] = self._writer.register_schema(
                schema.name, schema.encoding, schema.data
            )
        return self._writer.register_channel(topic, "protobuf", self._schemas[schema.name])


def _time_ns(zero_ns: int, t: float) -> int:
    return min(max(zero_ns + round(t * _SECOND), 0), _LAST_NS)


def _stamp(story: Story, t: float) -> Timestamp:
    """Return a time of the story as time since 1970, which log times count from, too."""
    return Timestamp(*divmod(_time_ns(story.zero_ns, t), _SECOND))


def _scenes(story: Story) -> list[Told]:
    """Return all messages except those that show motion, sorted by time."""
    colours = {name: colour_of(i) for i, name in enumerate(sorted(story.of_robots()))}
    told = [*_static(story, colours), *_paths(story, colours), *_zones(story), *_lines(story)]
    return sorted(told, key=lambda one: one.t)


def _static(story: Story, colours: dict[str, Colour]) -> Iterator[Told]:
    t, now = story.first, _stamp(story, story.first)
    document = next(iter(story.documents.values()), None)
    if document is not None and document.workspace is not None:
        floor = document.workspace
        yield Told(t, "/floor", SceneUpdate(entities=floor_entities(floor, now)))
        yield Told(t, "/points/floor", floor_cloud(floor, now))
    firsts = {name: legs[0] for name, legs in story.of_robots().items()}
    robots = [robot_entity(leg, colours[name], now) for name, leg in firsts.items()]
    yield Told(t, "/robots", SceneUpdate(entities=robots))
    for name, leg in firsts.items():
        yield Told(t, f"/points/robots/{name}", robot_cloud(leg, colours[name], now))


def _paths(story: Story, colours: dict[str, Colour]) -> Iterator[Told]:
    """Yield the paths of each epoch, stamped with the time at which it begins.

    Those of the first epoch are stamped with the story's beginning.  A new epoch deletes the paths
    of the one before.
    """
    shown: set[str] = set()
    epochs: dict[int, list[Leg]] = {}
    for leg in story.legs:
        epochs.setdefault(leg.epoch, []).append(leg)
    for number, legs in enumerate(epochs.values()):
        t = legs[0].begin if number else story.first
        now = _stamp(story, t)
        names = {f"path/{leg.driven.id}" for leg in legs}
        gone = [_deletion(name, now) for name in sorted(shown - names)]
        inks = [colours[leg.driven.id] for leg in legs]
        entities = [path_entity(leg, ink, now) for leg, ink in zip(legs, inks, strict=True)]
        yield Told(t, "/paths", SceneUpdate(deletions=gone, entities=entities))
        yield Told(t, "/points/paths", paths_cloud(legs, inks, now))
        shown = names


def _deletion(name: str, now: Timestamp) -> SceneEntityDeletion:
    return SceneEntityDeletion(timestamp=now, type=SceneEntityDeletionType.MatchingId, id=name)


def _zones(story: Story) -> Iterator[Told]:
    """Yield the zones that robots wait to enter, highlighted during the waits."""
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
                    now = _stamp(story, t)
                    name = f"zone/{epoch}/{number}"
                    entity = zone_entity(name, reason, mine, theirs, lit, now)
                    yield Told(t, "/zones", SceneUpdate(entities=[entity]))


def _departure(document: PlanDocument, reason: Reason) -> float:
    """Return the plan time [s] at which the wait that a reason explains ends."""
    robot = document.robot(reason.robot)
    departs = {stop.s: stop.depart for stop in robot.stops} | {0.0: robot.start_time}
    return departs[min(departs, key=lambda s: abs(s - reason.s))]


def _lines(story: Story) -> Iterator[Told]:
    """Yield phases, arrivals and faults as lines of text."""
    if story.summary is None:
        return
    begin = story.first + (story.summary.zero or 0.0)
    for epoch in story.summary.epochs:
        for change in epoch.phases:
            text = f"epoch {epoch.epoch}: {change.phase}"
            yield _line(story, begin + change.t, LogLevel.Info, text, "")
        for robot, t in epoch.arrivals.items():
            yield _line(story, begin + t, LogLevel.Info, f"{robot} has arrived", robot)
    for fault in story.summary.faults:
        level = _LEVELS.get(fault.kind, LogLevel.Error)
        text = f"{fault.robot}: {fault.fault}" if fault.robot else fault.fault
        yield _line(story, begin + fault.t, level, text, fault.robot)


def _line(story: Story, t: float, level: LogLevel, text: str, robot: str) -> Told:
    now = _stamp(story, t)
    line = Log(timestamp=now, level=level, message=text, name=robot or "coordinator")
    return Told(t, "/log", line)


def _frames(story: Story, step: float, progress: Progress) -> Iterator[Told]:
    """Yield the places of all robots every `step` seconds."""
    count = max(math.ceil((story.last - story.first) / step), 0)
    if count > _MOST_FRAMES:
        raise InputError([f"--step: {step:g} s makes {count:,} frames; at most {_MOST_FRAMES:,}"])
    times = np.append(story.first + step * np.arange(count), story.last)
    poses = {name: poses_of(legs, times) for name, legs in story.of_robots().items()}
    for number, t in enumerate(progress(times.tolist(), "placing robots")):
        now = _stamp(story, t)
        transforms = [_transform(now, name, pose[number]) for name, pose in poses.items()]
        yield Told(t, "/tf", FrameTransforms(transforms=transforms))


def poses_of(legs: Sequence[Leg], times: Array) -> Array:
    """Return a robot's x, y [m] and heading [rad] at times, (n, 3).

    Between its legs the robot is at rest.
    """
    begins = np.array([leg.begin for leg in legs])
    which = np.maximum(np.searchsorted(begins, times, side="right") - 1, 0)
    poses = np.empty((len(times), 3))
    for number, leg in enumerate(legs):
        mine = which == number
        poses[mine] = leg.sample(times[mine])[:, :3]
    return poses


def _transform(now: Timestamp, name: str, pose: Array) -> FrameTransform:
    x, y, heading = pose.tolist()
    return FrameTransform(
        timestamp=now,
        parent_frame_id=FRAME,
        child_frame_id=frame_of(name),
        translation=Vector3(x=x, y=y, z=0.0),
        rotation=Quaternion(x=0.0, y=0.0, z=math.sin(0.5 * heading), w=math.cos(0.5 * heading)),
    )
