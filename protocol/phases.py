"""The numbers for phases and faults on the wire.

Plain integers and no imports: the robot's firmware reads this file too.
"""

# The phase that the coordinator states in a Command.
HOLD = 0
GO = 1
FREEZE = 2
OVER = 3  # every robot that can arrive has arrived; the agents may end
STOP = 4  # robots brake at once, keep their plans, and go on with the next GO
COMMAND_NAMES = ("HOLD", "GO", "FREEZE", "OVER", "STOP")

# The phase that a robot states in a Report.
IDLE = 0  # holds no plan
ARMED = 1  # holds a valid plan, stands at its start, knows the time
MOVING = 2  # follows its plan, which includes standing at its stops and for others
BRAKING = 3
FROZEN = 4  # at rest off its timetable; moves again only in a new epoch
DONE = 5  # at its goal
PHASE_NAMES = ("idle", "armed", "moving", "braking", "frozen", "done")

# Why a robot brakes or does not arm.
NO_FAULT = 0
OFF_PATH = 1
DRIVER_ERROR = 2
CLOCK_UNSURE = 3
BAD_PLAN = 4
FAULT_NAMES = (
    "none",
    "off its path",
    "driver error",
    "clock not certain",
    "plan not acceptable",
)


def fault_name(fault: int) -> str:
    """Return a fault's name; a newer robot may report faults that have no name here."""
    return FAULT_NAMES[fault] if fault < len(FAULT_NAMES) else "fault " + str(fault)
