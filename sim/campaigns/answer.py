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


def add_up(outcomes: Sequence[Outcome], violations: Iterable[Violation] = ()) -> Answer:
    """Return the sums and spreads of all runs."""
    reasons = Counter(reason for one in outcomes for reason in one.excused.values())
    return Answer(
        runs=len(outcomes),
        collisions=sum(len(one.touches) for one in outcomes),
        stuck=sum(len(one.stuck) + (not one.over) for one in outcomes),
        arrived=sum(one.arrived for one in outcomes),
        expected=sum(one.expected for one in outcomes),
        violations=list(violations),
        latency={name: found for name in _MEASURES if (found := _spread(outcomes, name))},
        excused=dict(sorted(reasons.items())),
        epochs=sum(one.epochs for one in outcomes),
        robots=sum(one.expected + len(one.excused) for one in outcomes),
        anyway=sum(one.anyway for one in outcomes),
        collisions_with_obstacles=sum(len(one.obstacle_touches) for one in outcomes),
    )


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


def _spread(outcomes: Sequence[Outcome], name: str) -> Spread | None:
    values = [value for one in outcomes for value in getattr(one.latencies, name)]
    if not values:
        return None
    median, p99, worst = (round(float(q), 4) for q in np.quantile(values, (0.5, 0.99, 1.0)))
    return Spread(len(values), median, p99, worst)
