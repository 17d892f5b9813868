"""What has to hold in every state of a small fleet (docs/safety.md), looked at from outside.

Numbers of the coordinator are read, its rules are not used: needs are read off the staircases'
knots here, true progress is where the wheels are.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any, Final

import numpy as np

from coordinator.fleet.sent_courses import Sent
from coordinator.plan.staircases import Staircases
from coordinator.proof.motion_pieces import Flights, Part
from coordinator.proof.precedence import staircase_failures
from coordinator.proof.tau_safety import separation_failures
from robot_agent.core.ride import Ride
from tests.exploration.world import STEP, Robot, World

ALONG: Final = 2e-3
"""How far [m] wheels may be from where a core's arithmetic has them along its path."""

EVER_MS: Final = 2**40

Marks = dict[str, tuple[int, ...]]
"""What may never go back, by who has it."""


class BrokenError(AssertionError):
    """A state that may not be."""


def marks_of(world: World) -> Marks:
    """Return the epochs, terms, sequences and revisions of a state."""
    fleet = world.fleet
    found: Marks = {"coordinator": (fleet.term, fleet.epoch)}
    for robot in world.robots:
        agent, leader = robot.agent, robot.agent._leader
        found[f"epoch {robot.name} {robot.boot}"] = (agent._spent_epoch,)
        found[f"leader {robot.name} {robot.boot}"] = (leader.term, leader.boot, leader.sequence)
        if agent.epoch:
            found[f"{robot.name} {robot.boot} epoch {agent.epoch}"] = (agent.revision,)
    return found


