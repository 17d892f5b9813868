"""How long silence is tolerated on a link that loses and delays messages.

Decides: the leases of both sides and the clock error, from the delay and loss of the link; on a
good link they are those of protocol/timing.py.  An exchange of messages gives the other clock's
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
    COMMAND_PERIOD,
    LEASE,
    MILLISECOND,
    REPORT_PERIOD,
    REPORT_TIMEOUT,
    SECOND,
)

_FALSE_ALARM: Final = 1e-6
"""The greatest allowed probability that all messages of a lease are lost."""

_JITTER: Final = 100 * MILLISECOND
"""How late messages may be beyond the link's delay, because of both sides' ticks and reordering."""


@dataclass(frozen=True)
class LinkTimes:
    """The times that a fleet on this link tolerates, in ns."""

    lease_ns: int
    """The robot stops this long, by its own clock, after the newest Command was sent."""
    report_timeout_ns: int
    """A robot that is silent for this long is lost."""
    clock_error_ns: int
    """The greatest error of a moving robot's estimate of the coordinator's clock."""


def link_times(link: Link) -> LinkTimes:
    """Return the times for a link's one-way delay [s] and share of loss."""
    delay = round(link.delay * SECOND)
    tries = math.ceil(math.log(_FALSE_ALARM) / math.log(link.loss)) if link.loss > 0.0 else 1
    borne = delay + _JITTER
    clock_error = CLOCK_ERROR + delay
    lease = max(LEASE, tries * COMMAND_PERIOD + borne + clock_error)
    timeout = max(REPORT_TIMEOUT, tries * REPORT_PERIOD + borne)
    return LinkTimes(_whole(lease), _whole(timeout), _whole(clock_error))


def _whole(time_ns: int) -> int:
    """Round up to whole milliseconds, the unit on the wire."""
    return -(-time_ns // MILLISECOND) * MILLISECOND
