"""Robots that break the specification on purpose, each in one way: the Python agent, changed."""

from __future__ import annotations

import struct
import zlib

import msgspec

from protocol.codec import decode, encode
from protocol.messages import MOST_NUMBER, Clock, Hello, Report, Rest
from protocol.phases import BAD_PLAN, FREEZE, FROZEN, GO, MOVING, STOP
from protocol.transport import Transport
from robot_agent.core import transitions
from robot_agent.core.ride import Ride
from robot_agent.service import RobotService


class Unsealed(RobotService):
    """Does not look at the seal of a Plan."""

    def _enqueue(self, key, payload, sent_ns):
        if "/plan/" in key and len(payload) > 5:
            payload = payload[:-5] + struct.pack(">BI", 0xCE, zlib.crc32(payload[:-5]))
        super()._enqueue(key, payload, sent_ns)


class Fragile(RobotService):
    """Its program ends when it hears bytes that are no message."""

    def _enqueue(self, key, payload, sent_ns):
        super()._enqueue(key, payload, sent_ns)
        if self.inbox.bad:
            self._move = None


class Brittle(RobotService):
    """Its program ends when it hears bytes that are no message, once it drives."""

    def _enqueue(self, key, payload, sent_ns):
        bad = self.inbox.bad
        super()._enqueue(key, payload, sent_ns)
        if self.inbox.bad > bad and self.agent.phase == MOVING:
            self._move = None


class Strict(RobotService):
    """Drops messages with more fields than it knows."""

    def _enqueue(self, key, payload, sent_ns):
        message = decode(key.split("/")[2], payload)
        if message is None or counted(payload) <= counted(encode(message)):
            super()._enqueue(key, payload, sent_ns)


class Terse(RobotService):
    """Reads numbers and heads in their shortest form only."""

    def _enqueue(self, key, payload, sent_ns):
        message = decode(key.split("/")[2], payload)
        longer = message is not None and len(payload) > len(encode(message))
        if not longer or counted(payload) > counted(encode(message)):
            super()._enqueue(key, payload, sent_ns)


def counted(payload: bytes) -> int:
    """Return how many elements an encoded array has."""
    return len(msgspec.msgpack.decode(payload))


class Credulous(RobotService):
    """Believes answers to others' questions about the time."""

    def _enqueue(self, key, payload, sent_ns):
        message = decode(key.split("/")[2], payload)
        if isinstance(message, Clock):
            payload = encode(msgspec.structs.replace(message, boot=self.boot))
        super()._enqueue(key, payload, sent_ns)


class Impartial(RobotService):
    """Believes every coordinator about the time."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        hear = self.agent.hear_clock
        self.agent.hear_clock = lambda _boot, *stamps: hear(self.agent._leader.boot, *stamps)


class Reopening(RobotService):
    """Takes an answer to a question that has had one."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        clock, ask, self.asked = self.agent.clock, self.agent.clock.ask, []
        clock.ask = lambda now_ns: (self.asked.append(now_ns), ask(now_ns))
        add = clock.add
        clock.add = lambda sent_ns, *stamps: (self.reopen(sent_ns), add(sent_ns, *stamps))[1]

    def reopen(self, sent_ns):
        clock = self.agent.clock
        if sent_ns in self.asked and sent_ns not in clock._open:
            clock._open[0] = sent_ns


class Hasty(RobotService):
    """Arms as soon as it has heard any time."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        self.agent.clock.is_within = lambda _limit, _now: self.agent.clock.good > 0


class Selfish(RobotService):
    """Takes its own clock for the coordinator's."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        hear = self.agent.hear_clock
        self.agent.hear_clock = lambda boot, sent, _one, _two, now: hear(boot, sent, sent, now, now)
        self.agent.clock.is_said_in_future = lambda *_: False


class Told(RobotService):
    """Hears Commands as `change` makes them."""

    def _hear_command(self, fleet, command, now_ns):
        super()._hear_command(fleet, self.change(command), now_ns)

    def change(self, command):
        return command


class Unbounded(Told):
    """Drives without regard to its authority."""

    def change(self, command):
        return msgspec.structs.replace(command, held=(), headroom_ms=10**6)


class OneRange(Told):
    """Takes every Command to be for its number."""

    def change(self, command):
        return msgspec.structs.replace(command, first=0, last=MOST_NUMBER)


class Unstoppable(Told):
    """Takes STOP for GO."""

    def change(self, command):
        if command.phase != STOP:
            return command
        return msgspec.structs.replace(command, phase=GO, headroom_ms=1_500)


class Disloyal(Told):
    """Obeys coordinators of other runs."""

    def change(self, command):
        return msgspec.structs.replace(command, run=self.agent._leader.run)


