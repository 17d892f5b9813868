"""The alarms of a coordinator's terminal: what calls a person on the desk calls it here, too.

Decides: how the facts that call a person are read from the fleet core.  Must not know: what calls a
person (desk/alarms.py), how it is shown.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from coordinator.desk.alarms import Alarms
from coordinator.desk.answers import Alarm, RobotState
from coordinator.desk.known_fleet import CARRIED_S
from coordinator.fleet.core import Fleet
from coordinator.fleet.member import Member, place_of
from coordinator.fleet.task import LEAVE
from protocol.messages import ORDER_DONE, OrderState
from protocol.phases import HOLD, IDLE, NO_FAULT, OVER, PHASE_NAMES, fault_name
from protocol.timing import REPORT_TIMEOUT, SECOND

_PERIOD: Final = SECOND // 2
"""What an alarm says is told if it said the same so long [ns] before: a robot that has just fallen
silent may still be told to drive a little farther."""


class AlarmBell:
    """Tells alarms when they begin, say something else, and are over.

    `told`: how many of the fleet's incidents are known already.
    """

    def __init__(self, told: int = 0) -> None:
        self._alarms = Alarms()
        self._seen: dict[str, Alarm] = {}
        self._rung: dict[str, Alarm] = {}
        self._told = told
        self._carried_ns: dict[str, int] = {}
        """By robot that was taken out: from when on it may not be heard."""

        self._due_ns = 0

    def news(self, fleet: Fleet, now_ns: int, day_s: float) -> Iterator[tuple[Alarm, str]]:
        """Yield the alarms that are new or over since the last call, each with a line for people.

        `day_s`: the time [s] since 1970.
        """
        for incident in fleet.incidents[self._told :]:
            if incident.order is not None:
                self._alarms.take_order(incident.order, day_s)
                self._take_leave(incident.order, incident.now_ns)
            elif incident.kind == "admitted":
                self._alarms.admitted(incident.robot)
            elif incident.kind == "log":
                self._alarms.log_failed(incident.text, day_s)
        self._told = len(fleet.incidents)
        if now_ns < self._due_ns or fleet.phase == OVER:
            return
        self._due_ns = now_ns + _PERIOD
        orders = {one.robot: one.order.id for one in fleet.orders.under_way()}
        robots = [
            _state_of(fleet, one, orders.get(one.id, ""), now_ns) for one in fleet.members.values()
        ]
        outside = [
            name
            for name, at_ns in fleet.outside_ns.items()
            if at_ns > self._carried_ns.get(name, 0)
            and now_ns - at_ns < REPORT_TIMEOUT
            and name not in fleet.members
        ]
        arms, is_cut = fleet.phase == HOLD, fleet.is_cut_off
        self._alarms.look(True, robots, day_s, outside, arms=arms, is_cut=is_cut)
        seen, self._seen = self._seen, {one.id: one for one in self._alarms.now()}
        for name, one in self._seen.items():
            is_settled = name in seen and seen[name].text == one.text
            if is_settled and (name not in self._rung or self._rung[name].text != one.text):
                self._rung[name] = one
                yield one, f"{one.text}. {one.todo}"
        for name in self._rung.keys() - self._seen.keys():
            over = self._rung.pop(name)
            yield over, f"over: {over.text}"

    def _take_leave(self, state: OrderState, now_ns: int) -> None:
        """Take in when a robot was taken out: one that was heard then may be, for a while."""
        if state.id == f"{LEAVE}{state.robot}" and state.state == ORDER_DONE:
            is_heard = not state.reason
            self._carried_ns[state.robot] = now_ns + round(CARRIED_S * SECOND) * is_heard


def _state_of(fleet: Fleet, member: Member, order: str, now_ns: int) -> RobotState:
    """Return a robot as the alarms look at it: one that has come back is heard, and idle."""
    if member.has_come_back(now_ns):
        hello = member.admission.hello
        return RobotState(
            id=member.id,
            phase=PHASE_NAMES[IDLE],
            age=0.0,
            is_heard=True,
            is_back=True,
            place=None if hello is None else place_of(hello),
        )
    is_heard = not member.is_silent(now_ns)
    is_awaited = member.boot is None and fleet.phase == HOLD
    return RobotState(
        id=member.id,
        phase=PHASE_NAMES[member.phase],
        fault="" if member.fault == NO_FAULT else fault_name(member.fault),
        age=None if member.boot is None else (now_ns - member.heard_ns) / SECOND,
        is_heard=is_heard,
        order=order,
        stretch=[] if is_heard or is_awaited else _stretch(fleet, member.id),
    )


def _stretch(fleet: Fleet, robot: str) -> list[tuple[float, float]]:
    """Return the ends [m] of where a robot may stand on its course; none if it has no course."""
    mine = fleet.grants.of(robot)
    if mine is None or mine.now.course is None:
        return []
    driven, (span, *_) = mine.now.course.driven, fleet.spans(robot)
    times = (0.001 * span.since_ms, 0.001 * span.until_ms)
    places = driven.curve.at_arc([driven.timeline.s_at(time) for time in times]).tolist()
    return [(x, y) for x, y in places]
