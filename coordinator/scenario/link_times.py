"""How long silence is borne on a link that loses and delays messages.

Decides: the leases of both sides and the clock error, from the link's figures; a good link has
those of protocol/timing.py.  Half of an exchange that takes the delay both ways is the delay: every
exchange tells the time well enough.  Must not know: robots, plans.
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
"""How likely it may be that all messages of a lease are lost."""

_JITTER: Final = 100 * MILLISECOND
"""What messages may be late beyond the link's delay: the ticks of both sides, overtaking."""


@dataclass(frozen=True)
class LinkTimes:
    """What a fleet on this link bears, in ns."""

    lease_ns: int
    """So long after the newest Command was said, by the robot's clock, it stops."""
    report_timeout_ns: int
    """Silence of a robot that makes it lost."""
    clock_error_ns: int
    """How uncertain a moving robot may be of the coordinator's clock."""


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
    """Round up to milliseconds, as the wire has them."""
    return -(-time_ns // MILLISECOND) * MILLISECOND
