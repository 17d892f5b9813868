"""Independent oracles: naive, slow and apart from the code under test.

Nothing in here imports the coordinator, the robots or the protocol.  Plans are read from the
numbers of plan.json alone.
"""

from __future__ import annotations

import heapq
import itertools
import json
import math
from typing import Any

import numpy as np
import shapely


def naive_basis(index: int, degree: int, knots, u: float) -> float:
    """N_{index,degree}(u) by the recursion of Cox and de Boor, 0 / 0 = 0, closed at the end."""
    if degree == 0:
        last = u == knots[-1] and knots[index] < knots[index + 1] == knots[-1]
        return 1.0 if knots[index] <= u < knots[index + 1] or last else 0.0
    value = 0.0
    if knots[index + degree] > knots[index]:
        part = (u - knots[index]) / (knots[index + degree] - knots[index])
        value += part * naive_basis(index, degree - 1, knots, u)
    if knots[index + degree + 1] > knots[index + 1]:
        part = (knots[index + degree + 1] - u) / (knots[index + degree + 1] - knots[index + 1])
        value += part * naive_basis(index + 1, degree - 1, knots, u)
    return value


def naive_point(degree: int, knots, points, weights, u: float) -> np.ndarray:
    """C(u) as the rational sum over all control points, Eq. (5) and (7)."""
    basis = [w * naive_basis(j, degree, knots, u) for j, w in enumerate(weights)]
    return np.array(
        [sum(b * p[axis] for b, p in zip(basis, points, strict=True)) for axis in (0, 1)]
    ) / sum(basis)


def basis_table(degree: int, knots: np.ndarray, u: np.ndarray) -> np.ndarray:
    """All N_j(u) as (len(u), n): the same recursion, level by level, for many u."""
    low, high = knots[:-1], knots[1:]
    table = ((u[:, None] >= low) & (u[:, None] < high)).astype(float)
    closing = np.flatnonzero(high > low)[-1]
    table[u >= knots[-1], closing] = 1.0
    for level in range(1, degree + 1):
        count = len(knots) - 1 - level
        left, right = knots[level:-1] - knots[:count], knots[level + 1 :] - knots[1 : count + 1]
        rising = np.where(left > 0, (u[:, None] - knots[:count]) / np.where(left > 0, left, 1), 0)
        falling = np.where(
            right > 0, (knots[level + 1 :] - u[:, None]) / np.where(right > 0, right, 1), 0
        )
        table = rising * table[:, :-1] + falling * table[:, 1:]
    return table


def naive_points(degree: int, knots, points, weights, u) -> np.ndarray:
    """C(u) (m, 2) for many u (m,), span by span by the table of the functions that are not zero."""
    control, weighed = np.array(points, dtype=float), np.array(weights, dtype=float)
    knots, u = np.array(knots, dtype=float), np.array(u, dtype=float)
    spans = np.flatnonzero(np.diff(knots) > 0.0)
    inside = np.searchsorted(knots[spans], u, side="right") - 1
    found = np.empty((len(u), 2))
    order = np.argsort(inside, kind="stable")
    for at, span in zip(np.split(order, np.cumsum(np.bincount(inside))[:-1]), spans, strict=False):
        first = span - degree
        mine = slice(first, span + 1)
        basis = basis_table(degree, knots[first : span + degree + 2], u[at]) * weighed[mine]
        found[at] = basis @ control[mine] / basis.sum(axis=1)[:, None]
    return found


