"""Compiled: the search for moves of many robots from place to place.

Moves come one after the other.  A robot that moves along an edge has to be clear of the places of
all others at that time, so a sequence of moves can be driven whatever the robots' speeds.

Two searches: the least costly moves for a small fleet by A*, and LaCAM (Okumura 2023) with PIBT
(Okumura et al. 2022) for others.  Both are complete: given enough effort they find moves if there
are any.  PIBT is changed in one respect: a step is a sequence of moves, in which a robot that is
in the way moves before the robot that pushes it.

Decides: which robot moves when.  Must not know: what places and robots stand for.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled
from coordinator.ground.grid_kernels import point_gap

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

SOLVED, NONE, GAVE_UP = 1, 0, -1
"""Outcomes of a search: moves were found; there are none; the effort was not enough."""


class Edges(NamedTuple):
    """The edges of a graph of V places: those that leave place v are first[v] to first[v + 1].

    Edge e leads to place to[e] and costs cost[e].  Places that come near it: near[k] at a distance
    gap[k] [m], with k from near_first[e] to near_first[e + 1].  origin[e]: where e comes from;
    back[e]: the edge that leads back along e.
    """

    first: Indices
    to: Indices
    cost: Array
    near_first: Indices
    near: Indices
    gap: Array
    origin: Indices
    back: Indices


class Team(NamedTuple):
    """Robots: kind (n,), place at the start and in the end (n,), and cost left (n, V) to the goal.

    rank (n,): robots of a higher one move first; done (n, V): at which places a robot may be in the
    end.  need (kinds, kinds) [m]: how far apart robots have to be; fits (kinds, edges): which edges
    a kind can pass.  keeps (n,): robots that have to keep to one way, which leads to their goals.
    """

    kind: Indices
    start: Indices
    goal: Indices
    left: Array
    rank: Indices
    done: Flags
    need: Array
    fits: Flags
    keeps: Flags


class Step(NamedTuple):
    """The state of one step: where robots are (n,), who is at a place (V,), -1 if nobody is.

    want (n,): where a robot has to be after the step, -1 if anywhere; fixed (n,): it does not move
    any more; held (V,): how many pushing robots want a place to be cleared; moves (n, 2): robot and
    edge, size (1,) of them; noise (1,): the state of a random generator that breaks ties.

    Of a robot that pushes: options (n, degree), the edges that it may take, untried (n, 2), from
    where to where in `options` edges are left to try, and clearing (n,), the edge from which it
    pushes others, -1 if none.
    """

    at: Indices
    occupant: Indices
    want: Indices
    fixed: Flags
    held: Indices
    moves: Indices
    size: Indices
    noise: Indices
    options: Indices
    untried: Indices
    clearing: Indices


@compiled
def costs_to(goals: Indices, edges: Edges, fits: Flags, extra: Array) -> Array:
    """Return the least cost (V,) from every place to one of the goals (m,); inf if there is none.

    Only edges that fit are used; edge e costs extra[e] beside its usual cost.
    """
    left = np.full(len(edges.first) - 1, math.inf)
    heap = [(0.0, 0)]
    heap.pop()
    for goal in goals:
        left[goal] = 0.0
        heap.append((0.0, goal))
    while heap:
        cost, v = heapq.heappop(heap)
        if cost > left[v]:
            continue
        for e in range(edges.first[v], edges.first[v + 1]):
            further = cost + edges.cost[e] + extra[e]
            if fits[edges.back[e]] and further < left[edges.to[e]]:
                left[edges.to[e]] = further
                heapq.heappush(heap, (further, edges.to[e]))
    return left


@allocation_free
def in_the_way(robot: int, e: int, edges: Edges, team: Team, occupant: Indices) -> int:
    """Return a robot that stands in another robot's way along an edge; -1 if there is none."""
    return who_closes(e, team.kind[robot], robot, edges, team, occupant)


@allocation_free
def who_closes(e: int, kind: int, but: int, edges: Edges, team: Team, occupant: Indices) -> int:
    """Return a robot, `but` not this one, that closes an edge to a kind of robots; -1 if none."""
    for k in range(edges.near_first[e], edges.near_first[e + 1]):
        other = occupant[edges.near[k]]
        if other < 0 or other == but:
            continue
        if edges.gap[k] < team.need[kind, team.kind[other]]:
            return int(other)
    return -1


