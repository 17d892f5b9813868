"""The state of a fleet core: phase, epoch, members and times, and how they change.

Decides: how the phase changes, what the router's link means for it, and what a Command contains.
Must not know: what is heard, when the time is looked at (core.py).
"""

from __future__ import annotations

from typing import Final, Self

import msgspec

from coordinator.fleet.epoch_times import EpochTimes, PlainTimes
from coordinator.fleet.events import Incident, Outgoing
from coordinator.fleet.failures import Failing, silent
from coordinator.fleet.grants import Grants, PlainGrants, Stated
from coordinator.fleet.member import Member
from coordinator.fleet.orders import OrderBook, PlainBook
from coordinator.fleet.phases import FAREWELLS, RESUME_PATIENCE, TRANSITIONS, Event
from coordinator.fleet.rest_places import Standing
from coordinator.fleet.roster import Roster
from coordinator.fleet.router_link import RouterLink
from coordinator.fleet.sent_courses import Span
from coordinator.fleet.standstills import Held
from protocol import keys
from protocol.codec import encode
from protocol.messages import (
    MOST_WANTED,
    ORDER_STATES,
    UNDER_WAY,
    WAITING,
    Block,
    Command,
    OrderState,
)
from protocol.phases import COMMAND_NAMES, FREEZE, GO, HOLD, OVER, STOP
from protocol.timing import COMMAND_PERIOD, MILLISECOND, REPORT_TIMEOUT

_KEPT: Final = (
    "_changed_ns",
    "_farewells",
    "_first_go_ns",
    "_looked_ns",
    "_patient_until_ns",
    "_sequence",
    "_stopped_ns",
    "_unheard_since_ns",
    "_waits_since_ns",
    "allowed_ms",
    "bad_messages",
    "epoch",
    "first_epoch",
    "is_ending",
    "is_resumed",
    "is_to_stop",
    "phase",
    "run",
    "superseded",
    "term",
)
"""The numbers of a fleet's state."""


class PlainFleet(msgspec.Struct, frozen=True, omit_defaults=True):
    """A fleet core as plain data, for a checkpoint; `numbers` are those of _KEPT."""

    name: str
    boot: int
    members: list[Member]
    times: PlainTimes
    grants: PlainGrants
    orders: PlainBook
    router_up: bool | None
    blocks: list[Block]
    numbers: dict[str, int | bool | None]
    outside_ns: dict[str, int] = {}
    words: list[tuple[str, int]] = []


