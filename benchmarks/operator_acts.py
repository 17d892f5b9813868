"""What operators say and which faults strike in small halls, aimed at changes of robots' courses.

An adversary looks at the fleet as it drives.  It draws acts at random moments, and others for when
a search begins, a course is committed, or a robot is given up, lost, back or at its goal: at once,
mostly within half a second, at most 3 s later.

Decides: the halls, the acts, and the moments.  Must not know: how acts are carried out, and what a
run is judged by.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from random import Random
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from coordinator.fleet.member import Member
from coordinator.scenario.checks import find_problems
from coordinator.scenario.model import Robot, Scenario, Workspace, usual_turn_rate
from protocol.messages import GO_ON, HALT, Block, Cancel, Join, Leave, Order, Tell, Unblock
from protocol.phases import DONE
from protocol.timing import SECOND
from sim.world.fault_script import KINDS
from sim.world.fault_text import Fault
from sim.world.virtual_fleet import World

_SIZES: Final = ((14.0, 8.0), (9.0, 6.0), (12.0, 4.0), (8.0, 8.0))
_AT_ONCE: Final = 0.02
"""A program that is started again after this time [s] has a link that is never seen gone."""
_EDGE: Final = 0.7
"""Robots are wanted, and stand, no nearer than this [m] to the walls."""
_APART: Final = 2.5
"""A robot is carried to a place this far [m] from others, and from where these were let drive: they
have time to hear of it."""
_MOST: Final = {"cut": 20.0, "stall": 30.0, "hang": 12.0, "slow": 0.9}
"""Longer [s] than other campaigns draw them: robots are lost, and given up, meanwhile.  A robot
that keeps less than a tenth of its speed is as good as one that stands."""
_OF_ROBOTS: Final = tuple(kind for kind in KINDS if not kind.startswith("coordinator-"))
_OF_COORDINATORS: Final = tuple(kind for kind in KINDS if kind.startswith("coordinator-"))

_AT_CHANGES: Final = {
    "faults": 45,
    "close": 15,
    "coordinator": 10,
    "order": 10,
    "halt": 5,
    "restart": 5,
    "admit": 5,
    "rejoin": 5,
}
_AT_LOSSES: Final = {
    "close": 20,
    "close goal": 15,
    "coordinator": 15,
    "order": 10,
    "restart": 10,
    "halt": 10,
    "crowd": 10,
    "faults": 10,
    "admit": 10,
    "rejoin": 5,
}
_AIMS: Final[Mapping[str, tuple[float, Mapping[str, int]]]] = {
    "search": (0.08, _AT_CHANGES),
    "commit": (0.12, _AT_CHANGES),
    "give-up": (0.6, _AT_LOSSES),
    "loss": (0.5, _AT_LOSSES),
    "return": (0.3, _AT_LOSSES),
    "arrival": (0.06, {"leave": 30, "close": 30, "faults": 30, "rejoin": 10}),
}
"""By moment: the probability of an act there, in a run of mean density, and the odds of each."""

_Place: TypeAlias = tuple[float, float]
_Pose: TypeAlias = tuple[float, float, float]


class Style(NamedTuple):
    """What robots can do: lengths [m], speeds [m/s], accelerations [m/s^2]."""

    max_speed: float = 0.8
    max_accel: float = 0.8
    min_turn_radius: float = 0.0


_STYLES: Final = (
    Style(),
    Style(),
    Style(0.2, 0.3),
    Style(1.5, 1.0),
    Style(min_turn_radius=0.2),
    Style(min_turn_radius=0.4),
    Style(max_accel=math.inf),
)


class Admission(NamedTuple):
    """An operator lets a robot take part again."""

    robot: str


class Carry(NamedTuple):
    """A robot whose program is down is carried to a pose (x, y [m], heading [rad]) and started."""

    robot: str
    pose: _Pose


class NewFloor(NamedTuple):
    """The floor has these obstacles when the coordinator is started again next."""

    obstacles: tuple[tuple[_Place, ...], ...]


_APART: Final = 1.6
"""A box is put on the floor only so far [m] from robots and their starts."""

Said: TypeAlias = Order | Cancel | Block | Unblock | Tell | Join | Leave | Admission
Act: TypeAlias = Said | Carry | NewFloor | Fault
Script: TypeAlias = list[tuple[float, Act]]
"""Acts and when they happen [s since the first GO]."""


def hall(dice: Random) -> Scenario:
    """Return a small hall, some with a wall and a door in it, where 3 to 7 robots are idle."""
    while True:
        width, height = dice.choice(_SIZES)
        walls: list[tuple[_Place, ...]] = []
        if dice.random() < 0.4:
            x, door = width / 2.0, dice.uniform(1.2, height - 1.2)
            walls = [_box(x, y, 0.1, half) for y, half in _beside(door, height)]
        places: list[_Place] = []
        count = dice.randint(3, 7)
        while len(places) < count:
            place = _spot(dice, width, height)
            if all(math.dist(place, one) > 1.0 for one in places):
                places.append(place)
        robots = tuple(_robot(dice, f"R{k}", place) for k, place in enumerate(places, start=1))
        floor = Workspace(
            boundary=_box(width / 2.0, height / 2.0, width / 2.0, height / 2.0),
            obstacles=tuple(walls),
        )
        tau: float | Literal["auto"] = dice.choice((0.3, 0.3, "auto"))
        made = Scenario(name="hall", workspace=floor, robots=robots, tau=tau)
        if not find_problems(made):
            return made


def _beside(door: float, height: float) -> list[tuple[float, float]]:
    """Return the middle and half the length [m] of the walls on both sides of a door."""
    below, above = door - 0.7, door + 0.7
    return [(below / 2.0, below / 2.0), ((above + height) / 2.0, (height - above) / 2.0)]


def _box(x: float, y: float, a: float, b: float) -> tuple[_Place, ...]:
    """Return the rectangle about x, y with the half sides a, b [m]."""
    return (x - a, y - b), (x + a, y - b), (x + a, y + b), (x - a, y + b)


def _spot(dice: Random, width: float, height: float) -> _Place:
    x, y = dice.uniform(_EDGE, width - _EDGE), dice.uniform(_EDGE, height - _EDGE)
    return round(x, 2), round(y, 2)


def _robot(dice: Random, name: str, place: _Place) -> Robot:
    style = dice.choice(_STYLES)
    heading = (round(dice.uniform(-3.0, 3.0), 2),) if style.min_turn_radius else ()
    return Robot(
        id=name,
        start=(*place, *heading),
        goal=(*place, *heading),
        radius=dice.choice((0.2, 0.2, 0.3)),
        max_lateral_accel=style.max_accel,
        max_turn_rate=usual_turn_rate(style.max_accel),
        **style._asdict(),
    )


def _join_of(robot: Robot, pose: _Pose) -> Join:
    """Return what takes a robot into the fleet that stands at a pose."""
    accel = 0.0 if math.isinf(robot.max_accel) else robot.max_accel
    turn_radius = robot.min_turn_radius
    return Join(9, robot.id, pose, robot.radius, robot.max_speed, accel, turn_radius)


class Floors:
    """Draws floors that change, and more coordinators that are started again for that."""

    def __init__(self, dice: Random, world: World, scenario: Scenario) -> None:
        self._dice, self._world, self._scenario = dice, world, scenario
        self._often = dice.choice((0.0, 0.003, 0.01))
        """How often a coordinator is started again, per look."""

    def with_new(self, acts: list[Act], now: float, until: float) -> list[Act]:
        """Return these acts at a time [s since the first GO], and those that are drawn beside."""
        if now < until and self._dice.random() < self._often:
            away = self._dice.choice((0.02, 0.2, 1.0, 3.0))
            acts = [*acts, Fault("coordinator-restart", "", round(now, 2), away)]
        if any(isinstance(one, Fault) and one.kind == "coordinator-restart" for one in acts):
            acts = [*self._new(), *acts]
        return acts

    def _new(self) -> list[Act]:
        """Return a floor half of the time: the scenario's, or with a box that is near nobody."""
        if self._dice.random() < 0.5:
            return []
        floor = self._scenario.workspace
        obstacles = tuple(tuple(one) for one in floor.obstacles)
        width, height = floor.boundary[2]
        place, size = _spot(self._dice, width, height), self._dice.choice((0.1, 0.3))
        near = [(robot.body.x, robot.body.y) for robot in self._world.robots.values()]
        near += [robot.start[:2] for robot in self._scenario.robots]
        if all(math.dist(place, one) > _APART for one in near):
            obstacles = (*obstacles, _box(*place, size, size))
        return [NewFloor(obstacles)]


