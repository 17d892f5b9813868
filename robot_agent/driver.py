"""The interface between the agent and the base that it moves.

Decides: the obligations of a driver.  `agent --driver FILE.py:CLASS` (or MODULE:CLASS) creates one,
with the greatest acceleration [m/s^2] that the robot may use as the only argument.  A simulated
body (sim/world/body.py) and a real base both implement it; nothing else of the robot changes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

Pose = tuple[float, float, float]
"""x [m], y [m], heading [rad, counter-clockwise from +x], on the scenario's floor."""


class DriverError(Exception):
    """Raised when the base cannot do what it should; the text says why."""


class Driver(ABC):
    """A base that travels along arcs.

    Obligations of every implementation:
    - It never travels farther than the distance commanded last, even if the control loop stops.
    - It stops by itself when neither `drive` nor `turn` has been called for WATCHDOG_NS, so that
      the robot does not drive on when its program hangs.
    - It never reverses.
    - No method blocks for longer than a millisecond.
    """

    WATCHDOG_NS = 50_000_000

    @abstractmethod
    def step(self, now_ns: int) -> None:
        """Let time pass until now_ns on the robot's clock; called once before each `pose`."""

    @abstractmethod
    def pose(self) -> Pose | None:
        """Return the robot's own estimate of its pose; None when it has none yet."""

    @abstractmethod
    def place(self, x: float, y: float, heading: float) -> None:
        """Set the estimated pose: a person has put the robot there; a simulated robot is moved."""

    @abstractmethod
    def drive(self, speed_mps: float, curvature_radpm: float, distance_m: float) -> None:
        """Travel along an arc at this speed for at most this distance, then hold.

        Speed and distance are not negative; a positive curvature turns left.  Replaces the previous
        command; speed 0 brakes and holds.
        """

    @abstractmethod
    def turn(self, angle_rad: float) -> None:
        """Turn on the spot by this angle (left is positive) and hold; replaces the last command.

        Called every tick until the heading is right.  A base that cannot turn on the spot holds.
        """

    @abstractmethod
    def stop(self) -> None:
        """Brake as hard as the base can and hold; works in every state."""

    def close(self) -> None:  # noqa: B027
        """Release what the driver holds, such as a link; called once, when the agent ends."""

    def true_pose(self) -> Pose | None:
        """Return where the robot truly is, for the black box; differs in simulation only."""
        return self.pose()
