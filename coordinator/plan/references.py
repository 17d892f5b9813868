"""Which robots the parts of a plan name, and where on their paths.

Decides: whether stops, waits and crossings name robots that the plan has.  Must not know: files, or
what else a plan's values may be (checks.py).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING, Final

from coordinator.plan.checks import LENGTH_TOLERANCE, Range
from protocol.keys import NAME

if TYPE_CHECKING:
    from coordinator.plan.document import PlanDocument, RobotPlan

_WAIT: Final = Range("s", 0.0)


def find_wrong_names(document: PlanDocument) -> list[str]:
    """Return a line for each wrong robot or place that a stop, wait or crossing names.

    The list is empty if an id is not valid or is used twice, because names are ambiguous then;
    checks.py reports the id.
    """
    robots = {robot.id: robot for robot in document.robots if NAME.fullmatch(robot.id)}
    if len(robots) < len(document.robots) or not robots:
        return []
    problems: list[str] = []
    for robot in document.robots:
        where = f"robots[{robot.id}]"
        owners = {f"{where}.start_yields_to": robot.start_yields_to}
        owners |= {f"{where}.stops[{i}].yields_to": s.yields_to for i, s in enumerate(robot.stops)}
        for field, owner in owners.items():
            if owner:
                problems += _name_faults(field, owner, robots, robot.id)
    for index, wait in enumerate(document.waits):
        where = f"waits[{index}]"
        problems += _place_faults(where, "robot", wait.robot, "s", wait.s, robots)
        problems += _name_faults(f"{where}.yields_to", wait.yields_to, robots, wait.robot)
        problems += _WAIT.faults(f"{where}.wait", wait.wait)
    for index, crossing in enumerate(document.crossings):
        where = f"crossings[{index}]"
        problems += _place_faults(where, "a", crossing.a, "s_a", crossing.s_a, robots)
        problems += _place_faults(where, "b", crossing.b, "s_b", crossing.s_b, robots)
    return problems


def _name_faults(field: str, name: str, robots: Collection[str], own: str = "") -> Iterator[str]:
    if name not in robots or name == own:
        allowed = "another robot of the plan" if own else "a robot of the plan"
        yield f"{field}: is {name[:40]!r}, must be {allowed}"


def _place_faults(
    where: str, whose: str, name: str, at: str, s: float, robots: Mapping[str, RobotPlan]
) -> Iterator[str]:
    """Yield what is wrong with a robot's name and an arc length s [m] on its path."""
    yield from _name_faults(f"{where}.{whose}", name, robots)
    if name in robots:
        farthest = robots[name].length + LENGTH_TOLERANCE
        yield from Range("m", 0.0, farthest).faults(f"{where}.{at}", s)
