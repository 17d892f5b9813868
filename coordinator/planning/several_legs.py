"""Paths and motions of several legs: robots make room for each other, rest there, and go on.

The search over places (coordinator/places/) gives moves in turn.  Each robot drives its moves as
one smooth path with rests where it may have to wait.  In the first schedule a robot leaves a rest
when all robots that have to be first have driven past; the usual search then improves on it.  More
than a few robots get moves by which they arrive early, and these in turn too if they may be better.

Decides: the path along a robot's moves, and the first schedule.  Must not know: how moves are
searched, the proof.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, TypeAlias

import numpy as np
import shapely
from scipy.spatial.distance import cdist

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.motion.message_room import ROOM as MESSAGE_ROOM
from coordinator.motion.message_room import expected_bytes
from coordinator.motion.velocity_profile import Motion, Wait
from coordinator.paths.end_headings import check_headings
from coordinator.paths.path_planner import Pathfinder
from coordinator.paths.smoothing import smooth_near, turned_near
from coordinator.paths.spline_fit_kernels import Flags, lengths_along
from coordinator.places.early_moves import early_moves
from coordinator.places.move_kernels import SOLVED, Indices
from coordinator.places.moves import find_moves
from coordinator.places.parting_kernels import clear_by_steps
from coordinator.places.place_graph import ROOM, Graph, place_graph
from coordinator.places.shortcuts import IsClear, Moves, straightened
from coordinator.scenario.model import Robot, Scenario
from coordinator.schedule.junctions import FEW
from coordinator.schedule.track import Track

_CUT: Final = 0.4 * ROOM
"""Corners are cut by at most this much [m], so that two robots do not use up the edges' room."""

_FINER_CUTS: Final = (0.3 * _CUT, 0.1 * _CUT, 1e-4)
"""The same [m] where a path would swing out towards robots that are as near as they may be."""

_BESIDE: Final = np.linspace(-0.08, 0.08, 33)
_SWING: Final = 1e-4
"""A path may swing out by this much [m] within this distance [m] of such a place."""

_CHORD: Final = 0.02
"""The length [m] of the chords in place of a curve that a robot has to keep to."""

_LEAD: Final = 0.5 * ROOM
"""A robot leaves a start, or reaches a goal, with a heading straight on for this much [m]."""

_STEP: Final = 0.05
"""Where a robot is out of another one's way is looked for in such steps [m]."""

_DENSITIES: Final = (1.0, 2.0, 3.0)
"""Densities of the places in between (place_graph), tried in turn for few robots."""

_MOST_PLACES: Final = 8_000
"""Graphs that would have more places are not tried after a first one: it has many already."""

_CLEARLY: Final = 0.6
"""If moves that start at times have less than this share of the sum of arrivals, moves in turn are
not driven for comparison: fewer of their places are passed, which saves less than that."""

_MOST_COMPARED: Final = 60
"""Nor are they if there are more robots than these."""

_PER_WAIT: Final = 42
"""Bytes of a message for each time that a robot waits."""

_AFTER: Final = 0.001
"""A robot leaves a rest this much later [s] than tau after others have passed."""


@dataclass(frozen=True)
class Leg:
    """A robot's move: its place in the turn of all moves, its way (n, 2) [m], who goes before.

    `after`: for each robot that has to be first, its last leg (by number) that has to be, and how
    far [m] along it this robot is out of the way.
    """

    turn: int
    way: Array
    after: dict[int, tuple[int, float]]


@dataclass(frozen=True, eq=False)
class Legs:
    """A robot's path, and where [m] on it each of its legs ends; `rests`: where it may wait."""

    path: Nurbs
    legs: list[Leg]
    ends: list[float]
    rests: list[int]

    def begin(self, number: int) -> float:
        """Return where [m] a leg begins."""
        return self.ends[number - 1] if number else 0.0


def keeping_robots(scenario: Scenario) -> list[int]:
    """Return the robots (by index) that keep to one way: nobody makes them step aside."""
    return [
        index
        for index, robot in enumerate(scenario.robots)
        if robot.path is not None or robot.via or robot.min_turn_radius > 0.0
    ]


