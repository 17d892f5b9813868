"""Small fleets on given paths, and where their motions have the robots, read by other code."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import dataclass

import numpy as np

from coordinator.curves.chords import chords_of
from coordinator.curves.nurbs import Nurbs
from coordinator.motion.velocity_profile import Motion, SpeedLimits, Wait, limits_on
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.timetable import Motions
from coordinator.schedule.track import Track
from tests import oracles
from tests.coordinator.curves.random_curves import quarter_circle, random_curve
from tests.coordinator.schedule.fleets import line

RADIUS, MARGIN = 0.18, 0.04
NEED = 2 * RADIUS + MARGIN
ROUNDING = 1e-6


@dataclass
class Fleet:
    """Robots of one radius on curves, with their junctions."""

    curves: list[Nurbs]
    junctions: Junctions

    def slack(self, motions, tau=None, step=0.02):
        """The least distance less the need between any two, within tau, by sampling."""
        drivers = [
            driver(curve, motion, f"R{index}")
            for index, (curve, motion) in enumerate(zip(self.curves, motions, strict=True))
            if motion is not None
        ]
        asked = self.junctions.tau if tau is None else tau
        return oracles.least_slack(drivers, asked, MARGIN, step)[0]

    def anew(self):
        """The same fleet, everything built again."""
        given = self.junctions
        tracks = [Track(t.limits, t.chords, t.cell) for t in given.tracks]
        return Fleet(self.curves, Junctions(tracks, given.radii, given.margin, given.tau))


def driver(curve, motion, name="R"):
    """The oracles' robot that drives a motion."""
    return oracles.Track(
        {
            "id": name,
            "radius": RADIUS,
            "path": {
                "degree": curve.degree,
                "knots": curve.knots,
                "control_points": curve.points,
                "weights": curve.weights,
            },
            "start_time": motion.start_time,
            "stops": [{"s": w.s, "depart": w.depart} for w in motion.waits if w.s > 0.0],
            "profile": list(zip(motion.knots_s, np.sqrt(motion.knots_w), strict=True)),
        }
    )


def track_on(curve, speed=1.0, accel=1.0):
    """A path on which only the top speed counts."""
    return Track(SpeedLimits(curve.length, speed**2, accel, ()), chords_of(curve))


def bent_track(curve, speed, accel, lateral):
    """A path whose bends bound the speed."""
    return Track(limits_on(curve, speed, accel, lateral), chords_of(curve))


def fleet_on(curves, speeds=1.0, tau=0.5, accel=1.0):
    """Robots with these speeds on these curves."""
    speeds = [speeds] * len(curves) if isinstance(speeds, float) else speeds
    tracks = [track_on(*both, accel) for both in zip(curves, speeds, strict=True)]
    return Fleet(curves, Junctions(tracks, [RADIUS] * len(tracks), MARGIN, tau))


def random_fleet(seed, count, size=3.0):
    """Robots that cross a disc on lines, between places that are all apart."""
    dice = random.Random(seed)
    angles = [2 * math.pi * i / (2 * count) for i in range(2 * count)]
    places = [(size * math.cos(a), size * math.sin(a)) for a in angles]
    dice.shuffle(places)
    lines = [line(a, b) for a, b in zip(places[::2], places[1::2], strict=True)]
    speeds = [dice.uniform(0.3, 1.0) for _ in lines]
    return fleet_on(lines, speeds, dice.choice([0.0, 0.5, 1.5]), dice.choice([0.6, math.inf]))


def winding_fleet(seed, count, tau=0.5, accel=0.7):
    """Robots on curves that cross each other many times."""
    curves = [random_curve(17 * seed + k, weighted=bool(k % 2)) for k in range(count)]
    moved = [
        Nurbs(c.degree, c.knots, c.points + np.array([0.0, k]), c.weights)
        for k, c in enumerate(curves)
    ]
    tracks = [bent_track(curve, 0.8, accel, 0.5) for curve in moved]
    return Fleet(moved, Junctions(tracks, [RADIUS] * count, MARGIN, tau))


def limits_of_many_kinds():
    """Speed limits with and without bends, with and without a limit on acceleration."""
    curves = [line((0, 0), (2, 3)), quarter_circle(), random_curve(3), random_curve(4)]
    for curve, accel, lateral in itertools.product(curves, (0.4, 3.0, math.inf), (0.1, math.inf)):
        yield bent_track(curve, 0.9, accel, lateral)


def alone(track, depart=0.0):
    """The motion of a robot that leaves its start at some time and never stops."""
    return Motion(track.limits, [Wait(0.0, depart, -1)] if depart > 0.0 else [])


def placed(fleet, motions):
    """A table of motions, None for robots that have none."""
    table = Motions(fleet.junctions.lengths())
    for index, motion in enumerate(motions):
        table.put(index, motion)
    return table


def tangled_fleet(seed, count, corners=4, size=4.0):
    """Robots on lines with corners that cross each other many times and keep off all places."""
    dice = np.random.default_rng(seed)
    curves = []
    while len(curves) < count:
        curve = line(*dice.uniform(0.0, size, (corners, 2)))
        if all(_keeps_off(curve, other) and _keeps_off(other, curve) for other in curves):
            curves.append(curve)
    speeds = [float(speed) for speed in dice.uniform(0.4, 1.0, count)]
    return fleet_on(curves, speeds, dice.choice([0.0, 0.5, 1.5]), dice.choice([0.6, math.inf]))


def _keeps_off(curve, other):
    places = other.at_arc(np.array([0.0, other.length]))
    way = curve.at_arc(np.linspace(0.0, curve.length, 200))
    return np.hypot(*(way[:, None] - places).transpose(2, 0, 1)).min() > 1.2 * NEED