class Track:
    """One robot of a plan document: where it is when, from the document's numbers."""

    def __init__(self, robot: dict[str, Any]) -> None:
        path = robot["path"]
        self.id = robot["id"]
        self.radius = robot["radius"]
        self.degree = path["degree"]
        self.knots = np.array(path["knots"], dtype=float)
        self.points = np.array(path["control_points"], dtype=float)
        self.weights = np.array(path["weights"], dtype=float)
        spans = np.unique(self.knots)
        parts = [np.linspace(a, b, 150, endpoint=False) for a, b in itertools.pairwise(spans)]
        self.u = np.append(np.concatenate(parts), spans[-1])
        self.line = self.place_at_parameter(self.u)
        self.s = np.append(0.0, np.cumsum(np.hypot(*np.diff(self.line, axis=0).T)))
        self._schedule(robot)

    def place_at_parameter(self, u) -> np.ndarray:
        """C(u), (m, 2)."""
        return naive_points(self.degree, self.knots, self.points, self.weights, u)

    def _schedule(self, robot: dict[str, Any]) -> None:
        """List the legs (t0, t1, s0, v0, acceleration): rests end as the document says."""
        departs = {0.0: robot["start_time"]} | {x["s"]: x["depart"] for x in robot["stops"]}
        knots = dict(robot["profile"])
        places, speeds = zip(*robot["profile"], strict=True)
        for s in departs:
            # v^2 is linear in s between knots
            knots.setdefault(s, math.sqrt(np.interp(s, places, np.square(speeds))))
        self.legs = []
        now = 0.0
        for (s0, v0), (s1, v1) in itertools.pairwise(sorted(knots.items())):
            now = max(now, departs.get(s0, -math.inf))
            took = 2.0 * (s1 - s0) / (v0 + v1)
            self.legs.append((now, now + took, s0, v0, (v1 - v0) / took))
            now += took
        self.finish = now
        self.top_speed = max(speeds)

    def arc(self, t) -> np.ndarray:
        """s(t): before the start 0, at rests constant, after the goal the length."""
        t = np.asarray(t, dtype=float)
        s = np.zeros_like(t)
        for t0, t1, s0, v0, rate in self.legs:
            passed = np.minimum(t, t1) - t0
            s = np.where(t >= t0, s0 + v0 * passed + 0.5 * rate * passed**2, s)
        return s

    def at(self, t) -> np.ndarray:
        """c(t), (m, 2)."""
        return self.place_at_parameter(np.interp(self.arc(t), self.s, self.u))


def tracks(document: bytes | dict[str, Any]) -> list[Track]:
    """Every robot of a plan document."""
    plan = json.loads(document) if isinstance(document, bytes) else document
    return [Track(robot) for robot in plan["robots"]]


def least_slack(
    fleet: list[Track], tau: float, margin: float, step: float = 0.02
) -> tuple[float, str]:
    """The least |c_i(t) - c_j(t')| - need over |t - t'| <= tau on a grid, and who and when."""
    shifts = math.ceil(tau / step)
    step = tau / shifts if shifts else step
    t = np.arange(0.0, max(track.finish for track in fleet) + tau + step, step)
    places = [track.at(t) for track in fleet]
    worst = (math.inf, "")
    for i, j in itertools.permutations(range(len(fleet)), 2):
        need = fleet[i].radius + fleet[j].radius + margin
        boxes = [(line.min(axis=0), line.max(axis=0)) for line in (fleet[i].line, fleet[j].line)]
        if np.any(boxes[0][0] > boxes[1][1] + need) or np.any(boxes[1][0] > boxes[0][1] + need):
            continue
        for shift in range(shifts + 1):
            gap = np.hypot(*(places[i][: len(t) - shift] - places[j][shift:]).T)
            k = int(np.argmin(gap))
            if gap[k] - need < worst[0]:
                when = f"{fleet[i].id} at {t[k]:.2f}, {fleet[j].id} at {t[k + shift]:.2f}"
                worst = (float(gap[k] - need), when)
    return worst


def least_clearance(fleet: list[Track], boundary, obstacles) -> float:
    """The least distance from a robot's rim to anything solid; negative off the floor."""
    floor = shapely.Polygon(boundary)
    solid = shapely.union_all([floor.exterior, *(shapely.Polygon(o) for o in obstacles)])
    least = math.inf
    for track in fleet:
        line = shapely.LineString(track.line)
        if not floor.covers(line):
            return -math.inf
        least = min(least, shapely.distance(line, solid) - track.radius)
    return least