def find_legs(
    scenario: Scenario, finder: Pathfinder, tau: float
) -> Iterator[tuple[list[Legs], bool]]:
    """Yield paths of several legs for all robots, if moves are found: a choice, or two of them.

    Beside them, whether they are clearly better than those that come after them.

    Moves of which a robot has no room to drive one are left out.  For few robots more places are
    tried if there are no paths between fewer.
    """
    radii = [robot.radius for robot in scenario.robots]
    kept = _own_ways(scenario, finder)
    ways = {index: one.parts for index, one in kept.items()}
    places = 0
    for density in _DENSITIES if len(radii) <= FEW else _DENSITIES[:1]:
        if places * density**2 > _MOST_PLACES:
            return
        graph = place_graph(scenario, finder.floor, radii, density, ways)
        if graph is None:
            continue
        places = places or len(graph.places)
        found = False
        for choice in _find_on(graph, scenario, finder, tau, kept):
            found = True
            yield choice
        if found:
            return


def _own_ways(scenario: Scenario, finder: Pathfinder) -> dict[int, _OwnWay]:
    """Return the ways of the robots that keep to one, by index."""
    robots = scenario.robots
    return {
        index: _OwnWay.along(finder.path(index), robots[index].radius)
        for index in keeping_robots(scenario)
    }


def _find_on(
    graph: Graph,
    scenario: Scenario,
    finder: Pathfinder,
    tau: float,
    kept: Mapping[int, _OwnWay],
) -> Iterator[tuple[list[Legs], bool]]:
    """Yield paths of several legs between the places of a graph, as `find_legs` does."""
    outcome, found = find_moves(graph)
    if outcome != SOLVED:
        return
    spaces = [finder.space(robot) for robot in scenario.robots]

    def is_clear(robot: int, start: Array, end: Array) -> bool:
        return robot not in kept and bool(spaces[robot].keeping(start[None], end[None])[0])

    if len(spaces) > FEW and len(graph.team.need) == 1:
        with suppress(PlanError):
            yield _moving_early(graph, found, scenario, finder, tau, kept, is_clear)
    with suppress(PlanError):
        yield _legs(scenario, finder, straightened(_driven(graph, found), is_clear), kept), True


def _moving_early(
    graph: Graph,
    found: Indices,
    scenario: Scenario,
    finder: Pathfinder,
    tau: float,
    kept: Mapping[int, _OwnWay],
    is_clear: IsClear,
) -> tuple[list[Legs], bool]:
    """Return paths along moves (m, 2) that begin as early as they can, as `find_legs` yields them.

    Robots whose paths would be too long for a message pass fewer places: they then wait longer for
    each other.  Raises PlanError if a robot has no room to drive its moves.
    """
    speed = max(scenario.planned_speed(robot) for robot in scenario.robots)
    early, share, waits = early_moves(graph, found, speed * tau)
    moves = _driven(graph, early)
    legs = _legs(scenario, finder, moves, kept)
    each = zip(legs, scenario.robots, waits.tolist(), strict=True)
    long = {k for k, one in enumerate(each) if _is_long(*one)}
    if long:
        fewer = straightened(
            moves, lambda robot, start, end: robot in long and is_clear(robot, start, end)
        )
        legs = _legs(scenario, finder, fewer, kept)
    return legs, share < _CLEARLY or len(legs) > _MOST_COMPARED


def _is_long(legs: Legs, robot: Robot, waits: int) -> bool:
    """Return whether a message may have no room for a robot's path, speeds and waits."""
    needed = expected_bytes(len(legs.path.points), math.isfinite(robot.max_lateral_accel))
    return needed + _PER_WAIT * waits > MESSAGE_ROOM


def _legs(
    scenario: Scenario, finder: Pathfinder, moves: Moves, kept: Mapping[int, _OwnWay]
) -> list[Legs]:
    """Return paths along moves; raises PlanError if a robot has no room to drive its moves."""
    in_turn, tight = enumerate(zip(scenario.robots, _in_turn(moves), strict=True)), _tight(scenario)
    return [
        kept[index].driven(legs) if index in kept else _along(robot, finder, index, legs, tight)
        for index, (robot, legs) in in_turn
    ]


Tight: TypeAlias = dict[tuple[float, float], Array]
"""Starts and goals (x, y) [m] that are hardly farther apart than robots at them have to be; for
each, the others that are near (k, 3): x, y, and what a robot's centre keeps from them besides its
radius [m].  Elsewhere edges have ROOM to spare."""