class Checks:
    """The checks; what is proven together is remembered, because proving takes long."""

    def __init__(self, margin: float) -> None:
        self._margin = margin
        self._proven: dict[Any, tuple[list[str], list[Any], Any]] = {}
        """By the identities of two courses and of all staircases: what fails, and these."""

    def look(self, world: World, before: Marks) -> None:
        """Raise BrokenError if a state may not be; `before`: the marks of the one before it."""
        for who, mark in marks_of(world).items():
            if mark < before.get(who, mark):
                raise BrokenError(f"{who} went back from {before[who]} to {mark}")
        for one, other in combinations(world.robots, 2):
            self._apart(world, one, other)
        sent = [(name, one) for name in names(world) for one in world.fleet.grants.of(name) or ()]
        for (a, mine), (b, others) in combinations(sent, 2):
            if a != b:
                self._proven_together(world, (a, mine), (b, others))
        slots = {one.number: one for _, one in sent}
        for robot in world.robots:
            self._robot(world, robot, slots)
        self._needs(world)

    def _apart(self, world: World, one: Robot, other: Robot) -> None:
        least = sum(world.fleet.members[robot.name].radius for robot in (one, other))
        apart = math.dist(one.pose[:2], other.pose[:2])
        if apart < least:
            raise BrokenError(f"{one.name} and {other.name} touch: {apart:.3f} m")

    def _proven_together(
        self, world: World, mine: tuple[str, Sent], others: tuple[str, Sent]
    ) -> None:
        """Prove two courses again, unless one of them counts no more."""
        grants = world.fleet.grants
        for name, sent in (mine, others):
            mine_now = grants.of(name)
            is_old = mine_now is not None and sent is mine_now.now and name in grants.given_up
            if sent.course is None or sent.is_withdrawn or is_old:
                return
        courses = [mine[1].course, others[1].course]
        every = grants._staircases.all
        key = (*map(id, courses), id(every))
        if key not in self._proven:
            stairs = grants._staircases.among([mine[1].slot, others[1].slot])
            since = [0.001 * sent.begin_ms for _, sent in (mine, others)]
            ends = [one.until for one in courses]
            part = Part(list(zip(since, ends, strict=True)), [True, False])
            driven = [one.driven for one in courses]
            flights = Flights(driven, part)
            failures = separation_failures(flights, stairs.tau_ms / 1000.0, self._margin)
            failures += staircase_failures(flights, stairs, self._margin)
            self._proven[key] = failures, courses, every
        if self._proven[key][0]:
            raise BrokenError(f"{mine[0]} and {others[0]} are not proven together")

    def _robot(self, world: World, robot: Robot, slots: dict[int, Sent]) -> None:
        agent, rule = robot.agent, world.fleet.grants._rule
        ride, coming = agent.ride, agent._coming
        is_older = agent.epoch != world.fleet.epoch
        if is_older:
            slots = {}  # Courses are numbered anew in each epoch.
        for one, number in ((ride, agent.number), (coming, agent.next_number)):
            if one is None or is_older:
                continue
            told_ms = round(1000.0 * one._told)
            if told_ms > world.log.ahead_ms:
                raise BrokenError(
                    f"{robot.name} was told {told_ms} ms, the log {world.log.ahead_ms}"
                )
            sent = slots.get(number)
            if sent is not None and told_ms > rule.told[sent.slot]:
                raise BrokenError(f"{robot.name} was told more than the coordinator knows")
        mine = world.fleet.grants.of(robot.name)
        if mine is not None and mine.next is not None:
            most = max(mine.next.begin_ms, min(rule.told[mine.now.slot], mine.next.shared_ms))
            if rule.granted[mine.next.slot] > most:
                raise BrokenError(f"{robot.name} is granted a course that it has not confirmed")
        clock, now_ns = agent.clock, world.now_ns + STEP + robot.ahead_ns
        off_ns = abs(clock.offset_ns + robot.ahead_ns)
        if not robot.has_jumped and clock.good and off_ns > clock.error_ns(now_ns):
            raise BrokenError(f"{robot.name} takes its clock for better than it is")
        if ride is not None and agent.has_driven():
            self._place(robot, ride, slots.get(agent.number), rule)

    def _place(self, robot: Robot, ride: Ride, sent: Sent | None, rule: Any) -> None:
        """Compare where a robot is with its authority, and with what is known of its progress.

        One that rested beside a path's start, within its tolerance, is as far along as it is off.
        """
        s, line = ride.follower.s, ride._timeline
        if s + robot.moved > line.s_at(ride._told) + ALONG + ride.follower.off and s > ALONG:
            raise BrokenError(f"{robot.name} has passed its authority")
        if sent is None or sent.course is None or rule.progress[sent.slot] >= EVER_MS:
            return
        there = line.s_at(rule.progress[sent.slot] / 1000.0)
        if s + robot.moved + ride._slack + ALONG < there:
            raise BrokenError(f"{robot.name} is not as far as the coordinator takes it to be")

    def _needs(self, world: World) -> None:
        """Compare what robots hold of authority with what others are known to have passed."""
        grants = world.fleet.grants
        stairs, rule = grants._staircases.all, grants._rule
        held = self._held(world)
        for pair, (ahead, behind) in enumerate(zip(stairs.ahead, stairs.behind, strict=True)):
            told_ms = held.get(int(behind))
            if told_ms is None or int(ahead) not in held or grants._numbers[behind] < 0:
                continue
            if need_at(stairs, pair, told_ms) >= rule.progress[ahead]:
                who = grants._names[behind], grants._names[ahead]
                raise BrokenError(f"{who[0]} may be where {who[1]} has yet to pass")

    def _held(self, world: World) -> dict[int, float]:
        """Return by slot the most [ms] that a robot was told to drive on a course that counts."""
        grants, found = world.fleet.grants, {}
        for name in names(world):
            for one in grants.of(name) or ():
                if not one.is_withdrawn and name not in grants.given_up:
                    found[one.slot] = max(float(grants._rule.granted[one.slot]), one.begin_ms)
        for robot in world.robots:
            agent = robot.agent
            if agent.epoch != world.fleet.epoch:
                continue
            for ride, number in (
                (agent.ride, agent.number),
                (agent._coming, agent.next_number),
            ):
                slots = np.flatnonzero(grants._numbers == number)
                if ride is not None and len(slots) and int(slots[0]) in found:
                    slot = int(slots[0])
                    found[slot] = max(found[slot], round(1000.0 * ride._told))
        return found


def names(world: World) -> list[str]:
    """Return the robots of a fleet."""
    return [robot.name for robot in world.robots]


def need_at(stairs: Staircases, pair: int, at_ms: float) -> float:
    """Return what a staircase needs at a plan time [ms], read off its knots."""
    first, last = int(stairs.first[pair]), int(stairs.first[pair + 1])
    need = -math.inf
    for knot in range(first, last):
        if stairs.at[knot] > at_ms:
            if knot > first:
                before, after = knot - 1, knot
                share = (at_ms - stairs.at[before]) / (stairs.at[after] - stairs.at[before])
                rise = float(stairs.need[after]) - float(stairs.need[before])
                return min(need + share * rise, at_ms - stairs.tau_ms)
            return need
        need = float(stairs.need[knot])
    return need
