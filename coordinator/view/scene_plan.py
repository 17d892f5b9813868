"""Makes the scene of a plan: the motions decoded from the wire bytes, as polylines and legs.

Decides: how exact the motions are (1 mm), and which zones are shown.  Must not know: logs
(scene_log.py), HTML (page.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

import numpy as np
from msgspec.structs import replace

from coordinator.curves.nurbs import Array, Nurbs
from coordinator.findings.giving_way import giving_way
from coordinator.plan.document import Crossing, PlanDocument, Reason, RobotPlan
from coordinator.plan.wire import Driven, curve_of, drive
from coordinator.scenario.model import Point
from coordinator.view.scene import Body, Epoch, Leg, Ride, Scene, Wait, Yielding, Zone
from protocol.timeline import Timeline

ACCURACY: Final = 4e-4
"""Greatest distance [m] of a polyline, before rounding, from the curve at the same arc length."""

_DIGITS: Final = 4
_FINE_DIGITS: Final = 5
_SHORTEST: Final = 1e-3
"""Pieces of a path shorter than this [m] are not halved."""

_AFTERWARDS: Final = 1.0
"""The page plays for this long [s] after the last arrival."""


def scene_of_plan(document: PlanDocument) -> Scene:
    """Return the scene of a plan; raise InputError if a robot would refuse its message."""
    index = index_of([document])
    epoch = Epoch(
        epoch=document.epoch,
        begin=0.0,
        start=0.0,
        rides=rides_of(document, index),
        zones=zones_of(document, index),
    )
    last = max((robot.finish_time for robot in document.robots), default=0.0)
    return scene_from([document], [epoch], "plan", last + _AFTERWARDS)


def index_of(documents: Sequence[PlanDocument], others: Iterable[str] = ()) -> dict[str, int]:
    """Return the index of each robot of the documents, in order of appearance, then of others."""
    names = dict.fromkeys(robot.id for document in documents for robot in document.robots)
    names |= dict.fromkeys(others)
    return {name: place for place, name in enumerate(names)}


def scene_from(
    documents: Sequence[PlanDocument],
    epochs: list[Epoch],
    source: str,
    end: float,
    others: Mapping[str, float] = MappingProxyType({}),
) -> Scene:
    """Return a scene without marks and ghosts.

    The first document gives the floor and the terms of the plan, the last one whether the newest
    plan is proven.

    others: robots that no document names, with their radii [m].
    """
    first = documents[0]
    floor = first.workspace
    radius = {robot.id: robot.radius for document in documents for robot in document.robots}
    radius = {**others, **radius}
    proof = documents[-1].proof
    return Scene(
        name=first.scenario,
        policy=first.policy,
        tau=round(first.tau, _DIGITS),
        margin=round(first.margin, _DIGITS),
        proven=None if proof is None else proof.holds,
        source=source,
        end=round(end, _DIGITS),
        boundary=[] if floor is None else floor.boundary,
        obstacles=[] if floor is None else floor.obstacles,
        robots=[Body(id=name, radius=radius[name]) for name in index_of(documents, others)],
        epochs=epochs,
    )


def rides_of(
    document: PlanDocument,
    index: Mapping[str, int],
    driven: Sequence[Driven] | None = None,
) -> list[Ride]:
    """Return the motions of a document, from the bytes that the robots get.

    `driven`: what `drive` returned for the document, if the caller has it already.
    """
    driven = driven or drive(document)
    yields: dict[str, list[Yielding]] = {}
    for one in giving_way(document, driven):
        yields.setdefault(one.robot, []).append(
            Yielding(
                how=one.how,
                other=index[one.other],
                since=round(one.since, _DIGITS),
                until=round(one.until, _DIGITS),
                lost=round(one.lost, 2),
            )
        )
    return [
        replace(
            ride_of(one, index[robot.id], _waits(robot, index)),
            yields=yields.get(robot.id, []),
            shortest=None
            if robot.shortest is None
            else _columns(polyline(curve_of(robot.shortest))),
        )
        for robot, one in zip(document.robots, driven, strict=True)
    ]


def ride_of(one: Driven, robot: int, waits: list[Wait]) -> Ride:
    """Return the motion that follows from a robot's Plan message."""
    return Ride(
        robot=robot,
        path=_columns(polyline(one.curve)),
        legs=_legs(one.timeline),
        waits=waits,
        brake=one.plan.brake_mmps2 / 1000.0,
        revision=one.plan.revision,
    )