class Unheld(Told):
    """Drives its new course although Commands name it as held."""

    def change(self, command):
        held = tuple(one for one in command.held if one[0] != self.agent.next_number)
        new = self.agent.next_number != self.agent.number or self.agent.revision > 0
        return msgspec.structs.replace(command, held=held) if new else command


class Unmoved(Told):
    """Takes FREEZE for GO."""

    def change(self, command):
        return msgspec.structs.replace(
            command, phase=GO if command.phase == FREEZE else command.phase
        )


class Changed(Transport):
    """A link on which `change` is applied to every message that is put."""

    def __init__(self, link, change):
        self._link, self._change = link, change

    def put(self, key, payload):
        self._link.put(key, encode(self._change(decode(key.split("/")[2], payload))))

    def subscribe(self, key_expression, handler):
        self._link.subscribe(key_expression, handler)

    def declare_alive(self, key):
        self._link.declare_alive(key)

    def watch_alive(self, key_expression, handler):
        self._link.watch_alive(key_expression, handler)

    def close(self):
        self._link.close()


class Saying(RobotService):
    """Says what `say` makes of its messages."""

    def __init__(self, robot, transport, *args, **options):
        super().__init__(robot, Changed(transport, self.say), *args, **options)

    def say(self, message):
        return message


class Outdated(Saying):
    """Speaks version 2."""

    def say(self, message):
        if isinstance(message, Hello):
            message = msgspec.structs.replace(message, version=2)
        return message


class Skewed(Saying):
    """Stamps its reports by 0.2 s ahead."""

    def say(self, message):
        if isinstance(message, Report) and message.stamp_ms is not None:
            message = msgspec.structs.replace(message, stamp_ms=message.stamp_ms + 200)
        return message


class Stamping(Saying):
    """States a stamp in every report."""

    def say(self, message):
        if isinstance(message, Report) and message.stamp_ms is None:
            message = msgspec.structs.replace(message, stamp_ms=0)
        return message


class Uncounted(Saying):
    """Does not count its reports."""

    def say(self, message):
        return (
            msgspec.structs.replace(message, sequence=1) if isinstance(message, Report) else message
        )


class Forgetful(RobotService):
    """Obeys old Commands."""

    def _enqueue(self, key, payload, sent_ns):
        self.inbox._newest = (-1, -1, -1)
        super()._enqueue(key, payload, sent_ns)

    def _hear_command(self, fleet, command, now_ns):
        self.agent._leader.sequence = -1
        super()._hear_command(fleet, command, now_ns)


class Submissive(RobotService):
    """Obeys whoever speaks last, whatever the term."""

    def _hear_command(self, fleet, command, now_ns):
        leader = self.agent._leader
        if command.boot != leader.boot:
            leader.term = leader.boot = -1
        super()._hear_command(fleet, command, now_ns)


class Faithful(RobotService):
    """Obeys no other coordinator than its first."""

    def _hear_command(self, fleet, command, now_ns):
        if self.agent._leader.boot in (-1, command.boot):
            super()._hear_command(fleet, command, now_ns)


class Braggart(RobotService):
    """Always claims to be on time."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        due = self.agent.report_due

        def report_due(now_ns):
            result = due(now_ns)
            self.agent.report_late = 0
            return result

        self.agent.report_due = report_due


class Timid(RobotService):
    """Freezes when it hears no Command for a second."""

    def tick(self, now_ns):
        if self.agent.phase == MOVING and now_ns - self.heard_ns > 10**9:
            self.agent._apply(transitions.TOLD_TO_FREEZE, now_ns)
        return super().tick(now_ns)


class Resigned(RobotService):
    """Takes its newest authority, not its greatest."""

    def _hear_command(self, fleet, command, now_ns):
        if self.agent.ride is not None:
            self.agent.ride._told = -1.0
        super()._hear_command(fleet, command, now_ns)


class Settled(RobotService):
    """Takes no further course."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        self.agent._hear_course = lambda *_: None


class Jumping(RobotService):
    """Takes every further course, wherever it begins."""

    def tick(self, now_ns):
        ride = self.agent.ride
        if ride is not None:
            ride.leads_into = lambda *_: True
        return super().tick(now_ns)


class Talkative(RobotService):
    """Says in every Report where it is."""

    def _rest(self):
        ride = self.agent.ride
        return None if ride is None else Rest(ride.follower.s, self.agent.epoch)


class Silent(RobotService):
    """Does not say where it rests."""

    def _rest(self):
        return None


class Premature(RobotService):
    """Is done before its plan has ended."""

    def tick(self, now_ns):
        ride = self.agent.ride
        if isinstance(ride, Ride):
            ride.arrived = lambda: ride._timeline.length - ride.follower.s < 0.3
        return super().tick(now_ns)


