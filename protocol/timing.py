"""The periods and leases on which both sides rely, in nanoseconds.

Decides: how often each side sends, and how long a silence it tolerates.  The fault budget
(coordinator/plan/fault_budget.py) is the sum of these.  No imports: the robot's firmware reads this
file too.
"""

MILLISECOND = 1_000_000
SECOND = 1_000_000_000

COMMAND_PERIOD = 100 * MILLISECOND
REPORT_PERIOD = 200 * MILLISECOND
HELLO_PERIOD = 200 * MILLISECOND

LEASE = 600 * MILLISECOND
"""A robot brakes this long after its newest Command was sent."""

REPORT_TIMEOUT = 500 * MILLISECOND
"""A moving robot that has not been heard for this long is lost."""

LATENESS = 250 * MILLISECOND
"""The greatest share of lateness: how far behind its plan a robot may be."""

CLOCK_ERROR = 10 * MILLISECOND
"""A moving robot stops when the error of its clock offset may be greater than this."""

CLOCK_RESERVE = 2 * MILLISECOND
"""A robot arms only if its clock error is this far below the limit for moving robots, because
clocks drift."""

CLOCK_PERIOD_FAST = 40 * MILLISECOND
CLOCK_PERIOD = 2 * SECOND
CLOCK_SAMPLES = 8


LATE_STEP_MS = 50
"""Lateness is reported in steps of this [ms], rounded up."""


def late_share(tau_ns: int) -> int:
    """Return a robot's share of lateness [ns]: how late it may be before that is a fault."""
    return min(LATENESS, tau_ns // 2)