class FleetState:
    """The state of one fleet; all times in ns on the coordinator's clock."""

    def __init__(
        self,
        name: str,
        boot: int,
        members: list[Member],
        times: EpochTimes,
        grants: Grants,
        orders: OrderBook | None = None,
    ) -> None:
        self.name = name
        self.boot = self.run = boot
        self.term = 1
        self.times = times
        self.epoch = self.first_epoch = times.epoch
        self.members = Roster(members)
        self.phase = HOLD
        self.incidents: list[Incident] = []
        self.given_up_news: list[str] = []
        """Robots that were given up and of which the log does not state it yet."""

        self._sequence = 0
        self._changed_ns = 0
        self.allowed_ms = 0
        """The plan time up to which robots may be told to drive, because the log says so."""
        self.grants = grants
        self.orders = orders or OrderBook()
        self._told_orders: dict[str, int] = {}
        """The states of open orders that people were told of."""

        self._first_go_ns = 0
        self._looked_ns = self._stopped_ns = 0
        self._waits_since_ns: int | None = None
        """Since when robots that are lost or do not get on hold others."""
        self._router = RouterLink()
        self._patient_until_ns = 0
        self._unheard_since_ns = 0
        """Since when a coordinator that took over has heard nobody; 0: it has, or did not."""
        self.is_resumed = self.superseded = False
        self.bad_messages = 0
        self._farewells = 0
        self.blocks: dict[str, Block] = {}
        """The places that operators have closed."""

        self.outside_ns: dict[str, int] = {}
        """Robots that were taken out: when each was heard since [ns], 0 if it was not."""

        self.words: dict[tuple[str, int], None] = {}
        """What operators' programs have spoken of, each with its boot id, the newest word last."""

        self.is_to_stop = False
        """Whether an operator has stopped a fleet that has yet to set out."""

        self.is_ending = False
        """Whether an operator has told the fleet to end when all rest."""

    def plain(self) -> PlainFleet:
        """Return the state as plain data, without incidents; no course may be looked for."""
        return PlainFleet(
            self.name,
            self.boot,
            list(self.members.values()),
            self.times.plain(),
            self.grants.plain(),
            self.orders.plain(),
            self._router.plain(),
            list(self.blocks.values()),
            {name: getattr(self, name) for name in _KEPT},
            dict(self.outside_ns),
            list(self.words),
        )

    @classmethod
    def of_plain(cls, told: PlainFleet, orders: OrderBook) -> Self:
        """Return the fleet; `orders` has those that the fleet began with.

        Raises KeyError, TypeError or ValueError if what is told cannot be.
        """
        orders.take_plain(told.orders)
        times, grants = EpochTimes.of_plain(told.times), Grants.of_plain(told.grants)
        made = cls(told.name, told.boot, told.members, times, grants, orders)
        for name in _KEPT:
            setattr(made, name, told.numbers[name])
        if told.router_up is not None:
            made._router.take(told.router_up)
        made.blocks = {block.id: block for block in told.blocks}
        made.outside_ns, made.words = dict(told.outside_ns), dict.fromkeys(told.words)
        made._told_orders = {
            one.id: one.state for one in told.orders.said.values() if one.state or one.reason
        }
        return made

    @property
    def is_finished(self) -> bool:
        """Whether the phase is OVER and enough Commands have stated it."""
        return self.phase == OVER and self._farewells >= FAREWELLS

    @property
    def next_epoch(self) -> int:
        """The number of the next plan."""
        return max(self.epoch, self.times.epoch + 1)

    @property
    def has_gone(self) -> bool:
        """Whether the fleet has ever set out."""
        return self._first_go_ns != 0

    def since_go_ms(self, now_ns: int) -> int:
        """Return the time since the first GO [ms]; 0 before it."""
        return (now_ns - self._first_go_ns) // MILLISECOND if self.has_gone else 0

    def is_settled(self, now_ns: int) -> bool:
        """Return whether a frozen fleet rests: each robot has said where it rests, or is lost."""
        if self.phase != FREEZE or now_ns < self._changed_ns + COMMAND_PERIOD:
            return False
        waits = self._router.may_be_silent(self._changed_ns, now_ns) and self.members.is_unheard()
        if waits or self._router.is_down:
            return False
        return self.members.has_told(self.times.has_gone)

    def outrun(self, what: str, now_ns: int) -> None:
        """Stop leading if this coordinator resumed from a log that lacks what robots have done."""
        if self.is_resumed and not self.superseded:
            self._tell(
                now_ns, "fault", "", f"{what}, which the log does not hold; is it the newest log?"
            )
            self.superseded = True

    def standings(self) -> list[Standing]:
        """Return the standings of robots that have a part or have said where they rest."""
        return self.members.standings(self.times.epoch, self.spans, self._looked_ns)

    def spans(self, robot: str) -> list[Span]:
        """Return the parts of its courses of the newest epoch on which a robot may stand.

        No robot has moved in an epoch that has not started to drive.
        """
        return self.grants.spans(robot) if self.times.has_gone else [Span(0, 0, 0)]

    def missing(self, now_ns: int) -> list[str]:
        """Return the ids of the robots that are not armed yet."""
        return self.members.unarmed(self.epoch, now_ns)

    @property
    def needed_ms(self) -> int:
        """The plan time up to which robots are told to drive, if nobody is in their way."""
        return self.times.plan_ms(self._looked_ns) + self.grants.headroom_ms

    def held(self) -> list[Held]:
        """Return the robots that others hold while the fleet drives."""
        return self.grants.standstills.held() if self.phase == GO else []

    @property
    def is_cut_off(self) -> bool:
        """Whether the router between the fleet and its coordinator cannot be reached."""
        return self._router.is_down

    def _hear_router(self, up: bool, now_ns: int) -> None:
        """Excuse all robots when the router is back: nobody could be heard."""
        if not self._router.take(up):
            return
        self._tell(now_ns, "router", "", f"the router is {'back' if up else 'gone'}")
        if up:
            for member in self.members.planned:
                member.lost = member.gone = False
            self._begin_again(now_ns)

    def _begin_again(self, now_ns: int) -> None:
        """Give robots RESUME_PATIENCE, from now on, to be heard again."""
        until_ns = now_ns + RESUME_PATIENCE
        lost_ns = until_ns - max(self._patient_until_ns, now_ns)
        self._patient_until_ns = until_ns
        self._excuse(until_ns, lost_ns if self.phase == GO else 0)

    def _excuse(self, until_ns: int, lost_ns: int = 0, before_ns: int | None = None) -> None:
        """Take in that robots could not be heard: silence counts only from then on.

        `lost_ns`: for how much of the plan's time they could not.  Those that were silent at
        `before_ns` are not excused.
        """
        for member in self.members.values():
            if not member.lost and (before_ns is None or not member.is_silent(before_ns)):
                member.excused_ns = max(member.excused_ns, until_ns)
        self.grants.standstills.excuse(lost_ns // MILLISECOND)

    def _set_back(self, by_ns: int) -> None:
        """Take in that the clock has begun anew: what was before it was that much earlier [ns]."""
        self._first_go_ns += by_ns if self.has_gone else 0
        self._patient_until_ns += by_ns
        self.outside_ns = {name: at and at + by_ns for name, at in self.outside_ns.items()}
        for member in self.members.values():
            member.set_back(by_ns)

    def order_states(self) -> list[Outgoing]:
        """Return what has become of orders since this was called last."""
        changed = self.orders.changed()
        for one in changed:
            self._tell_order(one)
        return [self._order_state(one) for one in changed]

    def _tell_order(self, state: OrderState) -> None:
        """Tell people of an order that is in another state than before, or waits for a reason."""
        was = self._told_orders.get(state.id)
        self._told_orders[state.id] = state.state
        if state.state not in (WAITING, UNDER_WAY):
            del self._told_orders[state.id]
        if state.state == WAITING and not state.reason:
            self._told_orders.pop(state.id)
        elif state.state != was:
            now_ns, text = self._looked_ns, f"{state.id} {ORDER_STATES[state.state]}"
            told = Incident(now_ns, "order state", state.robot, text, order=state)
            self.incidents.append(told)

    def _order_state(self, state: OrderState) -> Outgoing:
        return Outgoing(keys.orders(self.name, state.id), encode(state))

    def plans(self) -> list[Outgoing]:
        """Return the Plan messages of all courses that robots may be driving."""
        return [
            Outgoing(keys.plan(self.name, one.id), plan)
            for one in self.members.planned
            for plan in one.possible_plans()
        ]

    def _send_plan(self, member: Member, now_ns: int) -> list[Outgoing]:
        """Return a robot's Plan to send, unless it was just sent or the robot has no part."""
        if self.phase not in (HOLD, GO) or not member.plan_due(now_ns):
            return []
        return [Outgoing(keys.plan(self.name, member.id), member.plan)]

    def _lose(self, member: Member, now_ns: int) -> None:
        """Record that a robot is lost: it is not heard any more."""
        member.lost = True
        what = silent(member).what
        if member.has_come_back(now_ns):
            what = "was started again and waits to be admitted"
        self._tell(now_ns, "fault", member.id, f"{member.id} {what}")

    def go_around(self, member: Member, now_ns: int, why: str = "") -> None:
        """Grant a robot nothing more on its course; others go around where it may stand.

        A course that it was not sent yet is not sent any more.  `why`: words that follow its name,
        where nothing was told of it before.
        """
        self.grants.give_up(member.id)
        mine = self.grants.of(member.id)
        coming = None if mine is None else mine.next
        if (
            coming is not None
            and coming.revision == member.revision
            and member.plan_sent_ns is None
        ):
            member.withdraw_course()
        self.given_up_news.append(member.id)
        self._tell(now_ns, "fault", member.id, f"others go around {member.id}{why}")

    def _give_up(self, failing: list[Failing], now_ns: int) -> None:
        """Freeze a fleet that arms on a changed floor: it is planned anew without these robots."""
        for member, what, lost, strike in failing:
            member.lost |= lost
            if strike:
                member.strike(self.epoch)
            self._tell(now_ns, "fault", member.id, f"{member.id} {what}")
            self._turn("robot failed", now_ns)

    def _turn(self, event: Event, now_ns: int, by: str = "") -> None:
        phase = TRANSITIONS.get((self.phase, event))
        if phase is None:
            return
        if phase == FREEZE:
            self.is_to_stop |= self.phase == STOP
            for member in self.members.values():
                member.forget_rest()
        self.phase, self._changed_ns = phase, now_ns
        if event == "all armed":
            self.times.go(now_ns)
            self._first_go_ns = self._first_go_ns or self.times.start_ns
            for member in self.members.planned:
                member.set_out(self.epoch)
        self._tell_phase(now_ns, COMMAND_NAMES[phase] + (f", by {by}" if by else ""))
        if phase == GO and self.is_to_stop:
            self.is_to_stop, self._stopped_ns = False, now_ns
            self._turn("told to stop", now_ns)

    def _commands(self, now_ns: int) -> list[Outgoing]:
        """Return the Command, or several if one cannot name all who have less authority."""
        stated = [Stated()]
        if self.phase == GO:
            most_ms = 0 if self._only_listens(now_ns) else self.allowed_ms
            stated = self.grants.grant(self.times.plan_ms(now_ns), most_ms)
        return [Outgoing(keys.command(self.name), self._command(now_ns, one)) for one in stated]

    def _only_listens(self, now_ns: int) -> bool:
        """Return whether a fleet that was taken over has yet to hear whether its log is whole.

        A robot that drives a course which the log does not hold says so; until all have been heard,
        or were silent for REPORT_TIMEOUT, nothing is granted that may be against it.
        """
        since_ns = self._patient_until_ns - RESUME_PATIENCE
        if not self.is_resumed or now_ns - since_ns > REPORT_TIMEOUT:
            return False
        heard = [one.heard_ns for one in self.members.planned if one.boot is not None]
        return any(at_ns < since_ns for at_ns in heard)

    def _command(self, now_ns: int, stated: Stated) -> bytes:
        self._sequence += 1
        wanted = self.members.wanted(self.phase)
        command = Command(
            boot=self.boot,
            term=self.term,
            sequence=self._sequence,
            epoch=self.epoch,
            phase=self.phase,
            start_ns=self.times.start_ns if self.phase in (GO, STOP, FREEZE) else 0,
            said_ns=now_ns,
            headroom_ms=stated.headroom_ms,
            held=stated.held,
            first=stated.first,
            last=stated.last,
            wanted=tuple(wanted[:MOST_WANTED]),
            run=self.run,
        )
        return encode(command)

    def _tell_phase(self, now_ns: int, text: str) -> None:
        self.incidents.append(Incident(now_ns, "phase", "", text, self.phase))

    def _tell(self, now_ns: int, kind: str, robot: str, text: str) -> None:
        self.incidents.append(Incident(now_ns, kind, robot, text))
