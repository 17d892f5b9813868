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
"""A robot that has not heard a Command for this long brakes."""

REPORT_TIMEOUT = 500 * MILLISECOND
"""A moving robot that has not been heard for this long is lost."""

LATENESS = 250 * MILLISECOND
"""How far behind its plan a healthy robot may run (its share of tau)."""

CLOCK_ERROR = 10 * MILLISECOND
"""A moving robot stops when the error of its clock offset may be greater than this."""

CLOCK_RESERVE = 2 * MILLISECOND
"""A robot arms only if its error is this far below what it may be later, because clocks drift."""

CLOCK_PERIOD_FAST = 40 * MILLISECOND
CLOCK_PERIOD = 2 * SECOND
CLOCK_SAMPLES = 8


def late_share(tau_ns: int) -> int:
    """Return how late [ns] a robot may be before that is a fault: its share of tau."""
    return min(LATENESS, tau_ns // 2)
