"""Exhaustive oracle: is there a schedule on given paths, whoever goes first where?

Every zone is passed in one of two orders; for given orders the earliest times follow by driving on
until nothing changes, or grow past all bounds when the orders form a circle.  All orders that
matter are tried: a zone is branched on only when the times so far break it both ways.  Times may
be stretched at will, so what exists without inertia exists with it.  Nothing in here imports the
coordinator.
"""

from __future__ import annotations

import numpy as np

ENOUGH = 1e-9


class TooManyError(Exception):
    """The search was given up: neither yes nor no."""


def earliest_times(courses, orders, tau, horizon):
    """Return when each robot comes to each of its places, [(n,)] in seconds; None past `horizon`.

    `orders`: oracle_zones.Rows of all zones that are decided.
    """
    times = [course.drive.copy() for course in courses]
    changed = True
    while changed:
        changed = False
        for rows in orders:
            lacks = rows.lacks(times, tau)
            if lacks.max() > ENOUGH:
                drive = courses[rows.second].drive
                lead = times[rows.second] - drive
                lead[rows.to] += np.maximum(lacks, 0.0)
                times[rows.second] = np.maximum.accumulate(lead) + drive
                changed = True
                if times[rows.second][-1] > horizon:
                    return None
    return times


def find_times(courses, zones, tau, horizon, tries=20_000):
    """Return the robots' times, as earliest_times does, in orders that work; None without any.

    Raises TooManyError.
    """
    forced = [rows for zone in zones if len(zone.orders) == 1 for rows in zone.orders]
    if not all(zone.orders for zone in zones):
        return None
    waiting = [(forced, [zone for zone in zones if len(zone.orders) == 2])]
    for _ in range(tries):
        if not waiting:
            return None
        decided, undecided = waiting.pop()
        times = earliest_times(courses, decided, tau, horizon)
        if times is None:
            continue
        broken = [
            (min(lacks), zone, lacks)
            for zone in undecided
            if min(lacks := [rows.lacks(times, tau).max() for rows in zone.orders]) > ENOUGH
        ]
        if not broken:
            return times
        _, worst, lacks = max(broken, key=lambda item: item[0])
        rest = [zone for zone in undecided if zone is not worst]
        # the order that asks for less is looked at first: it comes off the top
        by_lack = sorted(zip(lacks, worst.orders, strict=True), key=lambda item: -item[0])
        waiting += [([*decided, rows], rest) for _, rows in by_lack]
    raise TooManyError
