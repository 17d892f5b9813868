"""All members of a fleet: which have a part in the epoch, are missing, or have arrived.

Decides: what holds for the members together.  Must not know: the fleet's phases, what is sent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from coordinator.fleet.events import Part
from coordinator.fleet.member import Member
from coordinator.fleet.rest_places import Standing
from coordinator.fleet.sent_courses import Span
from protocol.phases import FREEZE, FROZEN, GO, IDLE


class Roster(dict[str, Member]):
    """The members by name."""

    def __init__(self, members: Iterable[Member]) -> None:
        super().__init__((member.id, member) for member in members)

    @property
    def planned(self) -> list[Member]:
        """The members that have a part in this epoch."""
        return [member for member in self.values() if member.planned]

    @property
    def has_arrived(self) -> bool:
        """Whether every robot has reached its goal."""
        return all(member.finished for member in self.values())

    def is_unheard(self) -> bool:
        """Return whether all robots under way are silent although no link is known to be gone."""
        under_way = [member for member in self.planned if not member.finished]
        return bool(under_way) and all(one.lost and not one.gone for one in under_way)

    def has_told(self, has_gone: bool) -> bool:
        """Return whether each robot with a part either is lost or has said where it rests.

        In an epoch that has not started to drive, no robot needs to say it, except one that was
        just admitted.
        """
        if any(member.admission.is_awaited for member in self.values()):
            return False
        return not has_gone or all(m.lost or m.is_at_rest() for m in self.planned)

    def unarmed(self, epoch: int, now_ns: int) -> list[str]:
        """Return the ids of the robots that have a part and are not armed."""
        return [m.id for m in self.planned if not m.is_armed(epoch, now_ns)]

    def wanted(self, phase: int) -> list[str]:
        """Return the ids of the robots to ask where they rest in a phase of the fleet.

        Robots that have a part in the epoch are among them while the fleet is frozen, and in GO if
        they have stopped, or have come back and are to be admitted.
        """
        asked = {FREEZE: (FROZEN, IDLE), GO: (FROZEN,)}.get(phase, ())
        return [
            m.id
            for m in self.values()
            if m.admission.is_awaited
            or (m.phase in (asked if m.planned else (FROZEN, IDLE)) and not m.is_at_rest())
        ]

    def assign(self, parts: Mapping[str, Part], epoch: int) -> None:
        """Give these robots their parts in a new epoch.

        The others get no part.  From now on any place of rest that they report is accepted, because
        no message that they sent before they last set out is still under way.
        """
        for member in self.values():
            member.planned = member.id in parts
            if member.planned:
                member.take_part(parts[member.id].plan, parts[member.id].speed, epoch)
            else:
                member.sent_epoch = 0
                member.admission.end()

    def standings(
        self, epoch: int, spans: Callable[[str], list[Span]], now_ns: int
    ) -> list[Standing]:
        """Return the standings of all robots that have a part or have said where they rest.

        `spans` returns the parts of its courses on which a robot may stand that has not said where.
        """
        return [
            member.standing(epoch, spans(member.id), now_ns)
            for member in self.values()
            if member.planned or member.finished or member.rest is not None
        ]