@allocation_free
def _held_up(robot: int, e: int, edges: Edges, team: Team, step: Step) -> bool:
    """Return whether a robot that does not move any more stands in the way along an edge."""
    for k in range(edges.near_first[e], edges.near_first[e + 1]):
        other = step.occupant[edges.near[k]]
        if other < 0 or other == robot or not step.fixed[other]:
            continue
        if edges.gap[k] < team.need[team.kind[robot], team.kind[other]]:
            return True
    return False


@compiled
def _hold(robot: int, e: int, by: int, edges: Edges, team: Team, step: Step) -> None:
    """Reserve, or with -1 release, the places that have to be clear for a move."""
    most = team.need[team.kind[robot]].max()
    for k in range(edges.near_first[e], edges.near_first[e + 1]):
        if edges.gap[k] < most:
            step.held[edges.near[k]] += by


@compiled
def _prepare(robot: int, pushed: bool, edges: Edges, team: Team, step: Step) -> None:
    """List the edges that a robot may take, the best first.

    A robot that is not pushed only takes an edge that leads nearer to its goal.
    """
    here = step.at[robot]
    begin, end = edges.first[here], edges.first[here + 1]
    keys = np.full(end - begin, math.inf)
    count = 0
    for e in range(begin, end):
        to = edges.to[e]
        left = team.left[robot, to]
        if not team.fits[team.kind[robot], e] or left == math.inf:
            continue
        if step.want[robot] >= 0:
            if to != step.want[robot]:
                continue
        elif not pushed and left >= team.left[robot, here]:
            continue
        step.noise[0] = (step.noise[0] * 1103515245 + 12345) % 2147483648
        tie = 1e-3 * (step.noise[0] / 2147483648.0) + (0.01 if step.occupant[to] >= 0 else 0.0)
        # Short edges leave more room to those that have to go out of the way.
        keys[e - begin] = left + tie + 0.01 * edges.cost[e]
        count += 1
    step.options[robot, :count] = begin + np.argsort(keys)[:count]
    step.untried[robot, 0], step.untried[robot, 1] = 0, count
    step.clearing[robot] = -1
    step.fixed[robot] = True


@compiled
def _push(robot: int, edges: Edges, team: Team, step: Step) -> None:
    """Move a robot along the best edge that can be cleared, if there is one.

    Robots in the way are pushed, and push others in turn; `trail` holds those that are pushing.
    """
    trail = np.empty(len(step.at), np.int64)
    trail[0], depth = robot, 0
    _prepare(robot, False, edges, team, step)
    while depth >= 0:
        me = trail[depth]
        e = step.clearing[me]
        if e >= 0:
            other = in_the_way(me, e, edges, team, step.occupant)
            if other >= 0 and not _held_up(me, e, edges, team, step):
                _prepare(other, True, edges, team, step)
                depth += 1
                trail[depth] = other
                continue
            _hold(me, e, -1, edges, team, step)
            step.clearing[me] = -1
            if other < 0:
                _move(me, e, edges, step)
                depth -= 1
                continue
        while step.clearing[me] < 0 and step.untried[me, 0] < step.untried[me, 1]:
            e = step.options[me, step.untried[me, 0]]
            step.untried[me, 0] += 1
            if step.held[edges.to[e]] == 0 and not _held_up(me, e, edges, team, step):
                _hold(me, e, 1, edges, team, step)
                step.clearing[me] = e
        if step.clearing[me] < 0:
            depth -= 1


@compiled
def _move(robot: int, e: int, edges: Edges, step: Step) -> None:
    step.occupant[step.at[robot]] = -1
    step.at[robot] = edges.to[e]
    step.occupant[edges.to[e]] = robot
    step.moves[step.size[0], 0], step.moves[step.size[0], 1] = robot, e
    step.size[0] += 1


@compiled
def _take_step(order: Indices, edges: Edges, team: Team, step: Step) -> bool:
    """Move the robots in this order; return whether all are where they have to be."""
    for robot in order:
        step.fixed[robot] = step.want[robot] == step.at[robot]
    for constrained in (True, False):
        for robot in order:
            if not step.fixed[robot] and (step.want[robot] >= 0) == constrained:
                _push(robot, edges, team, step)
    for robot in order:
        if step.want[robot] >= 0 and step.want[robot] != step.at[robot]:
            return False
    return True


@compiled
def _slot(at: Indices, table: Indices, configs: Indices) -> int:
    """Return where in a hash table the node with these places is, or where it belongs."""
    key = 1469598103
    for v in at:
        key = ((key ^ v) * 1099511 + (key >> 17)) % 2305843009213693951
    slot = key % len(table)
    while table[slot] >= 0 and not (configs[table[slot]] == at).all():
        slot = (slot + 1) % len(table)
    return slot


