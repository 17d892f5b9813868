"""News of robots that have no part in a new epoch, for people.

Decides: which of these robots are worth a sentence, and how it is worded.  Must not know: how it is
shown.
"""

from __future__ import annotations

from coordinator.fleet.member import WITHOUT
from coordinator.mission.mission import Mission


class AsideNews:
    """Tells each reason for which a robot is left aside once."""

    def __init__(self) -> None:
        self._told: dict[str, str] = {}

    def news(self, mission: Mission) -> list[tuple[str, str]]:
        """Return the robots that were left aside since the last call, each with a sentence."""
        found = []
        for one in mission.site.aside:
            robot, why = one.robot.id, one.why
            is_told = bool(mission.fleet.members[robot].stays) or self._told.get(robot) == why
            if why in WITHOUT and not is_told:  # The plan itself says what closes a robot in.
                text = (
                    f"{robot} has no part in the next epoch: {WITHOUT[why]}. It {one}: "
                    f"clear it, then `splinefleet admit {robot} --connect ...`"
                )
                found.append((robot, text))
        self._told = {one.robot.id: one.why for one in mission.site.aside}
        return found