def _tight(scenario: Scenario) -> Tight:
    ends = np.array([place[:2] for one in scenario.robots for place in (one.start, one.goal)])
    radii = np.repeat([one.radius for one in scenario.robots], 2)
    apart, need = cdist(ends, ends), radii[:, None] + radii + scenario.margin + ROOM
    near = (apart > 0.0) & (apart < need)
    reaches = np.column_stack((ends, radii + scenario.margin))
    return {
        (float(x), float(y)): reaches[others]
        for (x, y), others in zip(ends, near, strict=True)
        if others.any()
    }


def _driven(graph: Graph, found: Indices) -> Moves:
    """Return moves (m, 2), robot and edge, as moves along ways."""
    kind, need = graph.team.kind, graph.team.need
    return Moves(
        found[:, 0].tolist(),
        [graph.ways[edge] for edge in found[:, 1].tolist()],
        graph.places[graph.team.start],
        need[kind[:, None], kind[None, :]],
    )


def first_motions(all_legs: Sequence[Legs], tracks: Sequence[Track], tau: float) -> list[Motion]:
    """Return motions in which each robot waits until those that go before it have passed."""
    driven: list[list[Motion]] = [[] for _ in all_legs]
    waits: list[list[Wait]] = [[] for _ in all_legs]
    onwards = [Motion(track.limits, []) for track in tracks]
    turns = sorted(
        (leg.turn, robot, number)
        for robot, legs in enumerate(all_legs)
        for number, leg in enumerate(legs.legs)
    )
    for _, robot, number in turns:
        legs, limits = all_legs[robot], tracks[robot].limits
        if number and number not in legs.rests:
            continue
        depart = _AFTER
        for other, (last, along) in legs.legs[number].after.items():
            theirs = all_legs[other]
            clear = min(theirs.begin(last) + along, theirs.ends[last])
            free = float(driven[other][last].reached(np.array([clear]))[0])
            depart = max(depart, free + tau + _AFTER)
        # A robot that does not wait here may come here sooner than one that stops later on.
        s = np.array([legs.begin(number)])
        # Where a robot is later depends on its last wait alone.
        if float(onwards[robot].reached(s)[0]) < depart:
            here = float(driven[robot][-1].reached(s)[0]) if number else 0.0
            waits[robot].append(Wait(float(s[0]), max(depart, here), -1))
            onwards[robot] = Motion(limits, waits[robot][-1:])
        rest = next((rest for rest in legs.rests if rest > number), len(legs.legs))
        motion = onwards[robot]
        if rest < len(legs.legs):
            motion = Motion(limits, [*waits[robot][-1:], Wait(legs.begin(rest), 0.0, -1)])
        driven[robot] += [motion] * (rest - number)
    return [Motion(track.limits, w) for track, w in zip(tracks, waits, strict=True)]


def _in_turn(moves: Moves) -> list[list[Leg]]:
    """Return each robot's legs, with those legs of others that have to be driven before."""
    ways, robots = [np.ascontiguousarray(way) for way in moves.ways], moves.robots
    lines = shapely.linestrings(
        np.concatenate(ways) if ways else np.empty((0, 2)),
        indices=np.repeat(np.arange(len(ways)), [len(way) for way in ways]),
    )
    tree, whose = shapely.STRtree(lines), np.array(robots, dtype=np.int64)
    one, other = tree.query(lines, predicate="dwithin", distance=float(moves.need.max()))
    chosen = (other < one) & (whose[one] != whose[other])
    one, other = one[chosen], other[chosen]
    near = shapely.distance(lines[one], lines[other]) < moves.need[whose[one], whose[other]]
    before: list[list[int]] = [[] for _ in ways]
    for late, early in zip(one[near].tolist(), other[near].tolist(), strict=True):
        before[late].append(early)
    found: list[list[Leg]] = [[] for _ in moves.starts]
    numbers: list[int] = []
    known: list[dict[int, tuple[int, float]]] = [{} for _ in moves.starts]
    for turn, robot in enumerate(robots):
        after: dict[int, tuple[int, float]] = {}
        latest = {robots[early]: early for early in sorted(before[turn])}
        for first, early in latest.items():
            number, so_far = numbers[early], known[robot].get(first, (-1, 0.0))
            if number >= so_far[0]:
                need = float(moves.need[robot, first])
                clear = clear_by_steps(ways[early], ways[turn], need, _STEP)
                if (number, clear) > so_far:
                    known[robot][first] = after[first] = number, clear
        numbers.append(len(found[robot]))
        found[robot].append(Leg(turn, ways[turn], after))
    return found


