"""What the second checker says of a whole plan: each demand with a bracket of its slack.

Decides: which demands a plan has to meet, with the tolerances that docs/evidence.md states.  Must
not know: what the product's proof found.
"""

from dataclasses import dataclass, field

import numpy as np

from tests.second_checker.motion import motion_of
from tests.second_checker.nearness import Region, Ride, nearest, segments_apart
from tests.second_checker.path import curvatures, path_of
from tests.second_checker.wire import read

TOLERANCE, RESOLUTION, ARC = 1e-3, 2.5e-4, 2.5e-4
"""What a plan may be short of [m], in distances; in what the proof measures; in arc lengths."""

SPEED, ACCEL, LATERAL, TURN, TURN_RATE = 1.0001, 1.01, 1.02, 1.01, 1.02
_CORNER = 0.01


@dataclass
class Found:
    """Brackets (low, high) of slack [m]: separation, clearance, and staircases up to -TOLERANCE.

    `broken`: demands that are certainly not met.  `open`: those that the brackets leave open.
    """

    separation: tuple = (np.inf, np.inf)
    clearance: tuple = (np.inf, np.inf)
    staircases: tuple = (np.inf, np.inf)
    broken: list = field(default_factory=list)
    open: list = field(default_factory=list)

    def judge(self, what, low, high, least):
        """Note a demand: that its slack, between low and high, is at least `least`."""
        if high < least:
            self.broken.append(what)
        elif low < least:
            self.open.append(what)


@dataclass(frozen=True)
class Terms:
    """What a plan promises beside its messages; SI units.  limits: by robot, or None.

    staircases: (behind, ahead) to knots (k, 2) of plan time and need [s]; None where not asked.
    """

    tau: float
    margin: float
    radii: dict
    limits: dict
    walls: list | None = None
    solids: list | None = None
    staircases: dict | None = None


def check(messages, terms):
    """Return what is found of a plan's messages, bytes by robot."""
    found, rides = Found(), {}
    for robot, payload in messages.items():
        try:
            message = read(payload)
            rides[robot] = message, Ride(path_of(message), motion_of(message))
        except (ValueError, IndexError, ZeroDivisionError) as error:
            found.broken.append(f"{robot}: {error}")
    if found.broken:
        return found
    for robot, (message, ride) in rides.items():
        _check_one(found, robot, message, ride, terms)
    _check_margin(found, rides, terms)
    _check_separation(found, rides, terms)
    if terms.staircases is not None:
        _check_staircases(found, rides, terms)
    return found


def _check_one(found, robot, message, ride, terms):
    path, motion, limits = ride.path, ride.motion, terms.limits[robot]
    low, high = path.length
    apart = abs(motion.s1[-1] - path.s[-1])
    allowed = 1e-4 + 1e-6 * high + ARC + 1e-4 * high
    found.judge(f"{robot} length", allowed - apart - path.unsure, allowed - apart + path.unsure, 0)
    if message.robot != robot or abs(float(message.tau) - terms.tau) > 1e-9:
        found.broken.append(f"{robot} terms")
    if limits is not None:
        _check_limits(found, robot, message, ride, limits)
    if terms.walls is not None:
        low, high = _clearance(path, terms)
        low, high = low - terms.radii[robot], high - terms.radii[robot]
        found.clearance = _lesser(found.clearance, (low, high))
        found.judge(f"{robot} clearance", low, high, terms.margin - TOLERANCE)


def _lesser(one, other):
    return float(min(one[0], other[0])), float(min(one[1], other[1]))


def _check_limits(found, robot, message, ride, limits):
    motion = ride.motion
    if max(motion.v0.max(), motion.v1.max()) > limits.max_speed * SPEED:
        found.broken.append(f"{robot} speed")
    if limits.max_accel is None:
        if message.brake:
            found.broken.append(f"{robot} brakes")
    else:
        square = np.abs(motion.v1**2 - motion.v0**2)
        if (square / (2.0 * (motion.s1 - motion.s0 + 1e-5))).max() > limits.max_accel * ACCEL:
            found.broken.append(f"{robot} acceleration")
        if motion.v0[0] > 1e-6 or motion.v1[-1] > 1e-6:
            found.broken.append(f"{robot} begin or end")
        if not 0.0 < float(message.brake) <= max(limits.max_accel, 1e-3):
            found.broken.append(f"{robot} brakes")
    _check_bends(found, robot, ride, limits)


def _check_bends(found, robot, ride, limits):
    path, motion = ride.path, ride.motion
    if (limits.max_lateral_accel, limits.max_turn_rate, limits.min_turn_radius) == (None, None, 0):
        return
    if _sharpest_corner(path.pieces) > _CORNER:
        found.broken.append(f"{robot} corner")
    reached, most = curvatures(path.pieces)
    low, high = _squares(path, motion)
    if limits.max_lateral_accel is not None:
        allowed = limits.max_lateral_accel * LATERAL
        slack = allowed - (most * high).max(), allowed - (reached * low).max()
        found.judge(f"{robot} bend", *slack, 0.0)
    if limits.max_turn_rate is not None:
        allowed = limits.max_turn_rate * TURN_RATE
        slack = allowed - (most * np.sqrt(high)).max(), allowed - (reached * np.sqrt(low)).max()
        found.judge(f"{robot} turn rate", *slack, 0.0)
    if limits.min_turn_radius:
        allowed = TURN / limits.min_turn_radius
        found.judge(f"{robot} turn", allowed - most.max(), allowed - reached.max(), 0.0)