@compiled
def least_moves(edges: Edges, team: Team, most: int) -> tuple[int, Indices]:
    """Find the moves of least cost among at most `most` arrangements of the robots.

    Returns the outcome, and for each move (m, 2) robot and edge.
    """
    count, places = len(team.start), len(edges.first) - 1
    configs = np.empty((most, count), np.int64)
    table = np.full(3 * most + 1, -1)
    parent, spent = np.full((most, 3), -1), np.full(most, math.inf)
    closed = np.zeros(most, np.bool_)
    occupant = np.full(places, -1)
    configs[0], spent[0], known = team.start, 0.0, 1
    table[_slot(configs[0], table, configs)] = 0
    first = 0.0
    for robot in range(count):
        first += team.left[robot, team.start[robot]]
    heap = [(first, 0)]
    while heap:
        estimate, node = heapq.heappop(heap)
        if closed[node]:
            continue
        closed[node] = True
        at = configs[node].copy()
        if (at == team.goal).all():
            return SOLVED, _traced(node, parent)
        for robot in range(count):
            occupant[at[robot]] = robot
        left = estimate - spent[node]
        for robot in range(count):
            here = at[robot]
            for e in range(edges.first[here], edges.first[here + 1]):
                to = edges.to[e]
                if not team.fits[team.kind[robot], e] or team.left[robot, to] == math.inf:
                    continue
                if in_the_way(robot, e, edges, team, occupant) >= 0:
                    continue
                at[robot] = to
                slot = _slot(at, table, configs)
                if table[slot] < 0:
                    if known == most:
                        return GAVE_UP, np.empty((0, 2), np.int64)
                    table[slot], configs[known] = known, at
                    known += 1
                fresh, cost = table[slot], spent[node] + edges.cost[e]
                if cost < spent[fresh] - 1e-9:
                    spent[fresh] = cost
                    parent[fresh, 0], parent[fresh, 1], parent[fresh, 2] = node, robot, e
                    further = left - team.left[robot, here] + team.left[robot, to]
                    heapq.heappush(heap, (cost + further, fresh))
                    closed[fresh] = False
                at[robot] = here
        for robot in range(count):
            occupant[at[robot]] = -1
    return NONE, np.empty((0, 2), np.int64)


@compiled
def _traced(node: int, parent: Indices) -> Indices:
    """Return the moves (m, 2) that lead to a node; parent (nodes, 3): node, robot, edge."""
    count, last = 0, node
    while parent[last, 0] >= 0:
        last = parent[last, 0]
        count += 1
    moves = np.empty((count, 2), np.int64)
    while count > 0:
        count -= 1
        moves[count, 0], moves[count, 1] = parent[node, 1], parent[node, 2]
        node = parent[node, 0]
    return moves


