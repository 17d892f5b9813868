"""The periods on which both sides rely, in nanoseconds.

Decides: how often each side sends, and how long a silence it tolerates.  "auto" for tau
(coordinator/plan/shares_of_tau.py) is a sum of these.  No imports: the robot's firmware reads this
file too.
"""

MILLISECOND = 1_000_000
SECOND = 1_000_000_000

COMMAND_PERIOD = 100 * MILLISECOND
REPORT_PERIOD = 200 * MILLISECOND
HELLO_PERIOD = 200 * MILLISECOND

LATENESS = 100 * MILLISECOND
"""How late a robot is that keeps to its plan as well as it can; tau "auto" allows for this."""

LATE_STEP_MS = 50
"""Lateness is reported in steps of this [ms], rounded up."""

REPORT_TIMEOUT = 1 * SECOND
"""A robot that has not been heard for this long counts as lost, and it is named to people."""

COORDINATOR_TIMEOUT = 2 * SECOND
"""A robot at rest that has not heard its coordinator for this long may obey another one."""

CLOCK_ERROR = 10 * MILLISECOND
"""A robot sets out only when the error of its clock offset is less than this."""

CLOCK_RESERVE = 2 * MILLISECOND
"""A robot arms only if its clock error is this far below the limit, because clocks drift."""

CLOCK_PERIOD_FAST = 40 * MILLISECOND
CLOCK_PERIOD = 2 * SECOND
CLOCK_SAMPLES = 8
