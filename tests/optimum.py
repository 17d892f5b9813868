"""The least sum of delays on given paths, over all orders in all zones: OR-tools CP-SAT.

A relaxation of every tau-safe plan on these paths: conflicts count only at sampled places, no
inertia, rests anywhere.  So no plan is better, and a gap to it is at most as large as it seems.
Nothing in here imports the coordinator.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from ortools.sat.python import cp_model

TICKS = 1_000_000
"""Times in the model are whole microseconds."""
EFFORT = 60.0
"""CP-SAT stops after this much of its deterministic time; the bound it has by then counts."""
SHARP = 1e-3
"""The optimum is sought to this share of it, or this much [s] if that is more."""
_ROUNDS = 200
_PASSES = 100
_ENOUGH = 1e-6
_TIGHT = 1e-5


@dataclass(frozen=True)
class Optimum:
    """No plan has a sum of delays below `delay` [s]; a schedule without inertia has `reached` [s].

    The two are as good as one, unless the search was given up.
    """

    delay: float
    reached: float

    @property
    def proven(self):
        """Tell whether the optimum is known to SHARP."""
        return self.reached - self.delay <= SHARP * max(1.0, self.delay)


def least_delay(courses, zones, tau, most=None):
    """Return the optimum, None when no orders work; `most` [s] bounds the sum of delays if known.

    Rows are taken in as they are broken: few of them ever matter.
    """
    model = _Model(courses, zones, tau, most)
    reached = math.inf
    for _ in range(_ROUNDS):
        delay = model.solve()
        if delay is None:
            return None
        reached = min(reached, model.mend())
        found = Optimum(delay, reached)
        if found.proven:
            break
    return found


class _Model:
    """Times at the places that matter, and which order each zone is passed in."""

    def __init__(self, courses, zones, tau, most):
        self.courses, self.zones, self.tau, self.most = courses, zones, tau, most
        self.places = [{0, course.last} for course in courses]
        self.alone = sum(course.alone for course in courses)
        self.rows = {}
        self.found = None
        for number, zone in enumerate(zones):
            for rows in zone.orders:
                # this row decides when nobody rests inside the zone
                lead = courses[rows.first].drive[rows.at] - courses[rows.second].drive[rows.to]
                self._add(number, rows, int(np.argmax(lead)))

    def _add(self, number, rows, k):
        at, to = int(rows.at[k]), int(rows.to[k])
        self.rows[number, rows.first, at, to] = rows
        self.places[rows.first].add(at)
        self.places[rows.second].add(to)

    def solve(self):
        """Return the least sum of delays [s] for the rows taken in so far; None without any."""
        model = cp_model.CpModel()
        times = self._times(model)
        a_first = [model.new_bool_var("") for _ in self.zones]
        for zone, literal in zip(self.zones, a_first, strict=True):
            model.add_bool_or(
                ([literal] if zone.a_first else []) + ([~literal] if zone.b_first else [])
            )
        for (number, _, at, to), rows in self.rows.items():
            order = a_first[number] if rows is self.zones[number].a_first else ~a_first[number]
            gap = times[rows.second][to] - times[rows.first][at]
            model.add(gap >= int(self.tau * TICKS)).only_enforce_if(order)
        ends = [time[course.last] for time, course in zip(times, self.courses, strict=True)]
        model.minimize(sum(ends))
        if self.found is not None:
            for literal, value in zip(a_first, self.found, strict=True):
                model.add_hint(literal, value)
        solver = cp_model.CpSolver()
        solver.parameters.num_workers = 1
        solver.parameters.max_deterministic_time = EFFORT
        status = solver.solve(model)
        if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
            return None
        self.found = [bool(solver.value(literal)) for literal in a_first]
        return max(0.0, solver.best_objective_bound / TICKS - self.alone)

    def _times(self, model):
        """Make the times of all places that matter; driving takes at least as long as it takes."""
        most = self._most()
        times = []
        for course, places in zip(self.courses, self.places, strict=True):
            drive = {at: int(course.drive[at] * TICKS) for at in sorted(places)}
            one = {at: model.new_int_var(t, t + most, "") for at, t in drive.items()}
            for before, after in itertools.pairwise(one):
                model.add(one[after] - one[before] >= drive[after] - drive[before])
            times.append(one)
        return times

    def _most(self):
        """Return a delay [ticks] that nobody exceeds: the known one, else every course and row.

        A longest chain of causes takes no row and no stretch of a course twice.
        """
        chain = self.alone + len(self.rows) * self.tau
        return int(((chain if self.most is None else self.most) + 1.0) * TICKS)

    def mend(self):
        """Drive the orders found with all rows: return the sum of delays [s], inf if it goes on.

        Taken in are the rows broken on the way, and in the end those that somebody rests for: with
        them the model knows what these orders cost.
        """
        times = [course.drive.copy() for course in self.courses]
        orders = [
            (number, zone.a_first if a_first else zone.b_first)
            for number, (zone, a_first) in enumerate(zip(self.zones, self.found, strict=True))
        ]
        for _ in range(_PASSES):
            settled = True
            for number, rows in orders:
                lacks = rows.lacks(times, self.tau)
                if lacks.max() > _ENOUGH:
                    self._add(number, rows, int(np.argmax(lacks)))
                    lead = self._lead(rows.second, times)
                    lead[rows.to] += np.maximum(lacks, 0.0)
                    drive = self.courses[rows.second].drive
                    times[rows.second] = np.maximum.accumulate(lead) + drive
                    settled = False
            if settled:
                self._add_tight(orders, times)
                return sum(float(one[-1]) for one in times) - self.alone
        return math.inf

    def _add_tight(self, orders, times):
        """Take in the rows that hold exactly where the second robot has just rested."""
        for number, rows in orders:
            rest = np.diff(self._lead(rows.second, times), prepend=0.0)
            tight = (rows.lacks(times, self.tau) > -_TIGHT) & (rest[rows.to] > _TIGHT)
            for k in np.flatnonzero(tight).tolist():
                self._add(number, rows, k)

    def _lead(self, robot, times):
        """Return how long [s] a robot has rested before it comes to each place (n,)."""
        return times[robot] - self.courses[robot].drive