def polyline(curve: Nurbs) -> Array:
    """Return arc lengths, x and y (n, 3) [m] of a polyline that approximates the curve.

    At every arc length, the polyline is within ACCURACY of the curve.
    """
    s = np.unique(np.clip(curve.arc_at(np.unique(curve.knots)), 0.0, curve.length))
    parts = np.arange(1, 8) / 8.0
    while True:
        ends, sizes = curve.at_arc(s), np.diff(s)
        inner = s[:-1, None] + sizes[:, None] * parts
        line = ends[:-1, None] + np.diff(ends, axis=0)[:, None] * parts[:, None]
        off = curve.at_arc(inner.ravel()).reshape(line.shape) - line
        coarse = np.hypot(off[..., 0], off[..., 1]).max(axis=1) > ACCURACY
        coarse &= sizes > _SHORTEST
        if not coarse.any():
            return np.column_stack((s, ends))
        s = np.sort(np.concatenate((s, inner[coarse, 3])))


def zones_of(document: PlanDocument, index: Mapping[str, int]) -> list[Zone]:
    """Return the zones that force a wait, and zones around crossings at which no robot waits.

    A crossing's zone is taken to extend along both paths by the distance that the two robots must
    keep.  Where paths cross at a small angle, the true zone is longer.  The zone is an
    illustration; the proof is proof/tau_safety.py.
    """
    zones = [_forced(reason, index) for reason in document.waits]
    radius = {robot.id: robot.radius for robot in document.robots}
    length = {robot.id: robot.length for robot in document.robots}
    for crossing in document.crossings:
        if not any(_covers(zone, crossing, index) for zone in zones[: len(document.waits)]):
            need = radius[crossing.a] + radius[crossing.b] + document.margin
            zones.append(
                Zone(
                    a=index[crossing.a],
                    b=index[crossing.b],
                    on_a=_around(crossing.s_a, need, length[crossing.a]),
                    on_b=_around(crossing.s_b, need, length[crossing.b]),
                    forces=False,
                )
            )
    return zones


def rounded_points(points: Sequence[Point]) -> list[Point]:
    """Return a polygon with coordinates rounded to the page's number of digits."""
    return [(round(x, _DIGITS), round(y, _DIGITS)) for x, y in points]


def _forced(reason: Reason, index: Mapping[str, int]) -> Zone:
    return Zone(
        a=index[reason.robot],
        b=index[reason.yields_to],
        on_a=(round(reason.zone[0], _DIGITS), round(reason.zone[1], _DIGITS)),
        on_b=(round(reason.their_zone[0], _DIGITS), round(reason.their_zone[1], _DIGITS)),
        forces=True,
    )


def _covers(zone: Zone, crossing: Crossing, index: Mapping[str, int]) -> bool:
    """Return whether a crossing lies in a zone."""
    a, b, s_a, s_b = index[crossing.a], index[crossing.b], crossing.s_a, crossing.s_b
    if (zone.a, zone.b) == (b, a):
        s_a, s_b = s_b, s_a
    elif (zone.a, zone.b) != (a, b):
        return False
    return zone.on_a[0] <= s_a <= zone.on_a[1] and zone.on_b[0] <= s_b <= zone.on_b[1]


def _around(s: float, need: float, length: float) -> tuple[float, float]:
    return round(max(s - need, 0.0), _DIGITS), round(min(s + need, length), _DIGITS)


def _columns(points: Array) -> tuple[list[float], list[float], list[float]]:
    s, x, y = np.round(points, _DIGITS).T.tolist()
    return s, x, y


def _legs(line: Timeline) -> list[Leg]:
    columns = (line.t0, line.t1, line.s0, line.s1, line.v0, line.v1)
    rows = np.round(np.array(columns), _FINE_DIGITS).T.tolist()
    return [(a, b, c, d, e, f) for a, b, c, d, e, f in rows]


def _waits(robot: RobotPlan, index: Mapping[str, int]) -> list[Wait]:
    """Return a robot's waits, the late start included."""
    found = [(stop.s, stop.arrive, stop.depart, stop.yields_to) for stop in robot.stops]
    if robot.start_time > 0.0:
        found.insert(0, (0.0, 0.0, robot.start_time, robot.start_yields_to))
    return [
        Wait(
            s=round(s, _DIGITS),
            since=round(since, _DIGITS),
            until=round(until, _DIGITS),
            lets=index.get(owner, -1),
        )
        for s, since, until, owner in found
    ]
