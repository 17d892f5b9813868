"""How long silence is tolerated on a link that loses and delays messages.

Decides: how many messages may be lost one after another, when a robot counts as silent, and the
clock error, from the delay and loss of the link.  An exchange of messages gives the other clock's
time to within half the duration of the exchange, which is at most the one-way delay.  The clock
error includes this delay, so the result of any exchange may be used.  Must not know: robots, plans.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from coordinator.scenario.model import Link
from protocol.timing import (
    CLOCK_ERROR,
    MILLISECOND,
    REPORT_PERIOD,
    REPORT_TIMEOUT,
    SECOND,
)

_SLOWED: Final = 1e-2
"""How probable it may be that a robot on time slows down because messages were lost."""

_FALSE_ALARM: Final = 1e-6
"""The greatest allowed probability that all Reports of a timeout are lost."""

_JITTER: Final = 100 * MILLISECOND
"""How late messages may be beyond the link's delay, because of both sides' ticks and reordering."""


@dataclass(frozen=True)
class LinkTimes:
    """What a fleet on this link tolerates."""

    lost: int
    """How many messages one after another may be lost without a robot slowing down."""
    report_timeout_ns: int
    """A robot that is silent for this long is lost."""
    clock_error_ns: int
    """The greatest error of an armed robot's estimate of the coordinator's clock."""


def link_times(link: Link) -> LinkTimes:
    """Return what is tolerated on a link with this one-way delay [s] and share of loss."""
    delay = round(link.delay * SECOND)
    timeout = (_in_a_row(link.loss, _FALSE_ALARM) + 1) * REPORT_PERIOD + delay + _JITTER
    return LinkTimes(
        lost=_in_a_row(link.loss, _SLOWED),
        report_timeout_ns=_whole(max(REPORT_TIMEOUT, timeout)),
        clock_error_ns=_whole(CLOCK_ERROR + delay),
    )


def _in_a_row(loss: float, chance: float) -> int:
    """Return how many messages in a row are lost at most, apart from a chance."""
    return math.ceil(math.log(chance) / math.log(loss)) if loss > 0.0 else 0


def _whole(time_ns: int) -> int:
    """Round up to whole milliseconds, the unit on the wire."""
    return -(-time_ns // MILLISECOND) * MILLISECOND
