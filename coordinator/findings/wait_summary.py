"""Sums up the waits of a plan: why robots wait, and what the reverse precedence would cost.

Decides: what is shown about a wait, and the words for the reverse precedence.  Must not know: how
the reasons were found (schedule/wait_reasons.py), or where they are shown.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from coordinator.plan.document import PlanDocument


class WaitSummary(msgspec.Struct, frozen=True, kw_only=True):
    """A wait of one epoch's plan, with the fields of plan.Reason.

    `tried`: whether the planner tried the reverse precedence.  If it did and `otherwise` is null,
    there is no plan with it.
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
        """What the reverse precedence would cost: "+5.9 s", "cannot" or "not tried"."""
        if self.otherwise is None:
            return "cannot" if self.tried else "not tried"
        return f"{round(self.otherwise, 1) + 0.0:+.1f} s"


def waits_of(document: PlanDocument) -> list[WaitSummary]:
    """Return the waits of a plan, in the plan's order."""
    return [
        WaitSummary(epoch=document.epoch, **msgspec.structs.asdict(reason))
        for reason in document.waits
    ]


def longest(waits: Sequence[WaitSummary], most: int) -> list[WaitSummary]:
    """Return the `most` longest waits, or all of them in their order if there are not more."""
    if len(waits) <= most:
        return list(waits)
    return sorted(waits, key=lambda wait: -wait.wait)[:most]
