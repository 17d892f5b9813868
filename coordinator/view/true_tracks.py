"""Makes ghosts from black boxes: where the robots truly were, thinned to what an eye can see.

Decides: which rows are needed.  Must not know: plans.  The full format of black boxes is in
sim/judging/blackbox.py.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.base.errors import InputError
from coordinator.curves.nurbs import Array
from coordinator.log.box_file import box_text
from coordinator.view.scene import Body, Ghost

_SEEN: Final = 0.002
"""Greatest distance [m] between the shown and the true place of a robot after thinning."""


def read_ghosts(folder: Path, robots: Sequence[Body], start_ns: int | None = None) -> list[Ghost]:
    """Return the ghosts of the robots that have a black box `<robot>.csv` in a folder.

    start_ns: the fleet's first GO, if known.  Raise InputError, which names the file, if one is not
    a black box.
    """
    texts = {}
    for robot in robots:
        path = folder / f"{robot.id}.csv"
        if path.is_file():
            texts[robot.id] = box_text(path, start_ns)
    return ghosts_of(texts, robots, f"{folder}/")


def ghosts_of(texts: Mapping[str, str], robots: Sequence[Body], where: str) -> list[Ghost]:
    """Return the ghosts of the robots whose black boxes are given as texts, by robot.

    Raise InputError, which names the robot's file after `where`, if one is not a black box.
    """
    ghosts = []
    for place, robot in enumerate(robots):
        if robot.id in texts:
            rows = _rows(texts[robot.id], f"{where}{robot.id}.csv")
            t, x, y = np.round(rows[_needed(rows)], 3).T.tolist()
            ghosts.append(Ghost(robot=place, t=t, x=x, y=y))
    return ghosts


def _rows(text: str, path: str) -> Array:
    """Return the rows t, x, y (n, 3), without a truncated last line."""
    rows = list(csv.reader(text.splitlines()))
    if not rows or rows[0][:3] != ["t", "x", "y"]:
        raise InputError([f"{path}: line 1: the columns do not begin with t,x,y"])
    whole = [row[:3] for row in rows[1:] if len(row) == len(rows[0])]
    try:
        table = np.array(whole, dtype=np.float64).reshape(-1, 3)
    except ValueError:
        raise InputError([f"{path}: holds rows that are not numbers"]) from None
    if not np.isfinite(table).all():
        raise InputError([f"{path}: holds numbers that are not finite"])
    return table


def _needed(rows: Array) -> npt.NDArray[np.intp]:
    """Return the indices (m,) of the rows to keep, by the Douglas-Peucker algorithm over time."""
    keep, open_pieces = {0, len(rows) - 1}, [(0, len(rows) - 1)]
    while open_pieces:
        first, last = open_pieces.pop()
        if last - first < 2:
            continue
        t, places = rows[first : last + 1, 0], rows[first : last + 1, 1:]
        part = (t - t[0]) / max(float(t[-1] - t[0]), 1e-9)
        off = places - places[0] - part[:, None] * (places[-1] - places[0])
        apart = np.hypot(off[:, 0], off[:, 1])
        worst = int(np.argmax(apart))
        if apart[worst] > _SEEN:
            keep.add(first + worst)
            open_pieces += [(first, first + worst), (first + worst, last)]
    return np.array(sorted(keep & set(range(len(rows)))), dtype=np.intp)
