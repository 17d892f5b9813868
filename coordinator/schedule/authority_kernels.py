"""Compiled: up to which plan time each robot may drive.

Decides: the rule of design section 3.  Must not know: clocks, messages, when it is applied.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free

Integers = npt.NDArray[np.int64]
Milliseconds = npt.NDArray[np.int32]


class Table(NamedTuple):
    """Staircases (plan/staircases.py), and for each of them the first knot not yet passed.

    pair_at (robots + 1,): where the staircases of each robot behind begin.  `ahead` (n,), `first`
    (n + 1,), `at`, `need` [ms]: as in Staircases.  passed (n,): the first knot whose need is not
    below the known progress of the robot ahead; it only advances, as progress does.
    """

    tau_ms: int
    pair_at: Integers
    ahead: Integers
    first: Integers
    at: Milliseconds
    need: Milliseconds
    passed: Integers


@allocation_free
def _limit(table: Table, pair: int, progress: int) -> int:
    """Return the greatest plan time [ms] of the robot behind whose need is below a progress [ms].

    Within tau of the robot ahead nothing is needed.  Moves `passed` on.
    """
    k, end = table.passed[pair], table.first[pair + 1]
    while k < end and table.need[k] < progress:
        k += 1
    table.passed[pair] = k
    if k == end:
        return 2**62
    limit = np.int64(table.at[k]) - 1
    if k > table.first[pair]:
        low, begin = np.int64(table.need[k - 1]), np.int64(table.at[k - 1])
        wide, rise = np.int64(table.at[k]) - begin, np.int64(table.need[k]) - low
        limit = begin + ((progress - low) * wide - 1) // rise
    return max(int(limit), progress + table.tau_ms - 1)


@allocation_free
def grant(table: Table, progress: Integers, wanted: Integers, authority: Integers) -> None:
    """Raise each robot's authority (n,) [ms] to what it wants, as far as the others let it.

    progress (n,) [ms]: what each robot is known to have driven.
    """
    for robot in range(len(authority)):
        most = wanted[robot]
        for pair in range(table.pair_at[robot], table.pair_at[robot + 1]):
            if most <= authority[robot]:
                break
            most = min(most, _limit(table, pair, progress[table.ahead[pair]]))
        authority[robot] = max(authority[robot], most)


@allocation_free
def breaks(table: Table, progress: Integers, told: Integers) -> bool:
    """Return whether some robot was told a plan time (n,) [ms] that the others do not let it."""
    for robot in range(len(told)):
        for pair in range(table.pair_at[robot], table.pair_at[robot + 1]):
            if told[robot] > _limit(table, pair, progress[table.ahead[pair]]):
                return True
    return False


@allocation_free
def holder(table: Table, progress: Integers, robot: int) -> int:
    """Return the robot ahead that leaves a robot the least authority; -1 if nobody limits it."""
    found, least = np.int64(-1), np.int64(2**62)
    for pair in range(table.pair_at[robot], table.pair_at[robot + 1]):
        limit = np.int64(_limit(table, pair, progress[table.ahead[pair]]))
        if limit < least:
            found, least = table.ahead[pair], limit
    return int(found)
