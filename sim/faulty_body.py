"""A simulated base that fails on request, inside the robot's own process.

Decides: how slow, stall, skid and clock-step look from a robot's program.  Must not know: when a
fault is due (whoever writes the script strikes by adding a line), plans, other robots.

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
from sim.body import SimulatedBody

SCRIPT: Final = "SPLINEFLEET_BODY_SCRIPT"

LOOK_PERIOD: Final = 20 * MILLISECOND

SKID_TIME: Final = 0.2
"""For how long [s] a body slides."""


class FaultyBody(SimulatedBody):
    """A SimulatedBody with a script of strikes; ValueError when none is named.

    `slow SHARE`: from now on the wheels turn at SHARE of what is ordered.  `stall SECONDS`: the
    base stands still for so long, inf for ever.  `skid METRES`: it slides to where its left
    is when that begins, for SKID_TIME and whatever the wheels do.  `clock-step SECONDS`: see
    `step_wall_clock`.
    """

    def __init__(self, max_accel: float = math.inf, script: Path | None = None) -> None:
        super().__init__(max_accel)
        named = script or os.environ.get(SCRIPT)
        if not named:
            raise ValueError(f"no script is named in {SCRIPT}")
        self._script = Path(named)
        self._size = self._taken = 0
        self._look_ns = self._stepped_ns = -(1 << 62)
        self._share = 1.0
        self._stalled_until = -math.inf
        self._slide_x = self._slide_y = 0.0
        self._slide_left = 0.0

    def step(self, now_ns: int) -> None:
        """Look for new strikes, then let time pass; DriverError when a strike is unknown."""
        if now_ns >= self._look_ns:
            self._look_ns = now_ns + LOOK_PERIOD
            self._look(now_ns)
        super().step(now_ns)
        self._slide((now_ns - self._stepped_ns) / SECOND)
        self._stepped_ns = max(now_ns, self._stepped_ns)

    def drive(self, speed_mps: float, curvature_radpm: float, distance_m: float) -> None:
        """Take an order as far as the wheels obey it."""
        share = 0.0 if self._stepped_ns < self._stalled_until else self._share
        super().drive(share * speed_mps, curvature_radpm, distance_m)

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
            self._share = number
        elif kind == "stall":
            self._stalled_until = now_ns + number * SECOND
            self.stop()
        elif kind == "skid":
            self._slide_x = -number / SKID_TIME * math.sin(self.heading)
            self._slide_y = number / SKID_TIME * math.cos(self.heading)
            self._slide_left = SKID_TIME
        elif kind == "clock-step":
            step_wall_clock(number)
        else:
            raise DriverError(f"{self._script}: {kind!r} is no fault of a body")

    def _slide(self, seconds: float) -> None:
        """Move for so long, or for what is left of a skid."""
        slid = min(max(seconds, 0.0), self._slide_left)
        if slid > 0.0:
            self._slide_left -= slid
            self.x += self._slide_x * slid
            self.y += self._slide_y * slid


def step_wall_clock(seconds: float) -> None:
    """Let `time.time` and `time.time_ns` of this process jump, as if its host had been set.

    Nothing that goes by the monotonic clock notices.  The clock that compiled libraries read is
    out of reach.
    """
    for name, step in (("time", seconds), ("time_ns", round(seconds * SECOND))):
        setattr(time, name, functools.partial(_stepped, getattr(time, name), step))


def _stepped(clock: Callable[[], float], step: float) -> float:
    return clock() + step
