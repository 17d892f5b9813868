"""Plans altered to fool a proof: one or two things changed, from a hair's breadth to a lot.

Decides: what is altered.  Every alteration keeps to what a Plan message can say.
"""

from dataclasses import replace as with_
from random import Random

import numpy as np
from msgspec.structs import replace

from coordinator.plan.wire import packed
from protocol.curve import Curve


def altered(plan, seed):
    """Return a PackedPlan altered by this seed and what was done, or None where nothing fits."""
    dice = Random(f"altered-{seed}")
    kinds = dice.sample(sorted(_KINDS), dice.choice((1, 1, 2)))
    document, staircases = plan.document, plan.staircases
    for kind in kinds:
        if kind == "staircase":
            staircases = _staircase(staircases, dice)
            continue
        robots = list(document.robots)
        index = dice.randrange(len(robots))
        robots[index] = _KINDS[kind](robots[index], dice)
        document = replace(document, robots=robots)
    try:
        made = packed(document)
    except (ValueError, OverflowError):
        return None
    return with_(made, staircases=staircases), " and ".join(kinds)


def _size(dice, low=-5.0, high=-0.5):
    return dice.choice((-1.0, 1.0)) * 10.0 ** dice.uniform(low, high)


def _radius(robot, dice):
    return replace(robot, radius=abs(robot.radius + _size(dice)))


def _stop(robot, dice):
    if not robot.stops:
        return _start(robot, dice)
    stops = list(robot.stops)
    k = dice.randrange(len(stops))
    if dice.random() < 0.3:
        del stops[k]
    else:
        stops[k] = replace(stops[k], depart=stops[k].depart + _size(dice, -3.0, 0.7))
    return replace(robot, stops=stops)


def _start(robot, dice):
    return replace(robot, start_time=max(robot.start_time + _size(dice, -3.0, 0.7), 0.0))


def _speeds(robot, dice):
    factor = 1.0 + _size(dice, -5.0, -0.7)
    return replace(robot, profile=[(s, v * factor) for s, v in robot.profile])


def _one_speed(robot, dice):
    profile = list(robot.profile)
    k = dice.randrange(len(profile))
    profile[k] = profile[k][0], abs(profile[k][1] * (1.0 + _size(dice, -4.0, 0.0)))
    return replace(robot, profile=profile)


def _point(robot, dice):
    points = list(robot.path.control_points)
    k = dice.randrange(1, max(len(points) - 1, 2))
    x, y = points[k]
    points[k] = x + _size(dice), y + _size(dice)
    return _along(robot, replace(robot.path, control_points=points))


def _weight(robot, dice):
    weights = [float(np.float32(10.0 ** dice.gauss(0.0, 0.3))) for _ in robot.path.weights]
    return _along(robot, replace(robot.path, weights=weights))


def _knot(robot, dice):
    knots, degree = list(robot.path.knots), robot.path.degree
    inner = range(degree + 1, len(knots) - degree - 1)
    if not inner:
        return _weight(robot, dice)
    k = dice.choice(inner)
    low, high = knots[k - 1], knots[k + 1]
    knots[k] = float(np.float32(low + dice.random() * (high - low)))
    return _along(robot, replace(robot.path, knots=sorted(knots)))


def _length(robot, dice):
    *most, (s, v) = robot.profile
    end = float(np.float32(s + _size(dice, -5.0, -2.0)))
    return replace(robot, profile=[*most, (end, v)], length=end)


def _limits(robot, dice):
    if robot.limits is None:
        return robot
    name = dice.choice(("max_speed", "max_accel", "max_lateral_accel", "max_turn_rate"))
    value = getattr(robot.limits, name)
    if value is None:
        return robot
    value *= 1.0 + _size(dice, -3.0, -0.3)
    return replace(robot, limits=replace(robot.limits, **{name: value}))


def _along(robot, path):
    """Return the robot on another path; its speed knots are stretched to the path's length."""
    length = _length_of(path)
    share = length / robot.profile[-1][0]
    profile = [(float(np.float32(s * share)), v) for s, v in robot.profile]
    stops = [replace(stop, s=float(np.float32(stop.s * share))) for stop in robot.stops]
    return replace(robot, path=path, profile=profile, stops=stops, length=profile[-1][0])


def _length_of(path):
    xs, ys = map(list, zip(*path.control_points, strict=True))
    return Curve(path.degree, path.knots, xs, ys, path.weights).length


def _staircase(staircases, dice):
    """Return staircases of which one is lower, or later, in one place or all along."""
    if not len(staircases.ahead):
        return staircases
    at, need = staircases.at.copy(), staircases.need.copy()
    pair = dice.randrange(len(staircases.ahead))
    first, end = int(staircases.first[pair]), int(staircases.first[pair + 1])
    begin = dice.randrange(first, end) if dice.random() < 0.5 and end > first else first
    need[begin:end] -= round(abs(_size(dice, 0.0, 3.7)))
    need[first:end] = np.maximum.accumulate(need[first:end])
    return with_(staircases, at=at, need=need)


_KINDS = {
    "radius": _radius,
    "stop": _stop,
    "start": _start,
    "speeds": _speeds,
    "one speed": _one_speed,
    "control point": _point,
    "weights": _weight,
    "knot": _knot,
    "length": _length,
    "limits": _limits,
    "staircase": _staircase,
}
