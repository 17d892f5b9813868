"""Moves by which robots arrive early, made from moves that come one after the other.

Decides: how much effort is spent, and which edges come near each other.  Must not know: curves,
speeds, how moves were found.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely

from coordinator.places.early_move_kernels import (
    Books,
    Floor,
    Meetings,
    Plans,
    Rows,
    count_windows,
    enter,
    timed,
)
from coordinator.places.early_neighbourhood_kernels import improve
from coordinator.places.move_kernels import Array, Indices, costs_to
from coordinator.places.parting_kernels import clear_after
from coordinator.places.place_graph import Graph

_EFFORT: Final = 90_000
_EFFORT_PER_EDGE: Final = 1_500
"""How many edges are looked at for each robot, at least; the latter for each edge of its way."""

_PAUSE: Final = 1e-6
"""A robot waits between two moves if the second one starts later than this [m]."""

_SPARE_WINDOWS: Final = 32
_SPARE_MOVES: Final = 100


def early_moves(
    graph: Graph, moves: Indices, gap: float, effort: int = _EFFORT
) -> tuple[Indices, float, Indices]:
    """Return moves (m, 2), robot and edge, in the order of their starts, by which robots are early.

    Beside them, the sum of arrivals as a share, at most 1, of that by `moves` in turn, from which
    they are made, and how often each robot (n,) waits.  gap [m]: how far a robot drives until
    another one may come where it was.  All robots are of one kind.
    """
    plans, in_turn = early_plans(graph, moves, gap, effort)
    used = np.arange(plans.edge.shape[1]) < plans.size[:, None]
    order = np.argsort(plans.start[used], kind="stable")
    found = np.column_stack((np.nonzero(used)[0], plans.edge[used]))[order]
    ends = plans.start + _lengths(graph)[plans.edge]
    pauses = used[:, 1:] & (plans.start[:, 1:] > ends[:, :-1] + _PAUSE)
    share = float(plans.arrival.sum()) / in_turn if in_turn else 1.0
    return found, share, pauses.sum(axis=1)


def early_plans(
    graph: Graph, moves: Indices, gap: float, effort: int = _EFFORT
) -> tuple[Plans, float]:
    """Return such moves with their starts and arrivals, and the sum of arrivals by `moves` in turn.

    Times are lengths [m] that a robot drives meanwhile.
    """
    team, count = graph.team, len(graph.team.start)
    floor = _floor(graph, gap)
    most = int(np.bincount(moves[:, 0], minlength=count).max(initial=0)) + _SPARE_MOVES
    plans = Plans(
        np.zeros((count, most), np.int64), np.zeros((count, most)),
        np.zeros(count, np.int64), np.zeros(count),
    )  # fmt: skip
    timed(moves, floor, plans)
    in_turn = float(plans.arrival.sum())
    edges, nothing = graph.edges._replace(cost=floor.length), np.zeros(len(floor.length))
    left = np.array(
        [
            costs_to(team.goal[robot : robot + 1], edges, floor.fits, nothing)
            for robot in range(count)
        ]
    )
    books = _books(graph, floor, plans)
    ways = float(left[np.arange(count), team.start].sum()) / max(float(floor.length.mean()), 1e-9)
    looks = effort * max(count, round(ways * _EFFORT_PER_EDGE / _EFFORT))
    improve(team.start, team.goal, left, floor, plans, books, looks)
    return plans, in_turn


def _lengths(graph: Graph) -> Array:
    """Return the length [m] of each edge (e,)."""
    return np.array([float(np.hypot(*np.diff(way, axis=0).T).sum()) for way in graph.ways])


def _floor(graph: Graph, gap: float) -> Floor:
    edges, need = graph.edges, float(graph.team.need[0, 0])
    lengths = _lengths(graph)
    closes = edges.gap < need
    of_edge = np.repeat(np.arange(len(edges.to)), np.diff(edges.near_first))[closes]
    place = edges.near[closes]
    # A robot closes the edges that lead away from its own place to nobody else.
    order = np.argsort(place, kind="stable")
    beside_first = np.searchsorted(place[order], np.arange(len(graph.places) + 1))
    passed_first = np.searchsorted(of_edge, np.arange(len(edges.to) + 1))
    meetings = _meetings(graph, need, of_edge, place)
    return Floor(
        edges, lengths, graph.team.fits[0], meetings, beside_first, of_edge[order],
        passed_first, place, gap,
    )  # fmt: skip


def _meetings(graph: Graph, need: float, of_edge: Indices, place: Indices) -> Meetings:
    """Return which edges come nearer to each other than `need` [m].

    of_edge, place (k,): which places an edge comes so near to.
    """
    ways, back = graph.ways, graph.edges.back
    half = np.flatnonzero(np.arange(len(ways)) < back)
    flat, begins = np.concatenate([ways[e] for e in half]), [0, *(len(ways[e]) for e in half)]
    lines = shapely.linestrings(flat, indices=np.repeat(np.arange(len(half)), begins[1:]))
    one, other = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=need)
    forth, backwards = clear_after(one, other, flat, np.cumsum(begins), need)
    # Each edge leads both ways, and `clear_after` says nothing of the direction of the other.
    mine = np.concatenate((forth, forth, backwards, backwards))
    e = np.concatenate((half[one], half[one], back[half[one]], back[half[one]]))
    f = np.concatenate((half[other], back[half[other]]) * 2)
    order = np.lexsort((f, e))
    e, f, mine = e[order], f[order], mine[order]
    theirs = mine[np.searchsorted(e * len(ways) + f, f * len(ways) + e)]
    stays = np.isin(f * len(graph.places) + graph.edges.to[e], of_edge * len(graph.places) + place)
    return Meetings(np.searchsorted(e, np.arange(len(ways) + 1)), f, mine, theirs, stays)


def _books(graph: Graph, floor: Floor, plans: Plans) -> Books:
    """Return the books of these plans, with room for others."""
    team = graph.team
    edges, places = np.zeros(len(graph.edges.to), np.int64), np.zeros(len(graph.places), np.int64)
    count_windows(plans, team.start, floor, edges, places)
    books = Books(_rows(edges), _rows(places))
    for robot in range(len(team.start)):
        enter(robot, team.start[robot], plans, floor, books)
    return books


def _rows(counts: Indices) -> Rows:
    """Return empty rows with room for twice as many times, and _SPARE_WINDOWS more."""
    first = np.append(0, np.cumsum(2 * counts + _SPARE_WINDOWS))
    size = int(first[-1])
    return Rows(first, np.zeros_like(counts), np.zeros((size, 3)), np.zeros(size, np.int64))
