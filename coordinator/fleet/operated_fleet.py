"""What operators tell a fleet: orders, places that are closed, robots that come and go, stop, end.

Decides: how each of an operator's messages changes the fleet, and what answers it.  Must not know:
robots' messages, when the time is looked at (core.py), how courses are found (dispatch.py).
"""

from __future__ import annotations

from typing import Final

import shapely

from coordinator.fleet.events import Outgoing
from coordinator.fleet.member import Member
from coordinator.fleet.phases import GO_LEAD
from coordinator.fleet.state import FleetState
from coordinator.fleet.task import JOIN, LEAVE, known_order, order_of, robot_of
from coordinator.scenario import model
from coordinator.scenario.order_checks import OWN, OWN_IN_WORDS
from protocol import keys
from protocol.codec import encode
from protocol.messages import (
    CANCELLED,
    END,
    HALT,
    ORDER_DONE,
    REFUSED,
    Block,
    Cancel,
    Join,
    Leave,
    Message,
    Order,
    OrderState,
    Tell,
    Unblock,
)
from protocol.phases import FREEZE, FROZEN, GO, HOLD, IDLE, STOP

_MOST_WORDS: Final = 500
"""So many words of operators are known; older ones count as new when they are heard again."""

_NOWHERE: Final = 0.01
"""A course of at most this length [m] leads nowhere."""


