"""The result of a campaign, as the object printed with --json and as a table for people.

Decides: how outcomes add up.  Must not know: how runs are made.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Final

import msgspec
import numpy as np
from rich.table import Table

from sim.campaigns.campaign import Outcome

_MEASURES: Final = {
    "around": "death to others going around, s",
}

_REASONS: Final = {
    "hang": "hung to the end",
    "stall": "stalled to the end",
    "cut": "cut off to the end",
    "clock-pause": "computer stopped to the end",
    "unfit": "failed too often",
    "restarted": "restarted, but nobody admitted it",
}
"""Words for the reasons why a robot is not expected to arrive; others are shown unchanged.
"""


class Violation(msgspec.Struct, frozen=True):
    """A run that failed: the reasons, and the command that reproduces it."""

    seed: int
    command: str
    why: tuple[str, ...]


class Spread(msgspec.Struct, frozen=True):
    """How many latencies were measured, and their distribution [s]."""

    count: int
    median: float
    p99: float
    worst: float


class Answer(msgspec.Struct, frozen=True):
    """The result of a campaign; `robots` counts the robots of all runs together.

    `excused` counts, by reason, the robots that could not be expected to arrive; `anyway`: how many
    of them arrived nevertheless, mostly before their fault began.
    """

    runs: int
    collisions: int
    stuck: int
    arrived: int
    expected: int
    violations: list[Violation]
    latency: dict[str, Spread]
    excused: dict[str, int]
    epochs: int
    robots: int = 0
    anyway: int = 0
    collisions_with_obstacles: int = 0


class Tally:
    """The sums of outcomes, which need not be kept: a campaign may have a million runs."""

    def __init__(self) -> None:
        self._sums: Counter[str] = Counter()
        self._excused: Counter[str] = Counter()
        self._latencies: dict[str, list[float]] = {name: [] for name in _MEASURES}

    def add(self, one: Outcome) -> None:
        """Add the outcome of a run."""
        self._sums.update(
            runs=1,
            collisions=len(one.touches),
            stuck=len(one.stuck) + (not one.over),
            arrived=one.arrived,
            expected=one.expected,
            epochs=one.epochs,
            robots=one.expected + len(one.excused),
            anyway=one.anyway,
            collisions_with_obstacles=len(one.obstacle_touches),
        )
        self._excused.update(one.excused.values())
        for name, values in self._latencies.items():
            values += getattr(one.latencies, name)

    def answer(self, violations: Iterable[Violation]) -> Answer:
        """Return the sums and spreads of all runs."""
        return Answer(
            runs=self._sums["runs"],
            collisions=self._sums["collisions"],
            stuck=self._sums["stuck"],
            arrived=self._sums["arrived"],
            expected=self._sums["expected"],
            violations=list(violations),
            latency={name: _spread(values) for name, values in self._latencies.items() if values},
            excused=dict(sorted(self._excused.items())),
            epochs=self._sums["epochs"],
            robots=self._sums["robots"],
            anyway=self._sums["anyway"],
            collisions_with_obstacles=self._sums["collisions_with_obstacles"],
        )


def add_up(outcomes: Iterable[Outcome], violations: Iterable[Violation] = ()) -> Answer:
    """Return the sums and spreads of all runs."""
    tally = Tally()
    for outcome in outcomes:
        tally.add(outcome)
    return tally.answer(violations)


def render(answer: Answer) -> Table:
    """Return a table for people."""
    table = Table(box=None, show_header=False, padding=(0, 2))
    for name in ("runs", "epochs", "robots", "collisions", "collisions_with_obstacles", "stuck"):
        table.add_row(name.replace("_", " "), str(getattr(answer, name)))
    table.add_row("arrived", f"{answer.arrived} of {answer.expected} expected")
    table.add_row("not expected", _excused(answer))
    for name, title in _MEASURES.items():
        if name in answer.latency:
            one = answer.latency[name]
            spread = f"median {one.median:.2f}, 99 % {one.p99:.2f}, worst {one.worst:.2f}"
            table.add_row(title, f"{spread} ({one.count})")
    return table


def _excused(answer: Answer) -> str:
    """Return how many robots were not expected to arrive, why, and how many arrived anyway."""
    if not answer.excused:
        return "none"
    reasons = [f"{count} {_REASONS.get(why, why)}" for why, count in answer.excused.items()]
    total = sum(answer.excused.values())
    return f"{total}: {', '.join(reasons)}; {answer.anyway} of them arrived anyway"


def say(violation: Violation) -> str:
    """Return a violation on two lines, the second of which is the command alone."""
    return f"seed {violation.seed}: {'; '.join(violation.why)}\n{violation.command}"


def _spread(values: Sequence[float]) -> Spread:
    median, p99, worst = (round(float(q), 4) for q in np.quantile(values, (0.5, 0.99, 1.0)))
    return Spread(len(values), median, p99, worst)