@dataclass(frozen=True, eq=False)
class _OwnWay:
    """The path of a robot that keeps to it, in `parts` (n, 2) [m]; `ends` [m]: where these end."""

    path: Nurbs
    parts: list[Array]
    ends: list[float]

    @classmethod
    def along(cls, path: Nurbs, size: float) -> _OwnWay:
        """Cut a path into equal parts, two or more, each at most `size` [m] long."""
        marks = np.linspace(0.0, path.length, 1 + max(math.ceil(path.length / size), 2))
        steps = 1 + math.ceil(marks[1] / _CHORD)
        parts = [path.at_arc(np.linspace(a, b, 1 + steps)) for a, b in pairwise(marks)]
        return cls(path, parts, marks[1:].tolist())

    def driven(self, legs: list[Leg]) -> Legs:
        """Return the path with a robot's legs, one along each part."""
        return Legs(self.path, legs, self.ends, _rests(legs))


def _rests(legs: Sequence[Leg]) -> list[int]:
    """Return the legs (by number) before which a robot may have to wait for others."""
    return [number for number, leg in enumerate(legs) if number and leg.after]


def _along(
    robot: Robot,
    finder: Pathfinder,
    index: int,
    legs: list[Leg],
    tight: Tight,
) -> Legs:
    """Return the path along a robot's legs; a robot without legs keeps its place."""
    if not legs:
        return Legs(finder.path(index), [], [], [])
    rests, headed = _rests(legs), (len(robot.start) == 3, len(robot.goal) == 3)
    vertices = np.concatenate([legs[0].way[:1], *(leg.way[1:] for leg in legs)])
    last = np.cumsum([len(leg.way) - 1 for leg in legs])
    if headed[0]:
        vertices = np.insert(vertices, 1, _beside(robot.start, _LEAD), axis=0)
        last += 1
    if headed[1]:
        vertices = np.insert(vertices, -1, _beside(robot.goal, -_LEAD), axis=0)
        last[-1] += 1
    exact = np.zeros(len(vertices), dtype=np.bool_)
    exact[[0, -1, *(int(last[rest - 1]) for rest in rests)]] = True
    space, cuts = finder.space(robot), dict.fromkeys(tight, _CUT)
    polygon, passed = turned_near(vertices, exact, space, tight, headed)
    curve, u = smooth_near(polygon, passed, space, _CUT, cuts)
    for cut in _FINER_CUTS:
        swings = _swings_at(robot, curve, u, vertices, exact, tight)
        if not swings:
            break
        cuts |= dict.fromkeys(swings, cut)
        curve, u = smooth_near(polygon, passed, space, _CUT, cuts)
    check_headings(robot, curve)
    along = lengths_along(vertices)
    ends = np.interp(along[last], along[exact], curve.arc_at(u))
    return Legs(curve, legs, ends.tolist(), rests)


def _swings_at(
    robot: Robot, curve: Nurbs, u: Array, vertices: Array, exact: Flags, tight: Tight
) -> list[tuple[float, float]]:
    """Return the tight places at which a path comes too near to others, and its polygon does not.

    u: the parameters at which the path passes the exact vertices of its polygon (n, 2) [m].
    """
    found, along = [], lengths_along(vertices)
    for k, here in zip(np.flatnonzero(exact).tolist(), u.tolist(), strict=True):
        x, y = vertices[k].tolist()
        others = tight.get((x, y))
        if others is None:
            continue
        way = np.column_stack([np.interp(along[k] + _BESIDE, along, axis) for axis in vertices.T])
        path = curve.derivatives(np.clip(here + _BESIDE, curve.knots[0], curve.knots[-1]), 0)[0]
        apart, planned = (cdist(one, others[:, :2]).min(axis=0) for one in (path, way))
        if (apart < np.minimum(others[:, 2] + robot.radius, planned) - _SWING).any():
            found.append((x, y))
    return found


def _beside(pose: Sequence[float], ahead: float) -> tuple[float, float]:
    """Return the place [m] that lies `ahead` [m] of a pose with a heading."""
    x, y, heading = pose
    return x + ahead * math.cos(heading), y + ahead * math.sin(heading)
