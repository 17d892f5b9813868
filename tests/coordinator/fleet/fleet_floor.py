"""A fleet core and its robots, each of which says what a test makes it say."""

from __future__ import annotations

import itertools

import numpy as np

from coordinator.fleet.core import Fleet
from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.events import Part
from coordinator.fleet.grants import Grants
from coordinator.fleet.member import Member
from coordinator.plan.staircases import NO_STAIRCASES, Staircases
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import PROTOCOL_VERSION, Command, Hello, Report, Rest
from protocol.phases import ARMED, DONE, FREEZE, FROZEN, MOVING
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND

NAMES = ("R1", "R2", "R3")
HEADROOM_MS = 1_500
PARTS = {name: Part(b"second plan of " + name.encode(), 0.5) for name in NAMES}


TAU_MS = 1_000


def grants():
    """The grants of robots that never come near each other."""
    return Grants(NO_STAIRCASES, NAMES, HEADROOM_MS)


def bounds(fleet, robot):
    """The plan times [s] between which a robot may stand on its only course."""
    ((_, since_ms, until_ms),) = fleet.spans(robot)
    return since_ms / 1000.0, until_ms / 1000.0


def chain():
    """The grants of robots that follow each other: R1 behind R2, and R2 behind R3."""
    ahead, behind = np.array([1, 2]), np.array([0, 1])
    at, need = np.array([2_000, 90_000] * 2, np.int32), np.array([1_000, 89_000] * 2, np.int32)
    return Grants(Staircases(TAU_MS, ahead, behind, np.array([0, 2, 4]), at, need), NAMES, 1_500)


class Floor:
    """A fleet core and its three robots, each of which says what the test makes it say."""

    def __init__(self, epoch=1, rule=grants):
        members = [
            Member(id=name, radius=0.2, speed=0.5, plan=b"plan of " + name.encode(), accel=0.4)
            for name in NAMES
        ]
        self.fleet = Fleet("hall", 77, members, EpochTimes(epoch), rule())
        self.allowed_ms = 10**9
        self.now = 5 * SECOND
        self.sequence = itertools.count(1)
        self.commands = []

    def hello(self, robot="R1", **fields):
        return self.hear(
            keys.hello("hall", robot), Hello(**{"version": PROTOCOL_VERSION, "boot": 1, **fields})
        )

    def report(self, robot, phase, boot=1, epoch=1, fault=0, s_m=None, sequence=None, late=0):
        rest = None if s_m is None else Rest(s_m, epoch)
        number = next(self.sequence) if sequence is None else sequence
        stamp = self.fleet.times.plan_ms(self.now) if phase == MOVING else None
        said = Report(boot, number, epoch, phase, fault, rest, stamp, late)
        return self.hear(keys.report("hall", robot), said)

    def hear(self, key, message):
        return self.take(self.fleet.hear(key, encode(message), self.now))

    def tick(self, passed=COMMAND_PERIOD):
        self.now += passed
        self.fleet.allowed_ms = self.allowed_ms
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
    """A fleet that froze because its floor has changed, and has settled; some were lost before."""
    floor = Floor().go()
    for name in finished:
        floor.report(name, DONE)
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 5):
        for name in NAMES:
            if name not in lost:
                floor.report(name, DONE if name in finished else MOVING)
        floor.tick()
    floor.fleet.leave_floor(floor.now)
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
    return floor.take(floor.fleet.adopt(2, parts, floor.now, grants()))


def state_of(floor):
    return {standing.robot: standing.state for standing in floor.fleet.standings()}
