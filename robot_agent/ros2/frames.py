"""Poses in the plane, and the tree of frames that tf tells.

Decides: how poses are put one after the other.  Must not know: messages.
"""

from __future__ import annotations

from math import atan2, cos, pi, remainder, sin

from robot_agent.driver import Pose


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Return the heading [rad] of a quaternion."""
    return atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def compose(first: Pose, second: Pose) -> Pose:
    """Return the pose, in the frame of `first`, that `second` is in the frame at `first`."""
    x, y, heading = first
    right, ahead = sin(heading), cos(heading)
    return (
        x + ahead * second[0] - right * second[1],
        y + right * second[0] + ahead * second[1],
        remainder(heading + second[2], 2.0 * pi),
    )


def inverse(pose: Pose) -> Pose:
    """Return the pose of the outer frame in the frame at `pose`."""
    x, y, heading = pose
    right, ahead = sin(heading), cos(heading)
    return -ahead * x - right * y, right * x - ahead * y, -heading


def moved(pose: Pose, speed: float, turn_rate: float, seconds: float) -> Pose:
    """Return where an arc at a speed [m/s] and a rate of turn [rad/s] leads in that time."""
    angle = turn_rate * seconds
    way, middle = speed * seconds, 0.5 * angle
    if angle:
        way *= sin(middle) / middle
    return compose(pose, (way * cos(middle), way * sin(middle), angle))


class Frames:
    """What tf has told: each frame's pose in its parent, and when that was heard [ns]."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Pose, int]] = {}

    def hear(self, parent: str, child: str, pose: Pose, heard_ns: int) -> None:
        """Take in a transform."""
        self._parents[child.strip("/")] = (parent.strip("/"), pose, heard_ns)

    def pose(self, outer: str, inner: str) -> tuple[Pose, int] | None:
        """Return the pose of a frame in another one, and when its last step was heard [ns].

        None while the tree does not lead from one to the other.  The transform nearest to the
        inner frame is the odometry, which has to be recent; those above it change rarely.
        """
        pose, newest = (0.0, 0.0, 0.0), None
        for _ in range(len(self._parents) + 1):
            if inner == outer:
                return None if newest is None else (pose, newest)
            if inner not in self._parents:
                return None
            inner, step, heard_ns = self._parents[inner]
            pose = compose(step, pose)
            newest = heard_ns if newest is None else max(newest, heard_ns)
        return None
