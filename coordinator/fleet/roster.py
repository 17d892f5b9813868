"""Everybody in the fleet: who has a part in the epoch, who is missing, who has arrived.

Decides: what is true of the members together.  Must not know: the fleet's phases, what is sent.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from coordinator.fleet.events import Part
from coordinator.fleet.member import Member
from coordinator.fleet.own_outage import AWAY
from coordinator.fleet.rest_places import Standing
from protocol.phases import FROZEN, IDLE


class Roster(dict[str, Member]):
    """The members by name."""

    def __init__(self, members: Iterable[Member]) -> None:
        super().__init__((member.id, member) for member in members)

    @property
    def planned(self) -> list[Member]:
        """Those that have a part in this epoch."""
        return [member for member in self.values() if member.planned]

    @property
    def has_arrived(self) -> bool:
        """Tell whether every robot has been at its goal."""
        return all(member.finished for member in self.values())

    def is_unheard(self) -> bool:
        """Tell whether all that are under way have fallen silent, though no link is known gone."""
        under_way = [member for member in self.planned if not member.finished]
        return bool(under_way) and all(one.lost and not one.gone for one in under_way)

    def has_told(self, has_gone: bool) -> bool:
        """Tell whether of all that have a part it is known where they rest, or they are lost.

        In an epoch that has not gone it is; those that were just admitted have to say it.
        """
        if any(member.admission.is_awaited for member in self.values()):
            return False
        return not has_gone or all(m.lost or m.is_at_rest() for m in self.planned)

    def unarmed(self, epoch: int, now_ns: int) -> list[str]:
        """Name those that have a part and are not armed."""
        return [m.id for m in self.planned if not m.is_armed(epoch, now_ns)]

    def wanted(self, everybody: bool) -> list[str]:
        """Name those to ask where they rest: all, or those that have no part."""
        return [
            m.id
            for m in self.values()
            if (everybody or not m.planned) and m.phase in (FROZEN, IDLE) and not m.is_at_rest()
        ]

    def assign(self, parts: Mapping[str, Part]) -> None:
        """Give these robots their parts in a new epoch.

        The others have none, and are believed wherever they say that they rest: nothing that they
        said before they last set out is under way any more.
        """
        for member in self.values():
            member.planned = member.id in parts
            if member.planned:
                member.take_part(parts[member.id].plan, parts[member.id].speed)
            else:
                member.sent_epoch = 0
                member.admission.end()

    def standings(self, epoch: int, zero_ns: int, until_ns: int, has_gone: bool) -> list[Standing]:
        """Return where those stand that have a part in the epoch, or none but have spoken since.

        Plan time counts from `zero_ns`.  One that has not said where it rests has moved on since it
        last kept to its plan, until `until_ns`; what it said may have waited for a coordinator that
        was away unnoticed.  Nobody has moved in an epoch that has not gone.
        """
        found = []
        for member in self.values():
            if member.planned or member.rest is not None:
                since, until = member.kept_ns - AWAY - zero_ns, until_ns - zero_ns
                if not has_gone:
                    since = until = 0
                found.append(member.standing(epoch, since, until))
        return found