class Adversary:
    """Draws acts for the fleet of a world; times are in seconds since the first GO."""

    def __init__(self, dice: Random, world: World, scenario: Scenario) -> None:
        self._dice, self._world = dice, world
        self._robots = {robot.id: robot for robot in scenario.robots}
        self._size = scenario.workspace.boundary[2]
        self._density = dice.choice((0.8, 1.1, 1.5))
        self._now = 0.0
        self._coming: list[tuple[float, int, Act]] = []
        self._carried: dict[str, _Pose] = {}
        """Where robots were carried that have not said yet that they stand there."""
        self._seen: set[tuple[str, str, int]] = set()
        self._count = 0

    def due(self, now: float, begins: bool) -> list[Act]:
        """Return the acts that are due; draw more of them if it still `begins` any."""
        self._now = now
        if begins:
            self._draw()
            for name in self._robots:
                member = self._world.fleet.members.get(name)
                if member is None:
                    self._take_back(name)
                else:
                    self._aim(member)
        for name, pose in list(self._carried.items()):
            place = self._world.fleet.members[name].came_back_to
            if place is not None and math.dist(place[:2], pose[:2]) < _EDGE:
                del self._carried[name]
        self._coming.sort(key=lambda one: one[:2])
        due = [one for one in self._coming if one[0] <= now and not self._waits(one[2])]
        self._coming = [one for one in self._coming if one not in due]
        return [act for _, _, act in due]

    def _waits(self, act: Act) -> bool:
        """Return whether an act would strike where nobody could know that a robot is there."""
        return isinstance(act, Fault) and act.robot in self._carried

    def _draw(self) -> None:
        """Draw acts that are not aimed at anything."""
        dice, names = self._dice, list(self._robots)
        if dice.random() < 0.005 * self._density * len(names):
            self._order(dice.choice(["", *names, *names]), now=dice.random() < 0.4)
        if dice.random() < 0.004:
            self._close(self._spot())
        if dice.random() < 0.004:
            self._fault(dice.choice(_OF_ROBOTS), dice.choice(names))
        if dice.random() < 0.002:
            self._halt()
        if dice.random() < 0.002:
            self._fault(dice.choice(_OF_COORDINATORS))

    def _take_back(self, robot: str) -> None:
        if self._dice.random() < 0.02:
            self._later(0.0, _join_of(self._robots[robot], self._pose()))

    def _aim(self, member: Member) -> None:
        """Draw acts for what has just happened to a robot, and carry it if its program is down."""
        for moment, number in self._moments(member):
            mark = (moment, member.id, number)
            if mark not in self._seen:
                self._seen.add(mark)
                chance, odds = _AIMS[moment]
                if self._dice.random() < chance * self._density:
                    (act,) = self._dice.choices(list(odds), list(odds.values()))
                    self._strike(act, member.id)
        mark = ("carry", member.id, member.boot or 0)
        is_down = member.gone and self._world.robots[member.id].dead
        if is_down and mark not in self._seen and self._dice.random() < 0.05:
            self._seen.add(mark)
            self._carry(member.id)

    def _moments(self, member: Member) -> Iterator[tuple[str, int]]:
        """Yield what has happened to a robot, and a number that is another one the next time."""
        fleet, name = self._world.fleet, member.id
        mine = fleet.grants.of(name)
        latest = -1 if mine is None else mine.newest.revision
        if self._world.mission.dispatcher.searches.has(name):
            yield "search", latest
        if mine is not None and mine.next is not None:
            yield "commit", latest
        if name in fleet.grants.given_up:
            yield "give-up", latest
        if member.lost:
            yield "loss", int(self._now / 10.0)
        if member.came_back_to is not None:
            yield "return", member.boot or 0
        if member.has_arrived:
            yield "arrival", latest

    def _strike(self, act: str, robot: str) -> None:
        """Plan an act, by its name in _AIMS, at a robot, soon or at once."""
        dice, mine = self._dice, self._world.fleet.grants.of(robot)
        after = dice.choice(
            (0.0, dice.uniform(0.0, 0.5), dice.uniform(0.0, 0.5), dice.uniform(0, 3))
        )
        x, y = here = self._place(robot)
        match act:
            case "faults":
                for _ in range(dice.randint(1, 2)):
                    self._fault(dice.choice(_OF_ROBOTS), robot, after)
            case "close":
                self._close(here, after)
            case "close goal":
                course = None if mine is None else mine.newest.course
                self._close(here if course is None else course.goal, after)
            case "coordinator":
                self._fault(dice.choice(_OF_COORDINATORS), "", after)
            case "order":
                self._order(robot, after, now=True)
            case "restart":
                self._fault("restart", robot, after)
            case "halt":
                self._halt(after)
            case "crowd":
                for k in range(2):
                    self._order(dice.choice(list(self._robots)), after + k, about=(x, y))
            case _:
                self._attend(act, robot, after)

    def _attend(self, act: str, robot: str, after: float) -> None:
        """Let an operator take a robot out or in."""
        match act:
            case "leave":
                self._later(0.0, Leave(9, robot))
            case "admit":
                self._later(after, Admission(robot))
            case "rejoin":
                self._rejoin(robot)

    def _later(self, after: float, act: Act) -> None:
        self._count += 1
        self._coming.append((self._now + after, self._count, act))

    def _order(
        self, robot: str, after: float = 0.0, *, now: bool = False, about: _Place | None = None
    ) -> None:
        """Send a robot, "" for any, somewhere, or near a place [m]; some orders are taken back."""
        dice, name = self._dice, f"o{self._count}"
        goal = self._spot()
        if about is not None:
            goal = (
                round(about[0] + dice.uniform(-1, 1), 2),
                round(about[1] + dice.uniform(-1, 1), 2),
            )
        self._later(after, Order(9, name, goal, robot, now=now))
        if dice.random() < 0.2:
            self._later(after + dice.uniform(0.05, 6.0), Cancel(9, name))

    def _close(self, about: Sequence[float], after: float = 0.0) -> None:
        """Close a square near a place [m], and open it again."""
        dice = self._dice
        name = dice.choice((f"b{self._count}", "b"))  # Other places had the same name before.
        x, y = (coordinate + dice.uniform(-0.5, 0.5) for coordinate in about[:2])
        half = dice.choice((0.1, 0.25, 0.6))
        self._later(after, Block(9, name, _box(x, y, half, half)))
        self._later(after + dice.uniform(0.2, 25.0), Unblock(9, name))

    def _halt(self, after: float = 0.0) -> None:
        self._later(after, Tell(9, HALT))
        self._later(after + self._dice.uniform(0.1, 5.0), Tell(9, GO_ON))

    def _fault(self, kind: str, robot: str = "", after: float = 0.0) -> None:
        """Let a fault strike; a robot that is started again is let in some time later, or never."""
        dice, (least, most) = self._dice, KINDS[kind].drawn
        value = round(dice.uniform(least, _MOST.get(kind, most)), 2)
        if kind == "clock-jump":
            value *= dice.choice((-1, 1))
        if kind == "restart" and dice.random() < 0.3:
            value = _AT_ONCE
        self._later(after, Fault(kind, robot, round(self._now + after, 2), value))
        if kind == "restart":
            for _ in range(dice.randint(0, 6)):
                self._later(after + value + dice.uniform(0.5, 12.0), Admission(robot))

    def _rejoin(self, robot: str) -> None:
        """Take a robot that stands out, in again at that place, and start its program anew."""
        dice, inhabitant = self._dice, self._world.robots[robot]
        pose = inhabitant.body.true_pose()
        is_at_rest = inhabitant.dead or inhabitant.service.agent.phase == DONE
        if inhabitant.hung or not is_at_rest or inhabitant.body.speed > 0.0 or pose is None:
            return
        self._later(0.0, Leave(9, robot))
        self._later(dice.choice((0.0, 0.05, 0.4)), _join_of(self._robots[robot], pose))
        self._later(dice.uniform(0.0, 1.0), Fault("restart", robot, round(self._now, 2), _AT_ONCE))

    def _carry(self, robot: str) -> None:
        """Carry a robot to a place far from others; then faults and orders for others follow.

        Nothing strikes before it has been let in, and nothing strikes it before it has said where
        it is: nobody could know that it is there.
        """
        dice, pose = self._dice, self._pose()
        others = [name for name in self._robots if name != robot]
        is_near = any(
            math.dist(pose[:2], place) < _APART for name in others for place in self._bounds(name)
        )
        if is_near or self._is_unheard(robot):
            return
        self._coming = [one for one in self._coming if not isinstance(one[2], Fault)]
        self._later(0.0, Carry(robot, pose))
        self._carried[robot] = pose
        for after in (0.65, 1.2, 3.0, 6.0):
            self._later(after, Admission(robot))
        soon = 0.65 + dice.uniform(0.0, 1.5)
        if dice.random() < 0.5:
            self._fault(dice.choice(_OF_ROBOTS), robot, soon)
        if dice.random() < 0.15:
            self._fault("coordinator-restart", "", soon)
        for _ in range(2):
            self._order(dice.choice(others), soon + dice.uniform(0.0, 12.0), about=pose[:2])

    def _is_unheard(self, robot: str) -> bool:
        """Return whether the coordinator could not hear a program of a robot that begins now."""
        now_ns = self._world.now_ns
        return any(
            one.fault.kind in ("cut", *_OF_COORDINATORS)
            and one.fault.robot in ("", robot)
            and now_ns < one.now_ns + one.fault.value * SECOND
            for one in self._world.struck
        )

    def _place(self, robot: str) -> _Place:
        """Return where a robot truly is [m]."""
        body = self._world.robots[robot].body
        return body.x, body.y

    def _bounds(self, robot: str) -> Iterator[_Place]:
        """Yield where a robot truly is [m], and the ends of what it was let drive."""
        yield self._place(robot)
        mine, spans = self._world.fleet.grants.of(robot), self._world.fleet.spans(robot)
        for one, span in zip(mine or (), spans, strict=False):
            if one.course is not None:
                ride = one.course.driven
                end = float(ride.timeline.s_at(span.until_ms / 1000.0))
                yield tuple(ride.curve.at_arc(np.array([end]))[0].tolist())

    def _spot(self) -> _Place:
        return _spot(self._dice, *self._size)

    def _pose(self) -> _Pose:
        """Return a random pose in one half of the hall, away from a wall in its middle."""
        while True:
            x, y = self._spot()
            if abs(x - self._size[0] / 2.0) > 0.6:
                return x, y, round(self._dice.uniform(-3.0, 3.0), 2)
