"""Reads a robot's black box: where the robot truly was, and how far that is from a plan.

Decides: what counts as tracking error.  The definition is that of sim/judging/judge.py, which is
exact where this module samples.  Must not know: logs, messages.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from coordinator.base.errors import InputError
from coordinator.findings.ride_samples import Array, RideSamples
from coordinator.log.box_file import box_text, boxes_of_run
from protocol.phases import DONE, PHASE_NAMES

_COLUMNS: Final = "t,x,y,heading,s,phase,estimate"
_OLDER: Final = "t,x,y,heading,s,phase"
"""The columns of black boxes without the robot's estimate; these can be read too."""

_PHASE: Final = 5
_ALIKE: Final = 1e-4
"""Places nearer to each other than this [m] are compared with the plan only once."""


STOPPED: Final = 5.0
"""So long [s] after its coordinator's last word every robot has stopped."""


@dataclass(frozen=True, eq=False)
class TrueCourse:
    """Rows of a black box: t (n,) [s since the first GO], places (n, 2) [m].

    arrivals (k,) [s]: when the robot came to the goals of its courses.
    """

    t: Array
    places: Array
    arrivals: Array

    @property
    def arrival(self) -> float | None:
        """When [s] the robot was at the goal of the last course on which it arrived."""
        return round(float(self.arrivals[-1]), 3) if len(self.arrivals) else None

    def at(self, times: Array) -> Array:
        """Return the places (m, 2) at times (m,), linear between rows and at rest outside them."""
        return np.column_stack([np.interp(times, self.t, self.places[:, i]) for i in (0, 1)])

    def between(self, begin: float, end: float) -> TrueCourse:
        """Return the rows with begin <= t < end."""
        kept = (self.t >= begin) & (self.t < end)
        then = (self.arrivals >= begin) & (self.arrivals < end)
        return TrueCourse(self.t[kept], self.places[kept], self.arrivals[then])

    def off(self, ride: RideSamples, start: float, row: float) -> float:
        """Return the greatest distance [m] from a plan whose time zero is `start`.

        A robot may be late by any time, so it is compared with all places where the plan has had it
        so far.  row [s]: by how much a row's time may be off.
        """
        now = ride.arcs_at(self.t - start + row)
        worst = 0.0
        for index in _unlike(self.places):
            last = int(np.searchsorted(ride.arcs, now[index])) + 1
            line = ride.places[: max(last, 2)]
            worst = max(worst, float(_off(line[:-1], line[1:], self.places[index]).min()))
        return worst


def read_course(
    path: Path, start_ns: int | None = None, earlier: Sequence[Path] = ()
) -> TrueCourse:
    """Read a black box, without a truncated last line.

    start_ns: the fleet's first GO, if known; earlier: its files before this one, the oldest first.
    Raises InputError, which names file and line, if it is not valid.
    """
    lines = box_text(path, start_ns, earlier).splitlines()
    if not lines or lines[0] not in (_COLUMNS, _OLDER):
        raise InputError([f"{path}: line 1: the columns are not {_COLUMNS}"])
    rows, commas = lines[1:], lines[0].count(",")
    if rows and rows[-1].count(",") != commas:
        rows.pop()
    for number, line in enumerate(rows, start=2):
        if line.count(",") != commas:
            raise InputError([f"{path}: line {number}: is not a row of a black box"])
    phases = [line.split(",")[_PHASE] for line in rows]
    table = _numbers(path, rows)
    if not np.isfinite(table).all() or np.any(np.diff(table[:, 0]) < 0.0):
        raise InputError([f"{path}: its times do not increase, or a number is not finite"])
    done = PHASE_NAMES[DONE]
    begins = [i for i, (a, b) in enumerate(pairwise(["", *phases])) if a != b == done]
    return TrueCourse(table[:, 0], table[:, 1:], table[begins, 0])


def _numbers(path: Path, rows: list[str]) -> Array:
    """Return t, x, y of rows, (n, 3); raise InputError, which names the first invalid line."""
    if not rows:
        return np.empty((0, 3))
    try:
        return np.loadtxt(rows, delimiter=",", usecols=(0, 1, 2), ndmin=2, comments=None)
    except ValueError as error:
        at = re.search(r"row (\d+)", str(error))
        line = f"line {int(at[1]) + 2}: " if at else ""
        raise InputError([f"{path}: {line}is not a row of a black box"]) from None


def courses_in(
    folders: Iterable[Path],
    robots: Iterable[str],
    start_ns: int | None = None,
    starts: Collection[int] = (),
) -> dict[str, TrueCourse]:
    """Read the robots' black boxes `ROBOT.csv`, each from the first folder that has it.

    start_ns: the fleet's first GO, if known; starts: every time zero [ns] of the log.  Raises
    InputError, which names the files, for boxes that count from none of those.
    """
    folders, every = list(folders), {*starts, *(() if start_ns is None else (start_ns,))}
    boxes: dict[str, list[Path]] = {}
    strange: list[str] = []
    for robot in robots:
        paths = (folder / f"{robot}.csv" for folder in folders)
        if (path := next(filter(Path.is_file, paths), None)) is not None:
            boxes[robot] = boxes_of_run(path, every)
            strange += [] if boxes[robot] else [f"{path}: is of another run than the log"]
    if strange:
        raise InputError(strange)
    return {robot: read_course(one[-1], start_ns, one[:-1]) for robot, one in boxes.items()}


def _unlike(places: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.intp]]:
    """Return the last row of each run of rows with nearly the same place."""
    if not len(places):
        return np.empty(0, np.intp)
    changes = np.any(np.diff(np.floor(places / _ALIKE), axis=0) != 0.0, axis=1)
    return np.flatnonzero(np.append(changes, True))


def _off(before: Array, after: Array, places: Array) -> Array:
    """Return the distances (n,) of places from segments; either may be (n, 2) or a single one."""
    leg, to_place = after - before, places - before
    square = np.maximum(np.einsum("ij,ij->i", leg, leg), 1e-18)
    share = np.clip(np.einsum("ij,ij->i", leg, to_place) / square, 0.0, 1.0)
    miss = to_place - share[:, None] * leg
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", miss, miss)))
