"""Whether the floor of a new epoch is closed wherever a robot may stand that has no part in it.

A robot with a part says that it is armed where its course begins before anybody drives.  One
without a part says nothing: the messages of the epochs before tell where it may stand.

Decides: which robots are looked at.  Must not know: files, the fleet core.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import shapely

from coordinator.findings.granted_courses import GrantedCourses
from protocol.messages import Command

_NEAR: Final = 0.015
"""A course may end so far [m] from the goal for which its robot stands on the new floor."""


class _Place(NamedTuple):
    where: shapely.Geometry
    radius: float


class LeftBehind:
    """The robots without a part in the newest epoch, from what has been sent and said so far.

    `said`: by robot, where its newest program has said that it stands [m].
    """

    def __init__(self, said: Mapping[str, tuple[float, float]]) -> None:
        self._said = said
        self._newest: GrantedCourses | None = None
        self._places: dict[str, _Place] = {}
        """By robot: where it may stand by the epochs before the newest one."""

    def watch(self, _command: Command, epoch: GrantedCourses, _now_ns: int) -> None:
        """Take in that a Command was sent in an epoch; a new one is looked at."""
        before, self._newest = self._newest, epoch
        if before is None or before is epoch:
            return
        for robot in before.taken_out:
            self._places.pop(robot, None)
        for robot, (where, radius) in before.may_stand().items():
            self._places[robot] = _Place(where, radius)
        document = epoch.document
        if document.workspace is None:
            return
        solid = shapely.union_all([shapely.Polygon(one) for one in document.workspace.obstacles])
        shapely.prepare(solid)
        for robot in self._places.keys() - {one.id for one in document.robots}:
            place, said = self._places[robot], self._said.get(robot)
            may_be = [place.where, *([] if said is None else [shapely.Point(said)])]
            if not any(solid.covers(one.buffer(place.radius - _NEAR)) for one in may_be):
                x, y = place.where.centroid.coords[0]
                epoch.failures.append(
                    f"epoch {document.epoch}: {robot} may stand near ({x:.2f}, {y:.2f}), "
                    "where the floor of the plan is not closed"
                )
