"""Check the places that robots state when they come back.

A robot cannot stand inside another robot, inside a solid thing, or outside the floor.

Decides: which robots' stated places are not believed.  Must not know: what the fleet does with
those robots.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import shapely

from coordinator.fleet.rest_places import Standing
from coordinator.mission.replanning_input import Site
from coordinator.scenario.floor import Floor
from coordinator.scenario.model import Pose


def doubtful(site: Site, told: Iterable[Standing]) -> dict[str, str]:
    """Return the robots that cannot stand where they say, each with the reason.

    A stated place may be wrong by the margin.  No comparison is made with robots whose place is not
    known.
    """
    said = {one.robot: one.place for one in told if one.place is not None}
    if not said:
        return {}
    stand = {robot.id: (robot.start[:2], robot.radius) for robot in site.scenario.robots}
    for one in site.aside:
        if len(one.places) == 1:
            x, y = one.places[0].tolist()
            stand[one.robot.id] = ((x, y), one.robot.radius)
    floor = Floor(site.scenario.workspace.boundary, site.scenario.workspace.obstacles)
    found = {}
    for name, place in said.items():
        radius = stand[name][1] - site.scenario.margin
        there = [
            other
            for other, (centre, needs) in stand.items()
            if other != name and math.dist(place[:2], centre) < radius + needs
        ]
        if there or _gap(floor, place) < radius:
            x, y, _ = place
            outside = not floor.outline.covers(shapely.Point(x, y))
            what = (
                f"{there[0]} stands"
                if there
                else "there is no floor"
                if outside
                else "there is something solid"
            )
            found[name] = f"it says that it stands at ({x:.2f}, {y:.2f}), where {what}"
    return found


def _gap(floor: Floor, place: Pose) -> float:
    return floor.gap(np.array([place[:2], place[:2]]))
