"""The robot's black box: where it truly was and when, for judging a run afterwards.

Decides: the file's columns, which clock its times come from, and that a killed program loses no
row.  Its content is never sent.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Final

from protocol.phases import PHASE_NAMES
from protocol.shared_clock import shares_clock
from protocol.timing import SECOND
from robot_agent.driver import Pose

HEADER: Final = "t,x,y,heading,s,phase,estimate\n"
_LONGEST_LINE: Final = 200


class BlackBox:
    """Appends rows from the first GO on; raises OSError when the file cannot be written.

    t [s] is the time on the coordinator's clock since the start that `begin` sets.  If robot and
    coordinator share the host's clock (shared_clock.py), t is taken from that clock, and the last
    column is the robot's own estimate of t.  On another machine only the estimate is known: t is
    the estimate, except that it never decreases, and the last column is empty.

    Each row is passed to the system at once, because the last rows of a killed robot matter most.
    An existing box is preserved.  If it is of the same run, which PATH.start records, a restarted
    robot appends to it; a box of another run is renamed to PATH.1, or the next free number.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._start_ns: int | None = None
        self._boot = -1
        self._is_shared = False
        self._ahead_ns: int | None = None
        self._told_ns = 0
        self._earlier = _set_aside(path)
        self._open("w")
        self._file.write(HEADER)

    def join(self, boot: int) -> None:
        """Append to the earlier box if it is of the coordinator with this boot id."""
        if self._start_ns is not None or self._earlier is None or not self._path.is_file():
            return
        before = _numbers(_start_of(self._earlier)) if boot != self._boot else []
        self._boot = boot
        if before[:1] == [boot]:
            self._count_from(boot, before[1])
            self._file.close()
            _drop_cut_line(self._earlier)
            _move(self._earlier, self._path)
            self._open("a")

    def begin(self, boot: int, start_ns: int) -> None:
        """Set time 0 to the start [ns] of a coordinator's first GO; later calls do nothing.

        If the earlier box is of the same coordinator, its rows and its start are used instead.
        """
        self.join(boot)
        if self._start_ns is not None:
            return
        self._count_from(boot, start_ns)
        if self._path.is_file():
            _start_of(self._path).write_text(f"{boot} {start_ns}\n", encoding="ascii")

    def write(
        self, now_ns: int, estimate_ns: int | None, pose: Pose | None, s: float, phase: int
    ) -> None:
        """Add a row, unless t is not known or `begin` was not called yet.

        now_ns: on the host's clock; estimate_ns: the robot's estimate of the coordinator's time,
        None while it has none.
        """
        time_ns, start_ns = self._time(now_ns, estimate_ns), self._start_ns
        if start_ns is None or pose is None or time_ns is None or time_ns < start_ns:
            return
        x, y, heading = pose
        numbers = ((time_ns - start_ns) / SECOND, x, y, heading, s)
        row = ",".join(f"{number:.6f}" for number in numbers)
        beside = ""
        if self._is_shared and estimate_ns is not None:
            beside = f"{(estimate_ns - start_ns) / SECOND:.6f}"
        self._file.write(f"{row},{PHASE_NAMES[phase]},{beside}\n")

    def close(self) -> None:
        """Close the file; may be called twice."""
        self._file.close()

    def _count_from(self, boot: int, start_ns: int) -> None:
        self._start_ns, self._is_shared = start_ns, shares_clock(boot)

    def _time(self, now_ns: int, estimate_ns: int | None) -> int | None:
        """Return the best estimate of the coordinator's time [ns]; None while there is none."""
        if self._is_shared:
            self._ahead_ns = 0
        elif estimate_ns is not None:
            self._ahead_ns = estimate_ns - now_ns
        if self._ahead_ns is None:
            return None
        self._told_ns = max(self._told_ns, now_ns + self._ahead_ns)
        return self._told_ns

    def _open(self, mode: str) -> None:
        self._file = self._path.open(mode, encoding="ascii", buffering=1)


def _set_aside(path: Path) -> Path | None:
    """Rename a box with rows to the next free number; return the newest numbered box."""
    free = 1
    while (place := path.with_name(f"{path.name}.{free}")).exists():
        free += 1
    if path.is_file() and (path.stat().st_size > len(HEADER) or _start_of(path).exists()):
        _move(path, place)
        return place
    return path.with_name(f"{path.name}.{free - 1}") if free > 1 else None


def _start_of(box: Path) -> Path:
    return box.with_name(f"{box.name}.start")


def _move(box: Path, place: Path) -> None:
    """Move a box and its .start file to a path where there is no box with rows."""
    box.replace(place)
    with suppress(FileNotFoundError):
        _start_of(box).replace(_start_of(place))


def _numbers(path: Path) -> list[int]:
    """Return a coordinator's boot id and its run's start [ns]; empty when they cannot be read."""
    try:
        boot, start_ns = path.read_text(encoding="ascii").split()
        return [int(boot), int(start_ns)]
    except (OSError, ValueError):
        return []


def _drop_cut_line(path: Path) -> None:
    """Remove a last line that a kill has cut short."""
    with path.open("rb+") as file:
        end = file.seek(0, os.SEEK_END)
        tail_at = file.seek(max(0, end - _LONGEST_LINE))
        tail = file.read()
        file.truncate(tail_at + tail.rfind(b"\n") + 1)
