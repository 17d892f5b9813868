"""The periods and leases both sides count on, in nanoseconds.

Decides: how often each side speaks and how long it bears silence.  The fault budget
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
"""A moving robot whose clock offset is less certain than this stops."""

CLOCK_RESERVE = 2 * MILLISECOND
"""A robot arms only with this much more certainty than it needs later: clocks drift."""

CLOCK_PERIOD_FAST = 40 * MILLISECOND
CLOCK_PERIOD = 2 * SECOND
CLOCK_SAMPLES = 8


def late_share(tau_ns: int) -> int:
    """Return how late [ns] a robot may run before it faults: its share of tau."""
    return min(LATENESS, tau_ns // 2)