def _squares(path, motion):
    """Return bounds (2, n) [m^2/s^2] of v^2 on each piece of a path: least and greatest."""
    knots = np.append(motion.s0, motion.s1[-1])
    low = np.maximum(path.s[:-1] - path.unsure, 0.0)
    high = np.minimum(path.s[1:] + path.unsure, knots[-1])
    least, most = np.full(len(low), np.inf), np.zeros(len(low))
    legs = zip(motion.s0, motion.s1, motion.v0**2, motion.v1**2, strict=True)
    for s0, s1, a, b in legs:
        inside = (low <= s1) & (high >= s0)
        for at in (low, high):
            square = a + (b - a) * np.clip((at[inside] - s0) / (s1 - s0), 0.0, 1.0)
            least[inside] = np.minimum(least[inside], square)
            most[inside] = np.maximum(most[inside], square)
    return np.where(np.isfinite(least), least, 0.0), most


def _sharpest_corner(pieces):
    """Return the greatest angle [rad] between the ends of pieces and the begins of the next."""
    corners = pieces[:, :, :2] / pieces[:, :, 2:]
    into, onward = corners[:-1, -1] - corners[:-1, -2], corners[1:, 1] - corners[1:, 0]
    cross = into[:, 0] * onward[:, 1] - into[:, 1] * onward[:, 0]
    sizes = np.hypot(*into.T), np.hypot(*onward.T)
    known = np.minimum(*sizes) > 1e-7
    angle = np.abs(np.arctan2(cross, (into * onward).sum(axis=1)))
    return float(angle[known].max(initial=0.0))


def _clearance(path, terms):
    """Return the bracket [m] of a path's distance from walls and solids; 0 where it is inside."""
    edges = [
        (np.array(p), np.array(q))
        for ring in [terms.walls, *terms.solids]
        for p, q in zip(ring, [*ring[1:], ring[0]], strict=True)
    ]
    a, b = path.places[:-1], path.places[1:]
    least = min(
        float(segments_apart(a, b, np.tile(p, (len(a), 1)), np.tile(q, (len(a), 1))).min())
        for p, q in edges
    )
    start = path.places[0]
    free = _is_inside(start, terms.walls) and not any(
        _is_inside(start, one) for one in terms.solids
    )
    if not free or least <= 0.0:
        return 0.0, path.error
    return least - path.error, least + path.error


def _is_inside(place, ring):
    """Return whether a place is inside a polygon: a ray to the right crosses it an odd number."""
    x, y = place
    inside = False
    for (px, py), (qx, qy) in zip(ring, [*ring[1:], ring[0]], strict=True):
        if (py > y) != (qy > y) and x < px + (y - py) / (qy - py) * (qx - px):
            inside = not inside
    return inside


def _check_margin(found, rides, terms):
    tracks = sorted(float(message.track) for message, _ in rides.values())
    shares = tracks[-1] + TOLERANCE + ARC
    if len(tracks) > 1:
        shares = tracks[-1] + tracks[-2] + TOLERANCE + RESOLUTION + 2.0 * ARC
    if shares > terms.margin + 1e-12:
        found.broken.append("margin")


def _pairs(rides):
    names = list(rides)
    return [(a, b) for a in names for b in names if a != b]


def _check_separation(found, rides, terms):
    finish = _finish(rides, terms)
    tau = terms.tau
    earlier, later = (lambda t: t - tau), (lambda t: t + tau)
    band = Region(low=earlier, high=later, earliest=earlier, latest=later)
    for a, b in _pairs(rides):
        if a > b:
            continue
        need = terms.radii[a] + terms.radii[b] + terms.margin
        enough = need + found.separation[1]
        low, high = nearest(rides[a][1], rides[b][1], band, finish, enough)
        found.separation = _lesser(found.separation, (low - need, high - need))
    found.judge("separation", *found.separation, -TOLERANCE)


def _check_staircases(found, rides, terms):
    finish = _finish(rides, terms)
    for ahead, behind in _pairs(rides):
        need = terms.radii[ahead] + terms.radii[behind] + terms.margin
        knots = terms.staircases.get((behind, ahead))
        region = _above(knots, terms.tau)
        enough = need - TOLERANCE
        low, high = nearest(rides[ahead][1], rides[behind][1], region, finish, enough)
        found.staircases = _lesser(found.staircases, (low - need, high - need))
    found.judge("staircases", *found.staircases, -TOLERANCE - RESOLUTION)


def _above(knots, tau):
    """Return the Region of conflicts that a staircase, knots (k, 2) [s], would leave uncovered."""
    at, need = np.zeros((2, 0)) if knots is None else np.asarray(knots, dtype=float).T

    def low(t):
        if not len(at):
            return np.full(len(t), -np.inf)
        return np.where(t < at[0], -np.inf, np.interp(t, at, need))

    def latest(t):
        k = np.searchsorted(need, t, side="right")
        until = np.append(at, np.inf)[k]
        inner = (k > 0) & (k < len(at))
        k = k[inner]
        part = (t[inner] - need[k - 1]) / (need[k] - need[k - 1])
        until[inner] = at[k - 1] + part * (at[k] - at[k - 1])
        return until

    return Region(low, lambda t: t - tau, lambda t: t + tau, latest)


def _finish(rides, terms):
    return 1.0 + terms.tau + max(ride.motion.finish for _, ride in rides.values())
