"""The robot's black box: where it truly was, for whoever judges a run afterwards.

Decides: the file's columns and that a sudden death loses nothing.  Nothing in it goes on the wire.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from protocol.phases import PHASE_NAMES
from protocol.timing import SECOND
from robot_agent.clock_sync import ClockSync
from robot_agent.driver import Pose

HEADER = "t,x,y,heading,s,phase\n"


class CoordinatorTime:
    """The coordinator's time [ns], read from the robot's own clock; it never runs backwards.

    Two programs on one host have one clock: the exchange finds no offset beyond its error, and the
    host's own time is exact.  Elsewhere it is right within that error.
    """

    def __init__(self, clock: Callable[[], int], sync: ClockSync) -> None:
        self._clock = clock
        self._sync = sync
        self._ahead_ns: int | None = None
        self._told_ns = 0

    def now(self) -> int | None:
        """Return the time; None as long as the coordinator has told nothing of it."""
        own_ns, sync = self._clock(), self._sync
        if sync.good:
            is_one_clock = abs(sync.offset_ns) <= sync.error_ns(own_ns)
            self._ahead_ns = 0 if is_one_clock else sync.offset_ns
        if self._ahead_ns is None:
            return None
        self._told_ns = max(self._told_ns, own_ns + self._ahead_ns)
        return self._told_ns


class BlackBox:
    """Appends rows from the first GO on; raises OSError when the file cannot be written.

    t [s] counts on the coordinator's clock from `start_ns`, which is set when GO is heard.  Each
    row reaches the system at once: what a killed robot did last is what matters most.
    """

    def __init__(self, path: Path) -> None:
        self.start_ns: int | None = None
        self._file = path.open("w", encoding="ascii", buffering=1)
        self._file.write(HEADER)

    def write(self, truth_ns: int | None, pose: Pose | None, s: float, phase: int) -> None:
        """Add a row; before the start, or while the time is not known, nothing is written."""
        if self.start_ns is None or pose is None or truth_ns is None or truth_ns < self.start_ns:
            return
        x, y, heading = pose
        time = (truth_ns - self.start_ns) / SECOND
        self._file.write(f"{time:.6f},{x:.6f},{y:.6f},{heading:.6f},{s:.6f},{PHASE_NAMES[phase]}\n")

    def close(self) -> None:
        """Close the file; may be called twice."""
        self._file.close()