@compiled
def some_moves(edges: Edges, team: Team, most: int) -> tuple[int, Indices]:
    """Find moves by LaCAM, in at most `most` steps of PIBT; return as `least_moves` does."""
    count, places = len(team.start), len(edges.first) - 1
    configs, waited = np.empty((most + 1, count), np.int64), np.zeros((most + 1, count), np.int64)
    table = np.full(3 * most + 1, -1)
    parent = np.full(most + 1, -1)
    # Demands of a node: robot, place, the demand that this one adds to, its depth, the next one.
    demands = np.full((most + 1, 5), -1)
    last_demand, first_demand = np.full(most + 1, -1), np.full(most + 1, -1)
    moves, moves_from = np.empty((4 * most + count, 2), np.int64), np.zeros(most + 2, np.int64)
    degree = np.diff(edges.first).max()
    step = Step(
        np.empty(count, np.int64), np.full(places, -1), np.empty(count, np.int64),
        np.zeros(count, np.bool_), np.zeros(places, np.int64), np.empty((count, 2), np.int64),
        np.zeros(1, np.int64), np.ones(1, np.int64), np.empty((count, degree), np.int64),
        np.empty((count, 2), np.int64), np.empty(count, np.int64),
    )  # fmt: skip
    configs[0], waited[0], known, made = team.start, team.rank, 1, 1
    table[_slot(configs[0], table, configs)] = 0
    demands[0, 3] = 0
    first_demand[0] = last_demand[0] = 0
    stack = [0]
    steps = 0
    while stack:
        node = stack[-1]
        arrived = 0
        while arrived < count and team.done[arrived, configs[node, arrived]]:
            arrived += 1
        if arrived == count:
            return SOLVED, _joined(node, parent, moves, moves_from)
        demand = first_demand[node]
        if demand < 0:
            stack.pop()
            continue
        if steps == most:
            return GAVE_UP, np.empty((0, 2), np.int64)
        steps += 1
        first_demand[node] = demands[demand, 4]
        order = np.argsort(-waited[node], kind="mergesort")
        depth = demands[demand, 3]
        if depth < count:
            robot = order[depth]
            here = configs[node, robot]
            for e in range(edges.first[here] - 1, edges.first[here + 1]):
                stay = e < edges.first[here]
                if not stay and not team.fits[team.kind[robot], e]:
                    continue
                if made == len(demands):
                    demands = _doubled(demands)
                demands[made, 0], demands[made, 1] = robot, here if stay else edges.to[e]
                demands[made, 2], demands[made, 3] = demand, depth + 1
                if first_demand[node] < 0:
                    first_demand[node] = made
                else:
                    demands[last_demand[node], 4] = made
                last_demand[node] = made
                made += 1
        step.want[:] = -1
        while demands[demand, 3] > 0:
            step.want[demands[demand, 0]] = demands[demand, 1]
            demand = demands[demand, 2]
        step.at[:] = configs[node]
        step.size[0] = 0
        for robot in range(count):
            step.occupant[step.at[robot]] = robot
        reached = _take_step(order, edges, team, step)
        for robot in range(count):
            step.occupant[step.at[robot]] = -1
        if not reached or step.size[0] == 0:
            continue
        slot = _slot(step.at, table, configs)
        if table[slot] >= 0:
            stack.append(table[slot])
            continue
        table[slot], configs[known], parent[known] = known, step.at, node
        while moves_from[known] + step.size[0] > len(moves):
            moves = _doubled(moves)
        moves[moves_from[known] : moves_from[known] + step.size[0]] = step.moves[: step.size[0]]
        moves_from[known + 1] = moves_from[known] + step.size[0]
        for robot in range(count):
            at_ease = team.left[robot, step.at[robot]] == 0.0
            waited[known, robot] = 0 if at_ease else waited[node, robot] + 1
        if made == len(demands):
            demands = _doubled(demands)
        demands[made, 3] = 0
        first_demand[known] = last_demand[known] = made
        made += 1
        stack.append(known)
        known += 1
    return NONE, np.empty((0, 2), np.int64)


@compiled
def _doubled(rows: Indices) -> Indices:
    more = np.full((2 * len(rows), rows.shape[1]), -1)
    more[: len(rows)] = rows
    return more


@compiled
def _joined(node: int, parent: Indices, moves: Indices, moves_from: Indices) -> Indices:
    """Return the moves (m, 2) of all steps that lead to a node."""
    nodes = [node]
    while parent[nodes[-1]] >= 0:
        nodes.append(parent[nodes[-1]])
    size = 0
    for one in nodes:
        size += moves_from[one + 1] - moves_from[one]
    joined = np.empty((size, 2), np.int64)
    size = 0
    for one in nodes[::-1]:
        begin, end = moves_from[one], moves_from[one + 1]
        joined[size : size + end - begin] = moves[begin:end]
        size += end - begin
    return joined


@allocation_free
def _is_worth(e: int, robot: int, cost: Array, edges: Edges, team: Team, occupant: Indices) -> bool:
    """Return whether a robot can take an edge now, and it leads to a place at less cost."""
    further = cost[edges.origin[e]] + edges.cost[e]
    if further >= cost[edges.to[e]] - 1e-9 or not team.fits[team.kind[robot], e]:
        return False
    return in_the_way(robot, e, edges, team, occupant) < 0


