"""A simulated base in the robot's own process, with faults that a script orders.

Decides: how faults reach the body.  Must not know: when a fault is due (the writer of the script
decides that by adding a line), plans, other robots.

The script is a text file with one fault per line, `KIND NUMBER`.  It is read every LOOK_PERIOD, and
a fault begins when its line is first read.  The path of the script is in the environment variable
named by SCRIPT, because a driver on the command line has no arguments.
"""

from __future__ import annotations

import functools
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from protocol.timing import MILLISECOND, SECOND
from robot_agent.driver import DriverError
from sim.world.failing_body import FailingBody

SCRIPT: Final = "SPLINEFLEET_BODY_SCRIPT"

LOOK_PERIOD: Final = 20 * MILLISECOND


class FaultyBody(FailingBody):
    """A FailingBody that takes its faults from a script.

    `slow SHARE`: from now on the wheels roll SHARE of the commanded distance.  `stall SECONDS`: the
    base stands still for that long (inf: for ever).  `skid METRES`: it slides to its left.
    `clock-step SECONDS`: see `step_wall_clock`.
    Raises ValueError when neither the argument nor the environment names a script.
    """

    def __init__(self, max_accel: float = math.inf, script: Path | None = None) -> None:
        super().__init__(max_accel)
        named = script or os.environ.get(SCRIPT)
        if not named:
            raise ValueError(f"the environment variable {SCRIPT} does not name a script")
        self._script = Path(named)
        self._size = self._taken = 0
        self._look_ns = -(1 << 62)
        self._stalled_until = -math.inf

    def step(self, now_ns: int) -> None:
        """Read new faults from the script, then let time pass; DriverError for an unknown fault."""
        if now_ns >= self._look_ns:
            self._look_ns = now_ns + LOOK_PERIOD
            self._look(now_ns)
        self.stall(now_ns < self._stalled_until)
        super().step(now_ns)

    def _look(self, now_ns: int) -> None:
        """Apply the lines that have been added to the script since it was last read."""
        try:
            if os.stat(self._script).st_size == self._size:
                return
            content = self._script.read_text()
        except OSError:
            return
        self._size = len(content)
        whole_lines = content.split("\n")[:-1]
        new, self._taken = whole_lines[self._taken :], len(whole_lines)
        for line in new:
            kind, _, number = line.partition(" ")
            self._take(kind, float(number), now_ns)

    def _take(self, kind: str, number: float, now_ns: int) -> None:
        if kind == "slow":
            self.slow(number)
        elif kind == "stall":
            self._stalled_until = now_ns + number * SECOND
        elif kind == "skid":
            self.skid(number)
        elif kind == "clock-step":
            step_wall_clock(number)
        else:
            raise DriverError(f"{self._script}: {kind!r} is not a fault of a body")


def step_wall_clock(seconds: float) -> None:
    """Make `time.time` and `time.time_ns` of this process jump, as if the host's clock were set.

    The monotonic clock is not affected, nor is the wall clock that compiled libraries read.
    """
    for name, step in (("time", seconds), ("time_ns", round(seconds * SECOND))):
        setattr(time, name, functools.partial(_stepped, getattr(time, name), step))


def _stepped(clock: Callable[[], float], step: float) -> float:
    return clock() + step
