"""Sentences that say which robots a fleet waits for or which are held, and why.

Decides: what is reported and when: once a fleet has waited for PATIENCE, and again when the
sentence changes or nobody waits any more, at most once in PATIENCE.  Must not know: consoles, what
the fleet then does.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from coordinator.fleet.core import Fleet
from coordinator.fleet.member import Member
from coordinator.schedule.authority import EVER
from protocol.phases import COMMAND_NAMES, FREEZE, GO, HOLD, IDLE, PHASE_NAMES, fault_name
from protocol.timing import SECOND

PATIENCE: Final = SECOND

_HELD_MS: Final = 2_000
"""A robot that is held for less than this [ms] is not named."""

_NAMED: Final = 10
"""How many robots that are missing for the same reason are named; the others are counted."""

_PLURAL: Final = {"has": "have", "is": "are", "does": "do", "holds": "hold", "its": "their"}
"""The words of a reason that change if it is that of several robots."""


class RollCall:
    """The robots that one fleet waits for; `news` is called after every tick."""

    def __init__(self) -> None:
        self._state = (-1, -1)
        self._due_ns = 0
        self._said = ""

    def news(self, fleet: Fleet, now_ns: int) -> str:
        """Return a sentence about the missing robots; empty if there is nothing new to report."""
        if self._state != (fleet.epoch, fleet.phase):
            self._state = (fleet.epoch, fleet.phase)
            self._due_ns, self._said = now_ns + PATIENCE, ""
        if now_ns < self._due_ns:
            return ""
        missing = missing_in_words(fleet, now_ns)
        if missing == self._said:
            return ""
        self._due_ns, self._said = now_ns + PATIENCE, missing
        if missing:
            return f"{COMMAND_NAMES[fleet.phase]}, waiting for {missing}"
        return "GO, nobody waits any more" if fleet.phase == GO else ""


def missing_in_words(fleet: Fleet, now_ns: int) -> str:
    """Return the missing robots, grouped by reason, as text; empty if none is missing."""
    reasons: dict[str, list[str]] = {}
    for member, why in _missing(fleet, now_ns):
        reasons.setdefault(why, []).append(member.id)
    return "; ".join(
        f"{_list(names)}: {_in_number(why, len(names))}" for why, names in reasons.items()
    )


def _in_number(why: str, robots: int) -> str:
    """Return a reason in the plural if it is that of several robots; who holds them is one."""
    if robots == 1 or why.startswith("held by"):
        return why
    return " ".join(_PLURAL.get(word, word) for word in why.split(" "))


def _missing(fleet: Fleet, now_ns: int) -> Iterable[tuple[Member, str]]:
    now_ms = fleet.times.plan_ms(now_ns)
    for robot, by, since_ms in fleet.held():
        if now_ms - since_ms >= _HELD_MS:
            yield fleet.members[robot], f"held by {by}, which {_state(fleet, by, now_ns)}"
    for member in fleet.members.values():
        if fleet.phase == HOLD and member.planned and not member.is_armed(fleet.epoch, now_ns):
            yield member, _why_not_armed(member, fleet.epoch, now_ns)
        elif fleet.phase == FREEZE and member.admission.is_awaited:
            yield member, "admitted, has not said where it stands"
        elif fleet.phase == FREEZE and member.planned and not (member.lost or member.is_at_rest()):
            yield member, _why_unheard(member, now_ns) or "has not said where it rests"


def _state(fleet: Fleet, robot: str, now_ns: int) -> str:
    """Return words for what keeps a robot that holds others."""
    member = fleet.members[robot]
    if member.has_come_back(now_ns):
        return "waits to be admitted"
    if member.lost:
        return "is not heard"
    ends = fleet.grants.ends
    if ends.limit_of(robot) < EVER and ends.is_at_end(robot):
        return "stands before a closed place"
    return "has stopped" if member.has_stopped(fleet.epoch) else "is late"


def _why_not_armed(member: Member, epoch: int, now_ns: int) -> str:
    """Return words for why a robot that has a part in the epoch is not armed with its plan."""
    unheard = _why_unheard(member, now_ns)
    if unheard:
        return unheard
    if member.fault:
        return f"has said hello but does not arm, {fault_name(member.fault)}"
    if member.epoch != epoch:
        return "has said hello but does not hold its plan yet"
    if member.phase == IDLE:
        return "holds its plan but is not armed yet"
    return f"is {PHASE_NAMES[member.phase]}"


def _why_unheard(member: Member, now_ns: int) -> str:
    """Return words for why a robot is not heard; an empty text if it is heard."""
    if member.boot is None:
        return "has not said hello"
    if member.gone:
        return "has lost its link"
    return "has fallen silent" if member.is_silent(now_ns) else ""


def _list(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
