"""Finds the robots that have no part in the last epoch, for the picture of its plan.

Decides: where such a robot stands.  Must not know: axes, files.
"""

from __future__ import annotations

import numpy as np

from coordinator.view.figure_selection import Left
from coordinator.view.scene import Scene


def left_behind(scene: Scene) -> tuple[Left, ...]:
    """Return the robots aside in the scene's last epoch, each at the end of its last ride."""
    aside = scene.epochs[-1].aside if scene.epochs else []
    found = []
    for one in aside:
        rides = [ride for epoch in scene.epochs for ride in epoch.rides if ride.robot == one.robot]
        if rides:
            s, x, y = (np.array(column) for column in rides[-1].path)
            rest = s[-1] if rides[-1].halt is None else rides[-1].halt[3]
            place = float(np.interp(rest, s, x)), float(np.interp(rest, s, y))
            body = scene.robots[one.robot]
            found.append(Left(body.id, one.why, place, body.radius))
    return tuple(found)
