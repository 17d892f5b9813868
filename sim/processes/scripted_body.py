"""A base that fails by a script, inside the robot's own process.

Decides: how strikes reach the body.  Must not know: when a fault is due (whoever writes the script
strikes by adding a line), plans, other robots.

The script is a text file with one strike per line, `KIND NUMBER`; it is looked at every LOOK_PERIOD
and a strike begins when its line is seen.  Its path comes in the environment variable SCRIPT, as a
driver is named on the command line without arguments.
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
    """A FailingBody with a script of strikes; ValueError when none is named.

    `slow SHARE`: from now on the wheels roll SHARE of what is ordered.  `stall SECONDS`: the base
    stands still for so long, inf for ever.  `skid METRES`: it slides to its left.
    `clock-step SECONDS`: see `step_wall_clock`.
    """

    def __init__(self, max_accel: float = math.inf, script: Path | None = None) -> None:
        super().__init__(max_accel)
        named = script or os.environ.get(SCRIPT)
        if not named:
            raise ValueError(f"no script is named in {SCRIPT}")
        self._script = Path(named)
        self._size = self._taken = 0
        self._look_ns = -(1 << 62)
        self._stalled_until = -math.inf

    def step(self, now_ns: int) -> None:
        """Look for new strikes, then let time pass; DriverError when a strike is unknown."""
        if now_ns >= self._look_ns:
            self._look_ns = now_ns + LOOK_PERIOD
            self._look(now_ns)
        self.stall(now_ns < self._stalled_until)
        super().step(now_ns)

    def _look(self, now_ns: int) -> None:
        """Take the lines that have been added to the script since the last look."""
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
            raise DriverError(f"{self._script}: {kind!r} is no fault of a body")


def step_wall_clock(seconds: float) -> None:
    """Let `time.time` and `time.time_ns` of this process jump, as if its host had been set.

    Nothing that goes by the monotonic clock notices.  The clock that compiled libraries read is
    out of reach.
    """
    for name, step in (("time", seconds), ("time_ns", round(seconds * SECOND))):
        setattr(time, name, functools.partial(_stepped, getattr(time, name), step))


def _stepped(clock: Callable[[], float], step: float) -> float:
    return clock() + step
