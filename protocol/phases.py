"""The numbers for phases and faults on the wire.

Plain integers and no imports: the robot's firmware reads this file too.
"""

# The phase that the coordinator states in a Command.
HOLD = 0
GO = 1
FREEZE = 2
OVER = 3  # every robot that can arrive has arrived; the agents may end
COMMAND_NAMES = ("HOLD", "GO", "FREEZE", "OVER")

# The phase that a robot states in a Report.
IDLE = 0  # holds no plan
ARMED = 1  # holds a valid plan, stands at its start, knows the time
MOVING = 2  # follows its plan, which includes standing at its stops
BRAKING = 3
FROZEN = 4  # at rest off its timetable; moves again only in a new epoch
DONE = 5  # at its goal
PHASE_NAMES = ("idle", "armed", "moving", "braking", "frozen", "done")

# Why a robot brakes or does not arm.
NO_FAULT = 0
LEASE_OUT = 1  # did not hear the coordinator
OFF_PATH = 2
LATE = 3
DRIVER_ERROR = 4
CLOCK_UNSURE = 5
BAD_PLAN = 6
FAULT_NAMES = (
    "none",
    "did not hear the coordinator",
    "off its path",
    "behind its plan",
    "driver error",
    "clock not certain",
    "plan not acceptable",
)


def fault_name(fault: int) -> str:
    """Return a fault's name; a newer robot may report faults that have no name here."""
    return FAULT_NAMES[fault] if fault < len(FAULT_NAMES) else "fault " + str(fault)
