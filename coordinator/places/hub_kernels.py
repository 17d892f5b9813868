"""Compiled: the largest free part of a graph of places, and goals that can be filled from it.

Robots at rest part the places.  While some are at their goals, the others can still get past each
other in the largest part that is left, the hub.

Decides: which part is the hub, where a robot parts a goal from it, and in which order goals can be
filled.  Must not know: how moves are searched.
"""

from __future__ import annotations

import math

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.places.move_kernels import Edges, Flags, Indices, Team, in_the_way, who_closes


@compiled
def filling_order(edges: Edges, team: Team) -> Indices:
    """Return the robots (n,) in an order in which they can fill their goals.

    From the last one on: a robot comes after all others if it can get to its goal, from the largest
    connected part of the free places, when these are at theirs.  Of robots of which none can, as in
    a puzzle, the one with the shortest way comes last.
    """
    count, places = len(team.start), len(edges.first) - 1
    order = np.empty(count, np.int64)
    occupant = np.full(places, -1)
    for robot in range(count):
        occupant[team.goal[robot]] = robot
    for last in range(count - 1, -1, -1):
        hub = largest_part(edges, team, occupant)
        chosen, best = -1, math.inf
        for robot in range(count):
            goal = team.goal[robot]
            if occupant[goal] != robot:
                continue
            reached = _is_reached(goal, robot, hub, edges, team, occupant)
            way = team.left[robot, team.start[robot]] + (0.0 if reached else 1e9)
            if way < best:
                chosen, best = robot, way
        order[last] = chosen
        occupant[team.goal[chosen]] = -1
    return order


@compiled
def _is_reached(
    goal: int, robot: int, hub: Flags, edges: Edges, team: Team, occupant: Indices
) -> bool:
    """Return whether a robot can get to a goal from the hub, which ends beside its own place."""
    seen = np.zeros(len(hub), np.bool_)
    seen[goal] = True
    queue = [goal]
    while queue:
        here = queue.pop()
        if hub[here]:
            return True
        for e in range(edges.first[here], edges.first[here + 1]):
            to, inwards = edges.to[e], edges.back[e]
            if seen[to] or not team.fits[team.kind[robot], inwards]:
                continue
            if in_the_way(robot, inwards, edges, team, occupant) < 0:
                seen[to] = True
                queue.append(to)
    return False


@compiled
def _largest_kind(team: Team) -> int:
    """Return the kind of the largest robots among those that may drive anywhere."""
    largest = 0
    for robot in range(len(team.kind)):
        larger = team.need[team.kind[robot], 0] > team.need[team.kind[largest], 0]
        if not team.keeps[robot] and (larger or team.keeps[largest]):
            largest = robot
    return int(team.kind[largest])


@compiled
def _open_edges(edges: Edges, team: Team, occupant: Indices) -> Flags:
    """Return which edges (e,) the largest robots can pass beside robots at rest."""
    kind = _largest_kind(team)
    found = np.empty(len(edges.to), np.bool_)
    for e in range(len(found)):
        is_free = occupant[edges.to[e]] < 0 and team.fits[kind, e]
        found[e] = is_free and who_closes(e, kind, -1, edges, team, occupant) < 0
    return found


@compiled
def largest_part(edges: Edges, team: Team, occupant: Indices) -> Flags:
    """Return which places (V,) make up the largest part that is connected past robots at rest.

    It is connected for the largest robots that may drive anywhere.
    """
    places, passable = len(edges.first) - 1, _open_edges(edges, team, occupant)
    part = np.full(places, -1)
    hub, most = -1, 0
    for v in range(places):
        if part[v] >= 0 or occupant[v] >= 0:
            continue
        queue, size = [v], 0
        part[v] = v
        while queue:
            here = queue.pop()
            size += 1
            for e in range(edges.first[here], edges.first[here + 1]):
                to = edges.to[e]
                if passable[e] and part[to] < 0:
                    part[to] = v
                    queue.append(to)
        if size > most:
            hub, most = v, size
    return np.asarray(part == hub)


@compiled
def leaves_open(goal: int, hub: Flags, edges: Edges, team: Team, occupant: Indices) -> Flags:
    """Return at which places of the hub (V,) a robot does not part a goal from most of the hub.

    Robots at `occupant` (V,) do not move.
    """
    places, kind = len(hub), _largest_kind(team)
    passable, need = _open_edges(edges, team, occupant), team.need[kind, kind]
    size, total = _behind(goal, hub, edges, passable), hub.sum()
    from_goal = hub[goal] + size[edges.first[goal] : edges.first[goal + 1]].sum()
    # By place: how much of the hub may lie behind the edges that a robot there closes.
    behind = np.zeros(places, np.int64)
    for e in range(len(edges.to)):
        for k in range(edges.near_first[e], edges.near_first[e + 1]):
            if size[e] > 0 and edges.gap[k] < need:
                behind[edges.near[k]] += size[e]
    found = hub.copy()
    found[goal] = False
    reached = np.full(places, -1)
    for place in range(places):
        if found[place] and 2 * (from_goal - behind[place]) <= total:
            found[place] = (
                2 * _reached_past(place, goal, hub, edges, passable, need, reached) > total
            )
    return found


@compiled
def _behind(goal: int, hub: Flags, edges: Edges, passable: Flags) -> Indices:
    """Return how many places of the hub one comes to from a goal along an edge (e,) of a tree.

    0 for all edges that do not belong to the tree of the fewest edges from the goal.
    """
    by = np.full(len(hub), -1)
    by[goal] = len(edges.to)
    order = [goal]
    for k in range(len(hub)):
        if k == len(order):
            break
        here = order[k]
        for e in range(edges.first[here], edges.first[here + 1]):
            if passable[e] and by[edges.to[e]] < 0:
                by[edges.to[e]] = e
                order.append(edges.to[e])
    size = np.zeros(len(edges.to) + 1, np.int64)
    for k in range(len(order) - 1, 0, -1):
        here = order[k]
        size[by[here]] += hub[here]
        size[by[edges.origin[by[here]]]] += size[by[here]]
    return size[:-1]


@compiled
def _reached_past(
    place: int,
    goal: int,
    hub: Flags,
    edges: Edges,
    passable: Flags,
    need: float,
    reached: Indices,
) -> int:
    """Return how many places of the hub are connected with a goal if a robot is at `place`.

    reached (V,): scratch, in which nothing equals `place` yet.
    """
    queue, count = [goal], 0
    reached[goal] = place
    while queue:
        here = queue.pop()
        count += hub[here]
        for e in range(edges.first[here], edges.first[here + 1]):
            if not passable[e] or reached[edges.to[e]] == place:
                continue
            closed = False
            for k in range(edges.near_first[e], edges.near_first[e + 1]):
                closed |= edges.near[k] == place and edges.gap[k] < need
            if not closed:
                reached[edges.to[e]] = place
                queue.append(edges.to[e])
    return count
