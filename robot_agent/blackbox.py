"""The robot's black box: where it truly was, for whoever judges a run afterwards.

Decides: the file's columns and how much a sudden death may lose.  Nothing in it goes on the wire.
"""

from __future__ import annotations

from pathlib import Path

from protocol.phases import PHASE_NAMES
from protocol.timing import SECOND
from robot_agent.driver import Pose

HEADER = "t,x,y,heading,s,phase\n"
_FLUSH_NS = 200_000_000


class BlackBox:
    """Appends rows from the first GO on; raises OSError when the file cannot be written.

    t [s] counts on the coordinator's clock from `start_ns`, which is set when GO is heard.
    """

    def __init__(self, path: Path) -> None:
        self.start_ns: int | None = None
        self._file = path.open("w", encoding="ascii")
        self._file.write(HEADER)
        self._file.flush()
        self._rows: list[str] = []
        self._flushed_ns = 0

    def write(self, truth_ns: int, pose: Pose | None, s: float, phase: int) -> None:
        """Add a row, flushing five times a second; before the start nothing is written."""
        if self.start_ns is None or pose is None or truth_ns < self.start_ns:
            return
        x, y, heading = pose
        time = (truth_ns - self.start_ns) / SECOND
        self._rows.append(
            f"{time:.6f},{x:.6f},{y:.6f},{heading:.6f},{s:.6f},{PHASE_NAMES[phase]}\n"
        )
        if truth_ns - self._flushed_ns >= _FLUSH_NS:
            self._flush()
            self._flushed_ns = truth_ns

    def close(self) -> None:
        """Write what is left; may be called twice."""
        if not self._file.closed:
            self._flush()
            self._file.close()

    def _flush(self) -> None:
        self._file.writelines(self._rows)
        self._file.flush()
        self._rows.clear()
