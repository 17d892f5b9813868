"""What needs a person: since when, what it is about, and what to do.

Decides: what calls a person, and when an alarm is over.  Must not know: links, HTTP, how an alarm
looks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import msgspec

from coordinator.desk.answers import Alarm, RobotState
from coordinator.fleet.task import JOIN
from coordinator.scenario.order_checks import OWN
from protocol.messages import REFUSED, WAITING, OrderState
from protocol.phases import IDLE, PHASE_NAMES

_LOST: Final = (
    "Walk in only while the fleet is stopped. It may not hear STOP: keep away until you see it "
    "stand, and switch it off before you touch it. Start its program where it stands and admit it; "
    "or carry it away and take it out. Others keep away from where it may stand."
)
_BACK: Final = (
    "Walk in only while the fleet is stopped. Admit it if it stands where its program says; "
    "or carry it away and take it out."
)
_FAULTS: Final = {
    "off its path": "Clear its way; a fleet that takes orders sends it on by itself.",
    "driver error": "Look at its motors and driver; restart its program, then admit it.",
    "clock not certain": "Look at its link: the answers to its questions for the time come late.",
    "plan not acceptable": "Its limits are not the scenario's; the coordinator's output says how.",
}

_AWAY: Final = {
    "coordinator": (
        "the coordinator is not heard",
        "See whether it runs; start it again with --resume and its log.",
    ),
    "router": (
        "the router is gone",
        "Start it again; robots need nothing, and go on when it is back.",
    ),
}
"""Without whom the whole fleet stands: what is wrong, and what to do."""

_OUTSIDE: Final = (
    "Walk in only while the fleet is stopped: nobody keeps away from it. Switch it off and carry "
    "it away; or join it where it stands."
)

_OFTEN: Final = 3
_LATELY: Final = 600.0
"""A robot that was not heard so often in so long [s] needs a person, although it is heard again."""

_OFTEN_TODO: Final = "Look at its link: its radio, its power, the network where it drives."

_LONG: Final = 60.0
"""An order that waits for longer than this [s] although robots are free needs a person."""

_LOG: Final = "log"
_LOG_TODO: Final = "Free its disk, and start the coordinator again with --resume and its log."


class Alarms:
    """The alarms of one fleet: each stands until it is over or, if it cannot be, acknowledged."""

    def __init__(self) -> None:
        self._now: dict[str, Alarm] = {}
        self._waits: dict[str, tuple[OrderState, float]] = {}
        """The orders that wait, each with since when [s]."""

        self._losses: dict[str, list[float]] = {}
        """By robot: when [s] it was lost lately."""

    def now(self) -> list[Alarm]:
        """Return the alarms; those that nobody has acknowledged first, the newest first."""
        return sorted(self._now.values(), key=lambda one: (one.is_acknowledged, -one.since))

    def acknowledge(self, name: str) -> bool:
        """Mark an alarm as seen; one that cannot be over by itself goes.  False if it is none."""
        alarm = self._now.get(name)
        if alarm is None:
            return False
        if alarm.is_lasting and name != _LOG:
            del self._now[name]
        else:
            self._now[name] = msgspec.structs.replace(alarm, is_acknowledged=True)
        return True

    def take_order(self, state: OrderState, now: float) -> None:
        """Take in what has become of an order; `now` [s] since 1970."""
        if state.state == WAITING:
            _, since = self._waits.get(state.id, (state, now))
            self._waits[state.id] = (state, since)
            return
        self._waits.pop(state.id, None)
        is_asked = state.id.startswith(JOIN) or not state.id.startswith(OWN)
        if state.state == REFUSED and is_asked:
            self._refuse(state, now)

    def refusal_told(self, order: str) -> None:
        """Take in that whoever gave an order was told that it is refused."""
        self._now.pop(_refusal(order), None)

    def _refuse(self, state: OrderState, now: float) -> None:
        text = f"{_named(state)} is refused: {state.reason}"
        todo = "Give another goal, or another robot."
        if state.id.startswith(JOIN):
            text = f"{state.id.removeprefix(JOIN)} does not join: {state.reason}"
            todo = "Join it at another place, or when others are out of its way."
        name = _refusal(state.id)
        self._now[name] = Alarm(
            id=name,
            since=now,
            text=text,
            todo=todo,
            robot=state.robot,
            order=state.id,
            is_lasting=True,
        )

    def forget(self, robot: str) -> None:
        """Forget what is about a robot, but for its orders."""
        about = [name for name, one in self._now.items() if one.robot == robot and not one.order]
        for name in about:
            del self._now[name]
        self._losses.pop(robot, None)

    def admitted(self, robot: str) -> None:
        """Take in that a robot has got a course: it may report so later, and may rest on it."""
        self._now.pop(f"lost-{robot}", None)
        self._now.pop(f"back-{robot}", None)

    def log_failed(self, text: str, now: float) -> None:
        """Take in that the coordinator cannot write its log any more."""
        self._now[_LOG] = Alarm(id=_LOG, since=now, text=text, todo=_LOG_TODO, is_lasting=True)

    def look(
        self,
        is_heard: bool,
        robots: Sequence[RobotState],
        now: float,
        outside: Iterable[str] = (),
        *,
        arms: bool = False,
        is_cut: bool = False,
    ) -> None:
        """Find out what needs a person now; while no coordinator is heard, that alone does.

        `outside`: robots that were taken out, and are heard still.  `arms`: whether the fleet has
        yet to set out, so that robots without a course get one by themselves.  `is_cut`: whether
        the coordinator cannot reach its router, so that robots need nothing for not being heard.
        """
        found = [] if is_heard else [_away("coordinator", now)]
        if is_heard:
            found = [alarm for one in robots if (alarm := self._about(one, now, arms)) is not None]
            if is_cut:
                found = [_away("router", now), *(one for one in found if one.id in self._now)]
            idle = {one.id for one in robots if one.rests and not one.order}
            waiting = [one for one, since in self._waits.values() if now - since > _LONG]
            could = [one for one in waiting if (one.robot in idle if one.robot else idle)]
            found += [_stuck(one, now) for one in could]
            found += [_outside(name, now) for name in outside]
        lasting = {one.id: one for one in self._now.values() if one.is_lasting}
        for one in found:
            before = self._now.get(one.id)
            if before is not None and before.todo == one.todo:
                one = msgspec.structs.replace(
                    one, since=before.since, is_acknowledged=before.is_acknowledged
                )
            elif one.id == f"lost-{one.robot}":
                self._losses.setdefault(one.robot, []).append(now)
            lasting[one.id] = one
        self._now = lasting

    def _about(self, robot: RobotState, now: float, arms: bool) -> Alarm | None:
        """Return the alarm about a robot; None if it needs nobody."""
        back = f"back-{robot.id}"
        was_lost = f"lost-{robot.id}" in self._now or back in self._now
        is_idle = robot.phase == PHASE_NAMES[IDLE] and not arms
        is_back = robot.is_back or (was_lost and is_idle)
        if is_back and robot.is_heard:
            text = f"{robot.id} is back{_where(robot)} and has no course"
            return Alarm(id=back, since=now, text=text, todo=_BACK, robot=robot.id)
        return _trouble_of(robot, now) or self._often_lost(robot.id, now)

    def _often_lost(self, robot: str, now: float) -> Alarm | None:
        """Return the alarm about a robot that is heard, but was lost often; None if it was not."""
        losses = [at for at in self._losses.get(robot, ()) if now - at < _LATELY]
        self._losses[robot] = losses
        if len(losses) < _OFTEN:
            return None
        text = f"{robot} was not heard {len(losses)} times in ten minutes"
        return Alarm(id=f"often-{robot}", since=losses[0], text=text, todo=_OFTEN_TODO, robot=robot)


def _refusal(order: str) -> str:
    return f"refused-{order}"


def _where(robot: RobotState) -> str:
    if robot.place is None:
        return ""
    x, y, _ = robot.place
    return f" at ({x:.1f}, {y:.1f})"


def _named(order: OrderState) -> str:
    return order.id if order.id.startswith("order") else f"order {order.id}"


def _stuck(order: OrderState, now: float) -> Alarm:
    who = f"{order.robot} is" if order.robot else "robots are"
    return Alarm(
        id=f"waits-{order.id}",
        since=now,
        text=f"{_named(order)} waits although {who} free: {order.reason or 'no way is found'}",
        todo="Clear its way, or take it back.",
        robot=order.robot,
        order=order.id,
    )


def _outside(robot: str, now: float) -> Alarm:
    text = f"{robot} was taken out, but is heard: it may be on the floor"
    return Alarm(id=f"outside-{robot}", since=now, text=text, todo=_OUTSIDE, robot=robot)


def _away(name: str, now: float) -> Alarm:
    text, todo = _AWAY[name]
    text += ": robots stand where their authority ends"
    return Alarm(id=name, since=now, text=text, todo=todo)


def _trouble_of(robot: RobotState, now: float) -> Alarm | None:
    """Return the alarm about what a robot says or that it is not heard; None if it needs nobody."""
    if robot.age is None and not robot.stretch:
        return None
    if not robot.is_heard:
        text = f"{robot.id} is not heard"
        if robot.stretch:
            first, last = (f"({x:.1f}, {y:.1f})" for x, y in (robot.stretch[0], robot.stretch[-1]))
            text += (
                f". By its course it stands at {last}"
                if first == last
                else f". By its course it stands, or will stop, between {first} and {last}"
            )
        return Alarm(
            id=f"lost-{robot.id}",
            since=now - (robot.age or 0.0),
            text=text,
            todo=_LOST,
            robot=robot.id,
        )
    if robot.fault and not (robot.phase == "idle" and robot.fault == "clock not certain"):
        todo = _FAULTS.get(robot.fault, "Its own output says what is wrong.")
        text = (
            f"{robot.id} stands: {robot.fault}"
            if robot.phase == "frozen"
            else (f"{robot.id}: {robot.fault}")
        )
        return Alarm(id=f"fault-{robot.id}", since=now, text=text, todo=todo, robot=robot.id)
    return None