class Restless(RobotService):
    """Goes on with GO after it has been frozen."""

    def _hear_command(self, fleet, command, now_ns):
        super()._hear_command(fleet, command, now_ns)
        if command.phase == GO and self.agent.phase == FROZEN:
            self.agent.phase = MOVING


class Anywhere(RobotService):
    """Arms wherever it stands."""

    def tick(self, now_ns):
        ride = self.agent.ride
        if ride is not None:
            ride.stands_at_start = lambda *_: (True, 0, 0.0)
        return super().tick(now_ns)


class Trusting(RobotService):
    """Goes on as if it knew the time when a Command comes from the future."""

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        self.agent.clock.is_said_in_future = lambda *_: False


class Startled(Told):
    """Takes STOP for FREEZE."""

    def change(self, command):
        phase = FREEZE if command.phase == STOP else command.phase
        return msgspec.structs.replace(command, phase=phase)


class Frozen(Told):
    """Does not hear of a later epoch once it is frozen."""

    def change(self, command):
        epoch = self.agent.epoch if self.agent.phase == FROZEN else command.epoch
        return msgspec.structs.replace(command, epoch=epoch)


class Indiscriminate(RobotService):
    """Takes Plans of every coordinator and epoch."""

    def _hear_plan(self, plan):
        leader = self.agent._leader
        super()._hear_plan(msgspec.structs.replace(plan, boot=leader.boot, epoch=leader.epoch))


class Uncomplaining(Saying):
    """Does not report that its plan is not acceptable."""

    def say(self, message):
        if isinstance(message, Report) and message.fault == BAD_PLAN:
            message = msgspec.structs.replace(message, fault=0)
        return message


class Clinging(RobotService):
    """Holds a further course, and never changes to it."""

    def tick(self, now_ns):
        ride = self.agent.ride
        if ride is not None:
            ride.is_over = lambda _: False
        return super().tick(now_ns)


class Confused(RobotService):
    """Stops when it hears the same Command twice."""

    last = b""

    def _enqueue(self, key, payload, sent_ns):
        if payload == self.last:
            self.agent.hear_driver_error(self._clock())
        self.last = payload
        super()._enqueue(key, payload, sent_ns)


BROKEN = {
    Startled: ("STOP-2", "it is stopped"),
    Frozen: ("FREEZE-4", "it is frozen"),
    Indiscriminate: ("PLAN-1", "a robot introduces"),
    Uncomplaining: ("PLAN-2", "a robot introduces"),
    Clinging: ("COURSE-3", "it is sent on"),
    Confused: ("WIRE-5", "when messages come twice"),
    Outdated: ("HELLO-1", "a robot introduces"),
    Skewed: ("CLOCK-4", "it drives a course"),
    Stamping: ("REPORT-2", "it drives a course"),
    Uncounted: ("REPORT-1", "it drives a course"),
    Unmoved: ("FREEZE-1", "it is frozen"),
    Unsealed: ("WIRE-4", "a robot introduces"),
    Fragile: ("WIRE-1", "a robot introduces"),
    Brittle: ("WIRE-1", "when messages are malformed"),
    Strict: ("WIRE-2", "when messages have fields"),
    Terse: ("WIRE-3", "when numbers and heads"),
    Credulous: ("CLOCK-2", "it learns the time"),
    Impartial: ("CLOCK-2", "it learns the time"),
    Reopening: ("CLOCK-2", "it learns the time"),
    Hasty: ("CLOCK-1", "it learns the time"),
    Selfish: ("CLOCK-4", "it drives a course"),
    Trusting: ("CLOCK-3", "a Command comes from the future"),
    Unbounded: ("AUTH-1", "its authority ends"),
    OneRange: ("AUTH-2", "its authority ends"),
    Resigned: ("AUTH-3", "when less is granted"),
    Timid: ("AUTH-4", "no Command comes"),
    Braggart: ("LATE-1", "its authority ends"),
    Premature: ("GO-2", "it drives a course"),
    Unstoppable: ("STOP-1", "it is stopped"),
    Settled: ("COURSE-1", "it is sent on"),
    Jumping: ("COURSE-2", "it is sent on"),
    Unheld: ("COURSE-4", "it is sent on"),
    Forgetful: ("LEAD-1", "when older Commands"),
    Submissive: ("LEAD-2", "when a former coordinator"),
    Disloyal: ("LEAD-3", "when the coordinator of another run"),
    Faithful: ("LEAD-4", "when the next coordinator"),
    Talkative: ("WIRE-6", "it drives a course"),
    Silent: ("FREEZE-2", "it is frozen"),
    Restless: ("FREEZE-3", "it is frozen"),
    Anywhere: ("PLAN-3", "its plan begins elsewhere"),
}
"""Each robot, what it breaks, and the exchange in which that shows."""