def shortest_length(blocked: shapely.Geometry, corners, start, goal) -> float:
    """Dijkstra over the full visibility graph of all places; inf when there is no way."""
    places = np.vstack((start, goal, np.reshape(corners, (-1, 2))))
    pairs = np.array(list(itertools.combinations(range(len(places)), 2)))
    free = shapely.disjoint(shapely.linestrings(places[pairs]), blocked)
    neighbours: dict[int, list[tuple[int, float]]] = {i: [] for i in range(len(places))}
    for i, j in pairs[free].tolist():
        size = math.dist(places[i], places[j])
        neighbours[i].append((j, size))
        neighbours[j].append((i, size))
    best, heap = {0: 0.0}, [(0.0, 0)]
    while heap:
        cost, here = heapq.heappop(heap)
        for there, size in neighbours[here] if cost <= best[here] else []:
            if cost + size < best.get(there, math.inf):
                best[there] = cost + size
                heapq.heappush(heap, (cost + size, there))
    return best.get(1, math.inf)


def every_corner(shape: shapely.Geometry) -> np.ndarray:
    """All vertices of an area, concave ones too, (n, 2)."""
    return shapely.get_coordinates(shape)


def complaints(document: bytes, scenario: Any) -> list[str]:
    """What a document does not keep of what its scenario asks, by dense sampling."""
    plan = json.loads(document)
    fleet = tracks(plan)
    found = []
    slack, where = least_slack(fleet, plan["tau"], scenario.margin)
    if slack < -0.002:
        found.append(f"separation short by {-slack:.4f} m: {where}")
    floor = scenario.workspace
    clearance = least_clearance(fleet, floor.boundary, floor.obstacles)
    if clearance < scenario.margin - 0.001:
        found.append(f"clearance {clearance:.4f} m, margin {scenario.margin} m")
    for track, robot, planned in zip(fleet, scenario.robots, plan["robots"], strict=True):
        found += _broken_wishes(track, robot, planned)
    return found


def _broken_wishes(track: Track, robot: Any, planned: dict[str, Any]) -> list[str]:
    found = []
    if track.id != robot.id or track.radius != robot.radius:
        found.append(f"{track.id} is not {robot.id}")
    ends = track.at([0.0, track.finish])
    for name, place, wanted in (("start", ends[0], robot.start), ("goal", ends[1], robot.goal)):
        if math.dist(place, wanted[:2]) > 1e-3:
            found.append(f"{robot.id}'s {name} is missed by {math.dist(place, wanted[:2]):.4f} m")
    nearest = [min(math.dist(via, place) for place in track.line) for via in robot.via]
    if any(gap > 5e-3 for gap in nearest):
        found.append(f"{robot.id} misses a via point: {nearest}")
    for name, pose, end in (("start", robot.start, 0), ("goal", robot.goal, -1)):
        chord = np.diff(track.line[:2] if end == 0 else track.line[-2:], axis=0)[0]
        turn = math.atan2(chord[1], chord[0]) - (pose[2] if len(pose) == 3 else math.nan)
        if abs(math.remainder(turn, 2 * math.pi)) > 0.02:
            found.append(f"{robot.id}'s {name} heading is off by {turn:.3f} rad")
    if track.top_speed > robot.max_speed * 1.0001:
        found.append(f"{robot.id} drives {track.top_speed} m/s")
    rates = [abs(leg[4]) for leg in track.legs if leg[1] - leg[0] > 1e-3]
    if max(rates, default=0.0) > robot.max_accel * 1.01 + 1e-6:
        found.append(f"{robot.id} changes speed by {max(rates):.4f} m/s^2")
    if abs(planned["finish_time"] - track.finish) > 1e-3:
        found.append(f"{robot.id} arrives at {track.finish}, not {planned['finish_time']}")
    if abs(planned["length"] - track.s[-1]) > 1e-3:
        found.append(f"{robot.id}'s path is {track.s[-1]} m long, not {planned['length']}")
    return found