@compiled
def rerouted(
    robot: int, moves: Indices, edges: Edges, beside_first: Indices, beside: Indices, team: Team
) -> Indices:
    """Return moves (m, 2) in which one robot has its least costly moves among those of the others.

    The edges that come near place v are beside[beside_first[v] : beside_first[v + 1]].
    """
    count, places = len(team.start), len(edges.first) - 1
    others = moves[moves[:, 0] != robot]
    occupant = np.full(places, -1)
    for other in range(count):
        if other != robot:
            occupant[team.start[other]] = other
    came = [(0, 0, -1)]  # Each: after how many moves of others, by which edge, what came before.
    came.clear()
    last = np.full(places, -1)  # By place: the last of these that leads there.
    cost = np.full(places, math.inf)
    cost[team.start[robot]] = 0.0
    closed = [0]
    heap = [
        (edges.cost[e], e)
        for e in range(edges.first[team.start[robot]], edges.first[team.start[robot] + 1])
        if _is_worth(e, robot, cost, edges, team, occupant)
    ]
    heapq.heapify(heap)
    for k in range(len(others) + 1):
        while heap:
            further, e = heapq.heappop(heap)
            to = edges.to[e]
            if further >= cost[to] - 1e-9:
                continue
            came.append((k, e, last[to]))
            cost[to], last[to] = further, len(came) - 1
            for f in range(edges.first[to], edges.first[to + 1]):
                if _is_worth(f, robot, cost, edges, team, occupant):
                    heapq.heappush(heap, (further + edges.cost[f], f))
        if k == len(others):
            break
        other, e = others[k]
        opened = edges.origin[e]
        closed.clear()
        for near in range(edges.near_first[e], edges.near_first[e + 1]):
            v = edges.near[near]
            far = edges.gap[near] >= team.need[team.kind[robot], team.kind[other]]
            if not far and cost[v] < math.inf:
                cost[v] = math.inf
                closed.append(v)
        occupant[opened] = -1
        occupant[edges.to[e]] = other
        heap.clear()
        # Edges that become clear, and those to places that have to be left.
        for at in range(beside_first[opened], beside_first[opened + 1]):
            f = beside[at]
            if _is_worth(f, robot, cost, edges, team, occupant):
                heap.append((cost[edges.origin[f]] + edges.cost[f], f))
        for v in closed:
            for one in range(edges.first[v], edges.first[v + 1]):
                f = edges.back[one]
                if _is_worth(f, robot, cost, edges, team, occupant):
                    heap.append((cost[edges.origin[f]] + edges.cost[f], f))
        heapq.heapify(heap)
    if cost[team.goal[robot]] == math.inf:
        return moves
    taken = [(0, 0)]
    taken.pop()
    before, one = len(others), last[team.goal[robot]]
    while one >= 0:
        k, e, earlier = came[one]
        if k > before:
            one = earlier
            continue
        taken.append((k, e))
        before, one = k, last[edges.origin[e]]
    joined = np.empty((len(others) + len(taken), 2), np.int64)
    size = 0
    for k in range(len(others) + 1):
        while taken and taken[-1][0] == k:
            joined[size, 0], joined[size, 1] = robot, taken.pop()[1]
            size += 1
        if k < len(others):
            joined[size] = others[k]
            size += 1
    return joined


@compiled
def places_near(
    ways: Array,
    ways_from: Indices,
    origin: Indices,
    to: Indices,
    places: Array,
    spare: Array,
    reach: float,
) -> tuple[Indices, Indices, Array]:
    """Return near_first, near and gap (see Edges) of edges along ways, within `reach` [m].

    Edge e leads along the line ways[ways_from[e] : ways_from[e + 1]]; places (V, 2) [m].  Where a
    place is nearest to an end of the edge it counts as farther away, by the smaller `spare` [m] of
    the two places (V,).
    """
    count = len(ways_from) - 1
    first = np.zeros(count + 1, np.int64)
    near, gaps = [0], [0.0]
    near.pop()
    gaps.pop()
    along_x = np.argsort(places[:, 0], kind="mergesort")
    xs = places[along_x, 0]
    for e in range(count):
        way = ways[ways_from[e] : ways_from[e + 1]]
        x0, x1 = way[:, 0].min() - reach, way[:, 0].max() + reach
        y0, y1 = way[:, 1].min() - reach, way[:, 1].max() + reach
        around = along_x[np.searchsorted(xs, x0) : np.searchsorted(xs, x1, side="right")]
        for v in np.sort(around[(places[around, 1] >= y0) & (places[around, 1] <= y1)]):
            x, y = places[v, 0], places[v, 1]
            gap = math.inf
            for k in range(len(way) - 1):
                leg = point_gap(x, y, way[k, 0], way[k, 1], way[k + 1, 0], way[k + 1, 1])
                gap = min(gap, leg)
            for tip, w in ((way[0], origin[e]), (way[-1], to[e])):
                if gap > math.hypot(x - tip[0], y - tip[1]) - 1e-9:
                    gap += min(spare[v], spare[w])
                    break
            if gap < reach:
                near.append(v)
                gaps.append(gap)
        first[e + 1] = len(near)
    return first, np.array(near), np.array(gaps)
