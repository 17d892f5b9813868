"""Which robots may join a fleet: what a robot says of itself, compared with what its plan needs.

Decides: which robots to accept, which to refuse and why, and which have to wait until an operator
admits them.  Must not know: the fleet's phases, plans.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from coordinator.fleet.admit_outcome import NOT_BACK
from coordinator.fleet.events import Incident, Outgoing
from coordinator.fleet.member import Member, Place, place_of
from coordinator.fleet.roster import Roster
from coordinator.plan.capacity import Capacity
from protocol import keys
from protocol.codec import encode
from protocol.messages import PROTOCOL_VERSION, Hello, Refusal
from protocol.phases import BRAKING, MOVING, PHASE_NAMES

_REFUSALS_TOLD: Final = 100


class Door:
    """Answers a fleet's Hellos and Admits, and appends what happened to `incidents`."""

    def __init__(self, fleet: str, members: Roster, incidents: list[Incident]) -> None:
        self._fleet = fleet
        self._members = members
        self._incidents = incidents
        self._refused: set[tuple[str, int]] = set()
        self._not_admitted: dict[str, str] = {}
        self.why_not_at: Callable[[str, Place], str] = lambda _robot, _place: ""
        """Says why a robot that has come back cannot stand at a place; "" if it can."""

    def hear(self, robot: str, hello: Hello, begun: bool, now_ns: int) -> Member | Outgoing | None:
        """Return the member that is accepted, or the Refusal to send.

        Return None for a Hello that is not new, and for a robot that has come back after the fleet
        has begun to move: that robot has to wait until an operator admits it.
        """
        known = self._members.get(robot)
        if known is not None and known.has_heard(hello):
            return None
        reason = self._objection(robot, hello, begun, now_ns)
        if reason:
            return self._refuse(robot, hello.boot, reason, now_ns)
        member = self._members[robot]
        if member.boot != hello.boot:
            if begun and not member.is_new:
                self._knock(member, hello, now_ns)
                return None
            self._tell(now_ns, "hello", robot, f"{robot} says hello")
        was_unheard = member.is_unheard(now_ns)
        member.accept(hello, now_ns)
        if was_unheard:
            self.tell_heard_again(member, now_ns)
        return member

    def tell_stranger(self, robot: str, now_ns: int) -> None:
        """Report, once, that a robot which is not in the fleet says hello."""
        if (robot, 0) not in self._refused and len(self._refused) < _REFUSALS_TOLD:
            self._refused.add((robot, 0))
            what = f"{robot} is there and not in fleet {self._fleet}"
            self._tell(now_ns, "back", robot, f"{what}; `splinefleet join {robot} ...` takes it in")

    def tell_heard_again(self, member: Member, now_ns: int) -> None:
        """Report that a lost robot's process is heard again, and what will happen to the robot."""
        text = f"{member.id} is heard again; {_what_becomes_of(member)}"
        self._tell(now_ns, "back", member.id, text)

    def admit(self, robot: str, boot: int, now_ns: int) -> Outgoing | bool:
        """Admit a robot that has come back, as soon as it says where it stands.

        A robot that was lost and is heard again is admitted where it rests on its path.  Return
        whether the robot is admitted, or the Refusal to send if asking again is of no use.  `boot`
        is the boot id in the operator's Admit.
        """
        member = self._members.get(robot)
        if member is None:
            return self._deny(robot, boot, self._unknown(robot), now_ns)
        admission = member.admission
        is_heard = member.boot is not None and member.is_heard(now_ns)
        if is_heard or admission.hello is None or admission.hello.boot == member.boot:
            return self._admit_again(member, boot, is_heard, now_ns)
        if member.is_under_way(now_ns):
            heard = "is still heard" if member.is_heard(now_ns) else "may still be heard"
            self._tell_denied(robot, f"another {robot} {heard}, ask again", now_ns)
            return False
        if not admission.is_at_door(member.timeout_ns, now_ns):
            why = "has come back but is no longer heard; start its program again"
            self._tell_denied(robot, f"{robot} {why}", now_ns)
            return False
        if admission.refuses(boot):
            reason = "did not say where it stands; start its program with its place (agent --at)"
            reason = admission.turned_away or f"{robot} {reason}"
            return self._deny(robot, boot, reason, now_ns)
        admission.ask(boot, now_ns)
        return True

    def _admit_again(
        self, member: Member, boot: int, is_heard: bool, now_ns: int
    ) -> Outgoing | bool:
        """Admit a robot whose process is the accepted one; return the same as `admit`."""
        robot, admission = member.id, member.admission
        if not is_heard:
            return self._deny(robot, boot, f"{robot} {NOT_BACK}: start its program first", now_ns)
        if boot in admission.asked_by or (not member.planned and admission.join(boot)):
            return False  # An earlier request is being carried out.
        if member.planned and not member.is_fit:
            member.struck.clear()  # It goes on from where it stands, and nobody else is stopped.
            self._tell_admitted(robot, now_ns)
            return False
        if member.planned or member.finished or member.stays or member.is_new:
            return self._deny(robot, boot, _why_in_already(member), now_ns)
        if member.rest is None:
            self._tell_denied(robot, f"{robot} has not said where it rests yet, ask again", now_ns)
            return False
        admission.ask(boot, now_ns)
        admission.take_in()
        member.struck.clear()
        self._tell_admitted(robot, now_ns)
        return True

    def _tell_admitted(self, robot: str, now_ns: int) -> None:
        self._not_admitted.pop(robot, None)
        self._tell(now_ns, "admitted", robot, f"{robot} is admitted")

    def _deny(self, robot: str, boot: int, reason: str, now_ns: int) -> Outgoing:
        self._tell_denied(robot, reason, now_ns)
        return Outgoing(keys.plan(self._fleet, robot), encode(Refusal(boot, reason[:200])))

    def _tell_denied(self, robot: str, reason: str, now_ns: int) -> None:
        """Report why a robot is not admitted.

        A program that asks repeats its request; the same reason is reported once.
        """
        known = self._not_admitted.get(robot)
        if known != reason and (known is not None or len(self._not_admitted) < _REFUSALS_TOLD):
            self._not_admitted[robot] = reason
            self._tell(now_ns, "not admitted", robot, reason)

    def _knock(self, member: Member, hello: Hello, now_ns: int) -> None:
        if member.is_older_than_at_door(hello.boot, now_ns):
            return
        known = member.admission.hello
        if known is None or known.boot != hello.boot:
            words = f"{member.id} is back; {_admit(member)} lets it in if it stands where it says"
            self._tell(now_ns, "back", member.id, words)
        place = place_of(hello)
        if member.admission.is_awaited and place is not None:
            if why := self.why_not_at(member.id, place):
                self._turn_away(member, place, why, now_ns)
            else:
                self._tell_admitted(member.id, now_ns)
        member.knock(hello, now_ns)

    def _turn_away(self, member: Member, place: Place, why: str, now_ns: int) -> None:
        """Do not let a robot in that cannot stand where it says; who asks again is told why."""
        x, y, _ = place
        todo = "start its program again with the place where it stands"
        reason = f"{member.id} says that it stands at ({x:.2f}, {y:.2f}), {why}; {todo}"
        member.admission.turn_away(reason)
        self._tell_denied(member.id, reason, now_ns)

    def _refuse(self, robot: str, boot: int, reason: str, now_ns: int) -> Outgoing:
        """Return the Refusal that says why a robot cannot join; report it once as an incident."""
        if (robot, boot) not in self._refused and len(self._refused) < _REFUSALS_TOLD:
            self._refused.add((robot, boot))
            self._tell(now_ns, "refused", robot, reason)
        return Outgoing(keys.plan(self._fleet, robot), encode(Refusal(boot, reason[:200])))

    def _objection(self, robot: str, hello: Hello, begun: bool, now_ns: int) -> str:
        """Return why a robot cannot join, or an empty text if it can.

        Before the fleet begins, a process that has said nothing but Hello gives way to a newer one:
        its Hello may be an old one, put on the wire again.
        """
        member = self._members.get(robot)
        if member is None:
            return self._unknown(robot)
        if hello.version != PROTOCOL_VERSION:
            return (
                f"{robot} speaks protocol version {hello.version}, "
                f"the coordinator speaks {PROTOCOL_VERSION}"
            )
        if hello.radius_m > member.radius + 1e-6:
            return f"{robot} has radius {hello.radius_m} m, the plan was made for {member.radius} m"
        if 0.0 < hello.max_speed_mps < member.speed - 1e-6:
            return f"{robot} reaches {hello.max_speed_mps} m/s, its plan needs {member.speed} m/s"
        if 0.0 < hello.max_accel_mps2 < member.accel - 1e-6:
            needed = (
                f"{member.accel} m/s^2" if member.accel < math.inf else "a robot that stops at once"
            )
            return f"{robot} brakes with {hello.max_accel_mps2} m/s^2, its plan needs {needed}"
        if not begun and (overload := Capacity.of(hello).objection(member.plan)):
            return f"{robot} {overload}"
        has_place = begun or member.sequence >= 0
        if has_place and member.boot not in (None, hello.boot) and member.is_heard(now_ns):
            return f"another {robot} is already in fleet {self._fleet}"
        return ""

    def _unknown(self, robot: str) -> str:
        known = ", ".join(list(self._members)[:10])
        return f"{robot} is not in fleet {self._fleet}, which has {known}"

    def _tell(self, now_ns: int, kind: str, robot: str, text: str) -> None:
        self._incidents.append(Incident(now_ns, kind, robot, text))


def _admit(member: Member) -> str:
    return f"`splinefleet admit {member.id} --connect ...`"


def _what_becomes_of(member: Member) -> str:
    """Return words for what will happen to a robot that was lost and is heard again."""
    if member.finished:
        return "it has arrived"
    if member.planned:
        return "it goes on"
    if member.stays:
        return f"it stays where it is: {member.stays}"
    return f"it waits to be admitted: {_admit(member)}"


def _why_in_already(member: Member) -> str:
    """Return words for why a robot that is heard need not be admitted."""
    if member.is_new:
        return f"{member.id} joins, and need not be admitted"
    if member.phase in (MOVING, BRAKING):
        return f"{member.id} is driving already"
    if member.finished:
        return f"{member.id} has arrived already"
    if member.stays:
        return f"{member.id} stays where it is: {member.stays}"
    return f"{member.id} is in the fleet already, {PHASE_NAMES[member.phase]}"
