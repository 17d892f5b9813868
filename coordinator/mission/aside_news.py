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

    def news(self, mission: Mission) -> list[tuple[str, str]]:
        """Return the robots that were left aside since the last call, each with a sentence."""
        obstructions = mission.dispatcher.obstructions
        lost, known = set(obstructions.lost()), self._lost
        self._lost = lost
        found = [
            (robot, f"{robot} {obstructions.aside(robot)}: {self._to_do(robot, 'lost')}")
            for robot in sorted(lost - known)
        ]
        for one in mission.site.aside:
            robot, why = one.robot.id, one.why
            is_told = bool(mission.fleet.members[robot].stays) or self._told.get(robot) == why
            if why in WITHOUT and not is_told:  # The plan itself says what closes a robot in.
                text = (
                    f"{robot} has no part in the next epoch: {WITHOUT[why]}. It {one}: "
                    f"{self._to_do(robot, why)}"
                )
                found.append((robot, text))
        self._told = {one.robot.id: one.why for one in mission.site.aside}
        return found

    def _to_do(self, robot: str, why: str) -> str:
        """Return what a person can do about a robot that is left aside."""
        admit = f"`splinefleet admit {robot} --connect ...`"
        if why != "lost":
            return f"see to it, then {admit}"
        start = f"`splinefleet agent {robot} --at X Y HEADING{self._speed} --connect ...`"
        carry = f"carry it away and `splinefleet leave {robot} --connect ...`"
        return f"start its program there ({start}) and {admit}, or {carry}"