class OperatedFleet(FleetState):
    """A fleet that operators tell what to do; all times in ns on the coordinator's clock."""

    def hear_operator(self, message: Message | None, now_ns: int) -> list[Outgoing] | None:
        """Take in an operator's message; return the answer, None if it is not an operator's."""
        answer: list[Outgoing] | None = None
        if isinstance(message, Block | Unblock | Join | Leave | Tell) and self._is_old(message):
            answer = []
        elif isinstance(message, Order | Cancel):
            answer = self._hear_order(message, now_ns)
        elif isinstance(message, Block | Unblock):
            answer = self._hear_block(message, now_ns)
        elif isinstance(message, Join):
            answer = self._hear_join(message, now_ns)
        elif isinstance(message, Leave):
            answer = self._hear_leave(message, now_ns)
        elif isinstance(message, Tell):
            answer = self._hear_tell(message, now_ns)
        return answer

    def _is_old(self, message: Block | Unblock | Join | Leave | Tell) -> bool:
        """Return whether others have spoken of the same since this program did.

        A program repeats a word until it is answered, and takes another boot id for the next word.
        What stops robots, closes a place or takes a robot in is never old.
        """
        word = (_subject(message), message.boot)
        spoken = [boot for subject, boot in self.words if subject == word[0]]
        lets = isinstance(message, Unblock | Leave)
        if isinstance(message, Tell):
            lets = message.what != HALT
        if lets and message.boot in spoken[:-1]:
            return True
        self.words.pop(word, None)
        self.words[word] = None
        if len(self.words) > _MOST_WORDS:
            del self.words[next(iter(self.words))]
        return False

    def stop(self, now_ns: int, by: str = "") -> list[Outgoing]:
        """Stop a fleet: robots that drive brake at once and keep their plans.

        A fleet that has yet to set out, or is to get another plan, is stopped before it drives.
        """
        if self.phase == GO:
            self._stopped_ns = now_ns
        elif self.phase in (HOLD, FREEZE) and not self.is_to_stop:
            self.is_to_stop = True
            text = "the fleet will not set out before it is told to go on"
            self._tell(now_ns, "order", "", text + (f", by {by}" if by else ""))
        self._turn("told to stop", now_ns, by)
        return self._commands(now_ns)

    def go_on(self, now_ns: int, by: str = "") -> list[Outgoing]:
        """Let a fleet that was stopped go on; the plan goes on where it was when it was stopped."""
        if self.phase == STOP:
            self.times.put_off(now_ns + GO_LEAD - self._stopped_ns)
            self._excuse(now_ns, before_ns=now_ns)
        self.is_to_stop = False
        self._turn("told to go on", now_ns, by)
        return self._commands(now_ns)

    def _hear_order(self, message: Order | Cancel, now_ns: int) -> list[Outgoing]:
        """Take in an order, or take one back; the answer is what has become of it."""
        known = self.orders.tasks.get(message.id)
        now_ms = max(self.since_go_ms(now_ns), 0)  # The first GO may be a moment ahead.
        if isinstance(message, Cancel):
            if known is not None and known.joins is not None and not known.is_over:
                self.orders.end(known, CANCELLED)
                self._take_out(known.robot, now_ns, message)
            elif self.orders.cancel(message.id, now_ms) is None:
                return [self._refusal(message.id, f"there is no order {message.id}")]
        elif known is None and message.id.startswith(OWN):
            return [self._refusal(message.id, OWN_IN_WORDS)]
        elif (other := self.orders.other(order_of(message))) is not None:
            said = encode(known_order(other, message.boot))
            return [Outgoing(keys.orders(self.name, message.id), said)]
        elif not self.is_ending and (later := self.orders.put_off(order_of(message), now_ms)):
            return [self._order_state(later)]
        else:
            task = self.orders.give(order_of(message), now_ms)
            if not self.is_ending:
                task.is_urgent = message.now
            elif not task.is_over and task.accepted_ms is None:
                self.orders.end(task, REFUSED, "the fleet ends when all rest")
        task_now = self.orders.tasks.get(message.id)
        answer = [] if task_now is None else [self._order_state(task_now.message())]
        return [*answer, *self.order_states()]

    def _refusal(self, order: str, why: str) -> Outgoing:
        """Return the answer for an order that the fleet does not know."""
        return self._order_state(OrderState(order, REFUSED, reason=why))

    def _hear_join(self, join: Join, now_ns: int) -> list[Outgoing]:
        """Take in a robot; the answer is the state of the order by which it joins."""
        name, now_ms = f"{JOIN}{join.robot}", self.since_go_ms(now_ns)
        task = self.orders.tasks.get(name)
        if task is None or (task.is_over and join.robot not in self.members):
            self.orders.tasks.pop(name, None)
            robot, why = robot_of(join), self._why_not_join(join)
            if not why:
                self.orders.know(join.robot)
            order = model.Order(id=name, robot="" if why else join.robot, goal=robot.goal)
            task = self.orders.give(order, now_ms)
            if why:
                self.orders.end(task, REFUSED, f"{join.robot} {why}")
            else:
                self.orders.tasks.pop(f"{LEAVE}{join.robot}", None)  # Nothing may say so again.
                task.joins = robot
                self.members[join.robot] = Member(
                    id=join.robot,
                    radius=join.radius_m,
                    speed=join.max_speed_mps,
                    plan=b"",
                    accel=robot.max_accel,
                    planned=False,
                    is_new=True,
                )
                x, y = robot.start[:2]
                what = f"{join.robot} is to join at ({x:g}, {y:g}){_by(join)}"
                self._tell(now_ns, "order", join.robot, what)
        elif task.state == REFUSED and self._has_part(join.robot, now_ns):
            task.state, task.reason = ORDER_DONE, ""  # It was given up, and was heard after all.
        return [self._order_state(task.message()), *self.order_states()]

    def _has_part(self, robot: str, now_ns: int) -> bool:
        """Return whether a robot is in the fleet, has a course, and is heard."""
        member = self.members.get(robot)
        return member is not None and member.planned and member.is_heard(now_ns)

    def _why_not_join(self, join: Join) -> str:
        """Return in words why a robot cannot join now; "" if it can."""
        if join.robot in self.members:
            return "is in the fleet already"
        if self.is_ending:
            return "cannot join: the fleet ends when all rest"
        return "" if self.has_gone else "can join once the fleet has set out"

    def _hear_leave(self, leave: Leave, now_ns: int) -> list[Outgoing]:
        """Take a robot out that rests or is lost; the answer is the state of an order."""
        name, now_ms = f"{LEAVE}{leave.robot}", self.since_go_ms(now_ns)
        member, task = self.members.get(leave.robot), self.orders.tasks.get(name)
        if task is None or member is not None:
            self.orders.tasks.pop(name, None)
            order = model.Order(id=name, robot=leave.robot, goal=(0.0, 0.0))
            task = self.orders.give(order, now_ms)
        if member is not None and not task.is_over:
            is_busy = self.orders.of_robot(leave.robot) is not None or not member.has_arrived
            stays = self.has_gone and self._stays_stopped(member)
            if is_busy and not (stays or member.lost or member.is_new or not member.planned):
                self.orders.end(task, REFUSED, f"{leave.robot} {self._why_not_leave()}")
            else:
                why = ""
                if member.is_silent(now_ns) and not member.has_come_back(now_ns):
                    why = f"{leave.robot} was not heard: others drive where it may still stand"
                self.outside_ns[leave.robot] = 0
                self.orders.end(task, ORDER_DONE, why)
                self._take_out(leave.robot, now_ns, leave)
        return [self._order_state(task.message()), *self.order_states()]

    def _stays_stopped(self, member: Member) -> bool:
        """Return whether a robot has stopped by a fault, and stays until it gets another course.

        One that does not stand where its course begins sets out as soon as it does, as far as it
        was told, even when it has left: it stays only if its course leads nowhere.
        """
        if not member.has_stopped(self.epoch):
            return False
        mine = self.grants.of(member.id)
        course = None if mine is None else mine.now.course
        leads_on = course is None or course.driven.timeline.length > _NOWHERE
        return member.phase == FROZEN or (member.phase == IDLE and not leads_on)

    def _why_not_leave(self) -> str:
        """Return in words why a robot cannot leave that neither rests nor is lost."""
        if not self.has_gone:
            return "can leave once the fleet has set out"
        return "does not rest; if it cannot get on, end its program first"

    def _take_out(self, robot: str, now_ns: int, by: Leave | Cancel) -> None:
        """Take a robot out of the fleet; its orders are refused.

        One of which no program was heard has not joined.
        """
        join = self.orders.tasks.get(f"{JOIN}{robot}")
        if join is not None and not join.is_over and self.members[robot].is_new:
            self.orders.end(join, CANCELLED, f"{robot} was taken out before it was heard")
        self.orders.forget(robot)
        self.grants.remove(robot)
        del self.members[robot]
        self._tell(now_ns, "order", robot, f"{robot} was taken out{_by(by)}")

    def _hear_block(self, message: Block | Unblock, now_ns: int) -> list[Outgoing]:
        """Close a place of the floor, or open it; the answer is the place, if it is closed."""
        known = self.blocks.get(message.id)
        if isinstance(message, Unblock):
            if self.blocks.pop(message.id, None) is not None:
                self._tell(now_ns, "block", "", f"{message.id} is open again{_by(message)}")
            return [Outgoing(keys.blocks(self.name, message.id), encode(message))]
        if known is None and shapely.is_valid(shapely.Polygon(message.polygon)):
            self.blocks[message.id] = known = message
            self._tell(now_ns, "block", "", f"{message.id} is closed{_by(message)}")
        if known is None:
            self.bad_messages += 1
            return []
        return [Outgoing(keys.blocks(self.name, known.id), encode(known))]

    def _hear_tell(self, message: Tell, now_ns: int) -> list[Outgoing]:
        """Stop, go on, or end when all rest."""
        if message.what == END:
            if not self.is_ending:
                self._tell(now_ns, "order", "", f"the fleet ends when all rest{_by(message)}")
            self.is_ending, self.orders.stays = True, False
            return []
        act = self.stop if message.what == HALT else self.go_on
        return act(now_ns, message.by)


def _subject(message: Block | Unblock | Join | Leave | Tell) -> str:
    """Return what an operator speaks of: a place, a robot, or the fleet."""
    if isinstance(message, Tell):
        return ""
    return f"{JOIN}{message.robot}" if isinstance(message, Join | Leave) else message.id


def _by(message: Tell | Block | Unblock | Join | Leave | Cancel) -> str:
    """Return in words who sent a message, as far as it says."""
    return f", by {message.by}" if message.by else ""
