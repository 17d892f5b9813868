"""Moves by which robots get from their starts to their goals, from place to place.

Decides: how much effort is spent on which search, and that detours are taken out again.  Must not
know: curves, speeds and times.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from coordinator.places.hub_kernels import filling_order, largest_part, leaves_open
from coordinator.places.move_kernels import (
    GAVE_UP,
    NONE,
    SOLVED,
    Array,
    Edges,
    Flags,
    Indices,
    Team,
    costs_to,
    least_moves,
    rerouted,
    some_moves,
)
from coordinator.places.place_graph import Graph

_FEW: Final = 9
_ARRANGEMENTS: Final = 100_000
"""Up to _FEW robots get the least costly moves, if these are among so many arrangements."""

_STEPS: Final = 100_000
"""LaCAM takes this many steps, divided by the number of robots."""

_STAGE_STEPS: Final = 40_000
_LEAST_STEPS: Final = 1_000
_FAILURES: Final = 40
"""The same for each robot that is tried in a stage, at least _LEAST_STEPS; _FAILURES of these may
fail in all."""

_PAST_OTHER: Final = 2.0
_PAST_BOUND: Final = 100.0
"""What it costs to choose a way past another robot, and past one at its goal: that one would have
to come back to its goal, and another robot may have taken its way by then."""

_STATES: Final = 300_000_000
_PASSES: Final = 3
"""The robots' moves are taken back and found again _PASSES times, while the number of states of
these searches is below _STATES."""


def find_moves(graph: Graph, few: int = _FEW) -> tuple[int, Indices]:
    """Return an outcome (move_kernels.py) and the moves in turn, (m, 2): robot and edge.

    Up to `few` robots get the least costly moves.
    """
    edges, team = graph.edges, graph.team
    count = len(team.start)
    if not np.isfinite(team.left[np.arange(count), team.start]).all():
        return NONE, np.empty((0, 2), np.int64)
    if count <= few:
        outcome, moves = least_moves(edges, team, _ARRANGEMENTS)
        if outcome != GAVE_UP:
            return outcome, moves
    outcome, moves = some_moves(edges, team, _STEPS // count)
    if outcome == GAVE_UP:
        outcome, moves = one_after_the_other(graph)
    return outcome, _shortened(graph, moves) if outcome == SOLVED else moves


def one_after_the_other(graph: Graph) -> tuple[int, Indices]:
    """Find moves in stages, each of which brings one more robot to its goal for good.

    In a stage the robots that are in its way move out of it first, those nearest to its goal ahead
    of the others.  They go to where they part no goal from the rest of the floor: in a lane they
    could be in its way again when it has had to let them out.
    """
    edges, team = graph.edges, graph.team
    count = len(team.start)
    steps = max(_STAGE_STEPS // count, _LEAST_STEPS)
    found = [np.empty((0, 2), np.int64)]
    at, bound = team.start.copy(), np.zeros(count, np.bool_)
    pending, failures = filling_order(edges, team).tolist(), 0
    while pending:
        for robot in pending[: _FAILURES - failures]:
            bound[robot] = True
            outcome, moves = some_moves(edges, _stage(graph, robot, at, bound), steps)
            if outcome == SOLVED:
                break
            bound[robot] = False
            failures += 1
        else:
            return GAVE_UP, moves
        pending.remove(robot)
        found.append(moves)
        for moved, edge in moves.tolist():
            at[moved] = edges.to[edge]
    return SOLVED, np.concatenate(found)


def _stage(graph: Graph, robot: int, at: Indices, bound: Flags) -> Team:
    """Return the team, at places (n,), for the stage that brings a robot to its goal."""
    edges, team = graph.edges, graph.team
    count, kind = len(at), team.kind
    # Ways that others block cost more, ways past robots at their goals most.
    blocked = np.where(bound, _PAST_BOUND, _PAST_OTHER)
    blocked[robot] = 0.0
    extra = _extra(edges, at, blocked)
    left = costs_to(team.goal[robot : robot + 1], edges, team.fits[kind[robot]], extra)
    way, here = [], int(at[robot])
    while here != team.goal[robot]:
        leaving = np.arange(edges.first[here], edges.first[here + 1])
        onward = left[edges.to[leaving]] + edges.cost[leaving] + extra[leaving]
        edge = int(leaving[onward.argmin()])
        way.append(edge)
        here = int(edges.to[edge])
    closed = np.full(len(graph.places), -1)
    for number, edge in enumerate(way):
        closed[edges.near[edges.near_first[edge] : edges.near_first[edge + 1]]] = number
    occupant = np.full(len(graph.places), -1)
    occupant[team.goal[bound]] = np.flatnonzero(bound)
    hub = largest_part(edges, team, occupant)
    occupant[team.goal[robot]] = -1
    aside = np.flatnonzero(
        hub & (closed < 0) & leaves_open(int(team.goal[robot]), hub, edges, team, occupant)
    )
    past_bound = _extra(edges, at, np.where(blocked == _PAST_BOUND, _PAST_BOUND, 0.0))
    out = [costs_to(aside, edges, fits, past_bound) for fits in team.fits]
    to_goal = bound | team.keeps
    all_left = np.array([team.left[k] if to_goal[k] else out[kind[k]] for k in range(count)])
    all_left[robot] = left
    rank = np.where(bound, 0, np.where(hub[at], 2 + closed[at], len(way) + 2))
    rank[robot] = 1
    done = np.where(bound[:, None], team.done, hub | team.keeps[:, None])
    return team._replace(start=at.copy(), left=all_left, rank=rank, done=done)


def _extra(edges: Edges, at: Indices, costs: Array) -> Array:
    """Return what each edge (e,) costs because of the robots, at places (n,), that it passes."""
    of_place = np.zeros(len(edges.first) - 1)
    of_place[at] = costs
    sums = np.append(0.0, np.cumsum(of_place[edges.near]))
    return np.asarray(sums[edges.near_first[1:]] - sums[edges.near_first[:-1]])


def _shortened(graph: Graph, moves: Indices) -> Indices:
    """Return moves in which each robot has the best ones among those of the others."""
    edges = graph.edges
    order = np.argsort(edges.near, kind="stable")
    beside = np.repeat(np.arange(len(edges.to)), np.diff(edges.near_first))[order]
    first = np.searchsorted(edges.near[order], np.arange(len(graph.places) + 1))
    spent = 0
    for _ in range(_PASSES):
        before = len(moves)
        for robot in range(len(graph.team.start)):
            spent += len(moves) * len(graph.places)
            if spent > _STATES:
                return moves
            moves = rerouted(robot, moves, edges, first, beside, graph.team)
        if len(moves) == before:
            break
    return moves
