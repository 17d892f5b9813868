"""News of robots that others go on without, for people: where they stand, and what to do.

Decides: which of these robots are worth a sentence, and how it is worded.  Must not know: how it is
shown.
"""

from __future__ import annotations

from coordinator.fleet.member import WITHOUT
from coordinator.mission.mission import Mission


class AsideNews:
    """Tells each reason for which a robot is left aside once; `speed`: of the fleet's clock."""

    def __init__(self, speed: float = 1.0) -> None:
        self._speed = "" if speed == 1.0 else f" --speed {speed:g}"
        self._told: dict[str, str] = {}
        self._lost: set[str] = set()

    def news(self, mission: Mission, now_ns: int) -> list[tuple[str, str]]:
        """Return the robots that were left aside since the last call, each with a sentence."""
        members = mission.fleet.members
        obstructions = mission.dispatcher.obstructions
        lost, known = set(obstructions.lost()), self._lost
        self._lost = lost
        found = []
        for robot in sorted(lost - known):
            to_do = self._to_do(robot, "lost", members[robot].has_come_back(now_ns))
            found.append((robot, f"{robot} {obstructions.aside(robot)}: {to_do}"))
        for one in mission.site.aside:
            robot, why = one.robot.id, one.why
            is_told = bool(members[robot].stays) or self._told.get(robot) == why
            if why in WITHOUT and not is_told:  # The plan itself says what closes a robot in.
                text = (
                    f"{robot} has no part in the next epoch: {WITHOUT[why]}. It {one}: "
                    f"{self._to_do(robot, why, members[robot].has_come_back(now_ns))}"
                )
                found.append((robot, text))
        self._told = {one.robot.id: one.why for one in mission.site.aside}
        return found

    def _to_do(self, robot: str, why: str, is_back: bool) -> str:
        """Return what a person can do about a robot that is left aside.

        `is_back`: whether its program was started again, and waits to be admitted.
        """
        admit = f"`splinefleet admit {robot} --connect ...`"
        if why != "lost":
            return f"see to it, then {admit}"
        start = f"`splinefleet agent {robot} --at X Y HEADING{self._speed} --connect ...`"
        first = "" if is_back else f"start its program there ({start}) and "
        carry = f"carry it away and `splinefleet leave {robot} --connect ...`"
        return f"{first}{admit}, or {carry}"
