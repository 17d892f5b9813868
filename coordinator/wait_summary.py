"""The waits of a plan as they are told: why, and what the other order would cost.

Decides: what is told about a wait, and the words for the other way round.  Must not know: how the
reasons were found (explain.py), or where they are shown.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import msgspec

from coordinator.plan import PlanDocument, Reason

TRIED: Final = 200
"""The other order is tried for so many waits of a plan, the longest ones (explain.py)."""


class WaitSummary(msgspec.Struct, frozen=True, kw_only=True):
    """A wait of one epoch's plan, as plan.Reason has it.

    `tried`: whether the other order was; if it was and `otherwise` is null, there is none.
    """

    epoch: int
    robot: str
    s: float
    wait: float
    yields_to: str
    zone: tuple[float, float]
    their_zone: tuple[float, float]
    otherwise: float | None
    tried: bool

    @property
    def other_way(self) -> str:
        """What the other way round would cost: "+5.9 s", "cannot" or "not tried"."""
        if self.otherwise is None:
            return "cannot" if self.tried else "not tried"
        return f"{round(self.otherwise, 1) + 0.0:+.1f} s"


def waits_of(document: PlanDocument) -> list[WaitSummary]:
    """Return the waits of a plan, in its order."""
    reasons = document.waits
    by_length = sorted(range(len(reasons)), key=lambda index: -reasons[index].wait)
    tried = set(by_length[:TRIED])
    return [_told(reason, document.epoch, n in tried) for n, reason in enumerate(reasons)]


def longest(waits: Sequence[WaitSummary], most: int) -> list[WaitSummary]:
    """Return the longest waits, at most so many; all of them in their order if they are few."""
    if len(waits) <= most:
        return list(waits)
    return sorted(waits, key=lambda wait: -wait.wait)[:most]


def _told(reason: Reason, epoch: int, tried: bool) -> WaitSummary:
    return WaitSummary(epoch=epoch, tried=tried, **msgspec.structs.asdict(reason))
