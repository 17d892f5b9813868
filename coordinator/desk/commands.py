"""What the desk can ask and tell a fleet: each request with its answer.

Decides: which message answers a request, how long it is waited for, which status an outcome has.
Must not know: how requests travel (web.py), who may send them (rights.py).
"""

from __future__ import annotations

import os
import time
from datetime import UTC, datetime
from functools import partial
from itertools import count
from typing import Final, TypeVar

from msgspec.structs import astuple

from coordinator.base.errors import InputError
from coordinator.desk.answers import FleetAnswer, Phase, Place, PreviewAnswer, Told
from coordinator.desk.bodies import BlockBody, JoinBody, OrderBody, read_name
from coordinator.desk.known_fleet import ENDED
from coordinator.desk.line import Line
from coordinator.desk.previews import Previews
from coordinator.exchange.vda5050_state import State, state_of
from coordinator.findings.info_fields import OrderSummary
from coordinator.fleet.admit_outcome import Asking
from coordinator.fleet.task import JOIN, LEAVE
from coordinator.scenario.checks import corners_fault
from coordinator.view.order_lines import another_order
from protocol import keys, phases
from protocol.messages import (
    CANCELLED,
    END,
    GO_ON,
    HALT,
    ORDER_DONE,
    REFUSED,
    WAITING,
    Admit,
    Block,
    Cancel,
    Command,
    Join,
    Leave,
    Message,
    Operators,
    Order,
    OrderState,
    Tell,
    Unblock,
)

PATIENCE_S: Final = 5.0
"""So long an answer is waited for."""

_SETTLES_S: Final = 1.0
"""So long an order may take to begin, or to say what keeps it: its first answer says no more."""

_ADMIT_S: Final = 20.0

_SAYS_END: Final = 4
_END_AGAIN_S: Final = 0.1
"""The end is said that often, until so many Commands have been heard: about three times."""

_SAYS_STOP: Final = 4
_STANDS: Final = (phases.HOLD, phases.FREEZE)
"""In these phases a STOP is said until so many Commands have been heard: about three times."""


class Refused(Exception):  # noqa: N818 - it is an outcome
    """A request that is not done: an HTTP status, and why."""

    def __init__(self, status: int, *problems: str) -> None:
        super().__init__(*problems)
        self.status = status
        self.problems = problems


