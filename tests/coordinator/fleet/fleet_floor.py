"""A fleet core and its robots, each of which says what a test makes it say."""

from __future__ import annotations

import itertools

from coordinator.fleet.core import Fleet
from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.events import Part
from coordinator.fleet.member import Member
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Command, Hello, Report, Rest
from protocol.phases import ARMED, DONE, FREEZE, FROZEN, MOVING
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND

NAMES = ("R1", "R2", "R3")
DURATION = 10 * SECOND
PARTS = {name: Part(b"second plan of " + name.encode(), 0.5) for name in NAMES}


class Floor:
    """A fleet core and its three robots, each of which says what the test makes it say."""

    def __init__(self, epoch=1):
        members = [
            Member(id=name, radius=0.2, speed=0.5, plan=b"plan of " + name.encode(), accel=0.4)
            for name in NAMES
        ]
        self.fleet = Fleet("hall", 77, members, EpochTimes(epoch, DURATION))
        self.now = 5 * SECOND
        self.sequence = itertools.count(1)
        self.commands = []

    def hello(self, robot="R1", **fields):
        return self.hear(keys.hello("hall", robot), Hello(**{"version": 1, "boot": 1, **fields}))

    def report(self, robot, phase, boot=1, epoch=1, fault=0, s_m=None, sequence=None):
        rest = None if s_m is None else Rest(s_m, epoch)
        number = next(self.sequence) if sequence is None else sequence
        return self.hear(
            keys.report("hall", robot), Report(boot, number, epoch, phase, fault, rest)
        )

    def hear(self, key, message):
        return self.take(self.fleet.hear(key, encode(message), self.now))

    def tick(self, passed=COMMAND_PERIOD):
        self.now += passed
        return self.take(self.fleet.tick(self.now))

    def take(self, sent):
        for outgoing in sent:
            message = decode(keys.split(outgoing.key)[1], outgoing.payload)
            if isinstance(message, Command):
                self.commands.append(message)
        return sent

    def everybody(self, phase, **fields):
        for robot in NAMES:
            self.report(robot, phase, **fields)

    def go(self):
        for robot in NAMES:
            self.hello(robot)
        self.everybody(ARMED)
        self.tick()
        self.everybody(MOVING)
        return self


def frozen_but(*lost, finished=()):
    """A fleet that froze because of those lost and has settled."""
    floor = Floor().go()
    for name in finished:
        floor.report(name, DONE)
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 2):
        for name in NAMES:
            if name not in lost:
                floor.report(name, DONE if name in finished else MOVING)
        floor.tick()
    assert floor.commands[-1].phase == FREEZE
    for name in NAMES:
        if name not in (*lost, *finished):
            floor.report(name, FROZEN, s_m=1.25)
    floor.tick()
    assert floor.fleet.is_settled(floor.now)
    return floor


def adopt(floor, *names):
    parts = {name: PARTS[name] for name in names}
    return floor.take(floor.fleet.adopt(2, parts, DURATION, floor.now))


def state_of(floor):
    return {standing.robot: standing.state for standing in floor.fleet.standings()}