class Commands:
    """The requests of one desk; each raises Refused if it is not done.

    `by`: who sends it, "" if that is not known.
    """

    def __init__(self, line: Line) -> None:
        self._line = line
        self.previews = Previews(line.floor)
        self._states_asked = 0
        self._joins: dict[str, Join] = {}
        """The robots that this desk took in, and that were not taken out here since."""

    def fleet(self) -> FleetAnswer:
        """Return the fleet as it is known."""
        return self._line.fleet()

    def orders(self) -> list[OrderSummary]:
        """Return all orders."""
        return self._line.known.summaries()

    def order(self, name: str) -> OrderSummary:
        """Return one order."""
        state = self._line.known.orders.get(name)
        if state is None:
            raise Refused(404, f"there is no order {name}")
        return OrderSummary.of(state)

    async def give_order(self, body: OrderBody, by: str) -> OrderSummary:
        """Give an order and return what has become of it so far."""
        _check_now(body)
        given = body.message(self._line.boot, f"order-{os.urandom(4).hex()}", self._by(by))

        def settled(message: Message) -> OrderState | None:
            said = _state_of(message, given.id)
            if said is not None and said.state == WAITING and (given.now or not said.reason):
                return None
            return said

        said = await self._asked_order(given, given.id)
        state = self._line.known.orders.get(given.id, said)
        if not (given.release_ms or given.after or settled(state)):
            state = await self._line.await_answer(settled, _SETTLES_S) or state
        if state.state == REFUSED:
            self._line.known.alarms.refusal_told(given.id)
            raise Refused(409, state.reason)
        return OrderSummary.of(state)

    async def preview(self, body: OrderBody) -> PreviewAnswer:
        """Return what an order would come to if it were given now."""
        _check_now(body)
        if not self.previews.are_possible:
            raise Refused(409, "the floor is not known to this desk: give it the plan")
        try:
            found = await self.previews.make(self._line.known, body, time.monotonic())
        except KeyError:
            raise Refused(409, f"{body.robot} has no course that this desk has heard") from None
        if found is None:
            raise Refused(504, "the process that makes previews has ended; ask again")
        return found

    async def cancel(self, name: str, by: str) -> OrderSummary:
        """Take an order back."""
        asked = Cancel(self._line.boot, _name(name, "order"), self._by(by))
        over = partial(_state_of, name=name, within=ENDED)
        state = _answered(await self._line.ask(keys.order, asked, over, PATIENCE_S))
        if state.state == REFUSED:
            raise Refused(404 if state.released_ms is None else 409, state.reason)
        if state.state == ORDER_DONE:
            raise Refused(409, f"{name} is done already")
        return OrderSummary.of(state)

    async def freeze(self, by: str) -> Phase:
        """Stop the fleet at once."""
        return await self._tell(HALT, (phases.STOP, phases.OVER), by, _STANDS)

    async def resume(self, by: str) -> Phase:
        """Let a fleet that was stopped go on."""
        return await self._tell(GO_ON, (phases.GO, phases.OVER), by, _STANDS)

    async def end(self, by: str) -> Phase:
        """Tell the fleet to end when all rest; the answer does not wait until it has ended.

        Nothing on the wire answers it before that, so it is said several times.  A fleet that rests
        ends at once, and the desk with it.
        """
        asked, heard = Tell(_word(), END, self._by(by)), count(1)

        def often(message: Message) -> int | None:
            if not isinstance(message, Command):
                return None
            is_said = message.phase == phases.OVER or next(heard) >= _SAYS_END
            return message.phase if is_said else None

        phase = await self._line.ask(keys.tell, asked, often, PATIENCE_S, _END_AGAIN_S)
        return self._phase(phase)

    async def admit(self, robot: str, by: str) -> Told:
        """Let a robot that has come back take part again.

        The answer says so if it has no course yet: others may have to get out of its way first.
        """
        asked = Admit(_word(), self._by(by))
        asking = Asking(_name(robot, "robot"), asked.boot)
        if self._line.known.command is not None:
            asking.hear(self._line.known.command)
        asking.asked()

        def heard(message: Message) -> str | None:
            asking.hear(message)
            return asking.answer or asking.waits_for or None

        key = partial(keys.admit, robot=robot)
        answer = await self._line.ask(key, asked, heard, _ADMIT_S)
        if answer is None and self._line.is_heard():
            why = "it does not rest, or waits for others to be out of its way"
            return Told(robot, f"{robot} was asked for and has no course yet: {why}")
        answer = _answered(answer)
        if not asking.admitted:
            raise Refused(409, answer)
        return Told(robot, answer)

    async def join(self, robot: str, body: JoinBody, by: str) -> Told:
        """Take a robot into the fleet; its program may start later."""
        message = body.message(self._line.boot, _name(robot, "robot"), self._by(by))
        known = self._line.known.orders.get(f"{JOIN}{robot}")
        if known is not None and known.state in (REFUSED, CANCELLED):
            self._joins.pop(robot, None)
        before = self._joins.get(robot)
        if before is not None and astuple(message)[1:-1] != astuple(before)[1:-1]:
            x, y, heading = before.place
            raise Refused(
                409,
                f"{robot} was joined at ({x:g}, {y:g}, {heading:g}) already, from another place or "
                "with other limits; take it out first",
            )
        state = await self._asked_order(message, f"{JOIN}{robot}")
        if state.state in (REFUSED, CANCELLED):
            self._line.known.alarms.refusal_told(state.id)
            raise Refused(409, state.reason)
        self._joins[robot] = message
        joined = state.state == ORDER_DONE
        return Told(robot, f"{robot} {'has joined' if joined else 'joins when it is heard'}")

    async def leave(self, robot: str, by: str) -> Told:
        """Take a robot that rests, or is lost, out of the fleet."""
        message = Leave(self._line.boot, _name(robot, "robot"), self._by(by))
        state = await self._asked_order(message, f"{LEAVE}{robot}")
        if state.state != ORDER_DONE:
            raise Refused(409, state.reason)
        self._joins.pop(robot, None)
        return Told(robot, f"{robot} has left" + (f". {state.reason}" if state.reason else ""))

    def blocks(self) -> list[Place]:
        """Return the places that are closed."""
        return [Place(one.id, one.polygon) for one in self._line.known.blocks.values()]

    async def block(self, body: BlockBody, by: str) -> Place:
        """Close a place for all robots that have not passed it."""
        if fault := corners_fault(body.polygon):
            raise Refused(400, f"polygon: {fault}")
        asked = body.message(self._line.boot, f"block-{os.urandom(3).hex()}", self._by(by))

        def closed(message: Message) -> Block | None:
            return message if isinstance(message, Block) and message.id == asked.id else None

        found = _answered(await self._line.ask(keys.block, asked, closed, PATIENCE_S))
        if found.polygon != asked.polygon:
            raise Refused(409, f"{asked.id} is another place, which is closed already")
        return Place(found.id, found.polygon)

    async def unblock(self, name: str, by: str) -> Place:
        """Open a place again."""
        was = self._line.known.blocks.get(name)
        if was is None:
            raise Refused(404, f"no place {name} is closed")
        asked = Unblock(self._line.boot, _name(name, "id"), self._by(by))

        def opened(message: Message) -> Unblock | None:
            return message if isinstance(message, Unblock) and message.id == name else None

        _answered(await self._line.ask(keys.block, asked, opened, PATIENCE_S))
        return Place(name, was.polygon)

    def states(self, name: str = "") -> list[State]:
        """Return VDA 5050 states of all robots that were heard, or of one."""
        known, now = self._line.known, time.monotonic()
        names = [name] if name else [one.id for one in known.robots(now)]
        seen = [one for one in (known.seen(robot, now) for robot in names) if one is not None]
        if name and not seen:
            raise Refused(404, f"no robot {name} was heard")
        self._states_asked += 1
        stamp = datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
        paused = known.command is not None and known.command.phase in (phases.STOP, phases.FREEZE)
        fleet = known.fleet or ""
        return [state_of(one, fleet, self._states_asked, stamp, paused=paused) for one in seen]

    def acknowledge(self, name: str) -> None:
        """Mark an alarm as seen."""
        if not self._line.known.alarms.acknowledge(name):
            raise Refused(404, f"there is no alarm {name}")

    async def _tell(
        self, what: int, wanted: tuple[int, ...], by: str, unanswered: tuple[int, ...] = ()
    ) -> Phase:
        """Tell the fleet something; the answer is what its Commands state within patience.

        In the phases `unanswered` nothing on the wire answers it, so it is said several times.
        """
        heard = count(1)

        def turned(message: Message) -> int | None:
            if not isinstance(message, Command):
                return None
            is_said = message.phase in unanswered and next(heard) >= _SAYS_STOP
            return message.phase if message.phase in wanted or is_said else None

        asked = Tell(_word(), what, self._by(by))
        phase = await self._line.ask(keys.tell, asked, turned, PATIENCE_S)
        command = self._line.known.command
        if phase is None and command is not None and self._line.is_heard():
            name = phases.COMMAND_NAMES[command.phase].lower()
            raise Refused(409, f"the fleet is still at {name}")
        return self._phase(phase)

    def _phase(self, phase: int | None) -> Phase:
        name = phases.COMMAND_NAMES[_answered(phase)]
        return Phase(self._line.known.fleet or "", name.lower())

    async def _asked_order(self, message: Operators, name: str) -> OrderState:
        key = keys.order if isinstance(message, Order) else keys.roster

        def fits(heard: Message) -> OrderState | Order | None:
            if isinstance(heard, Order) and (heard.id, heard.boot) == (name, message.boot):
                return heard
            return _state_of(heard, name)

        found: OrderState | Order | None = await self._line.ask(key, message, fits, PATIENCE_S)
        if isinstance(found, Order):
            raise Refused(409, another_order(found))
        return _answered(found)

    def _by(self, who: str) -> str:
        return who or self._line.by


Answer = TypeVar("Answer")


def _answered(answer: Answer | None) -> Answer:
    if answer is None:
        raise Refused(504, f"no coordinator has answered within {PATIENCE_S:g} s")
    return answer


def _state_of(
    message: Message, name: str, *, within: tuple[int, ...] | None = None
) -> OrderState | None:
    """Return a message if it is about this order, in one of these states."""
    if not isinstance(message, OrderState) or message.id != name:
        return None
    return message if within is None or message.state in within else None


def _check_now(body: OrderBody) -> None:
    if body.now and not body.robot:
        raise Refused(400, "now: takes a robot, which leaves what it does")


def _word() -> int:
    """Return a boot id of its own for one word of a person: who says it again means it anew."""
    return int.from_bytes(os.urandom(4), "little")


def _name(text: str, what: str) -> str:
    try:
        return read_name(text, what)
    except InputError as error:
        raise Refused(404, *error.problems) from None
