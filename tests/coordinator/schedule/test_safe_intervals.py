"""One robot among known motions: against a grid of places and times, brute force and sampling."""

import functools
import itertools
import math

import numpy as np
import pytest

from coordinator.motion.velocity_profile import Motion, Wait
from coordinator.schedule.forbidden_interval_kernels import AFTER, BOTH, FREE
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.safe_interval_kernels import Departure
from coordinator.schedule.safe_intervals import earliest_motion
from coordinator.schedule.waiting_kernels import PLACE
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import (
    MARGIN,
    NEED,
    RADIUS,
    Fleet,
    alone,
    bent_track,
    driver,
    fleet_on,
    placed,
    random_fleet,
    tangled_fleet,
    track_on,
    winding_fleet,
)
from tests.oracle_grid import Grid
from tests.sweeps import seeds

ROOM = 0.025
"""Cells, chords and the grid's own steps may cost so much [m]."""
SOON = 0.03
"""The grid knows times to this [s]."""

CROSSING = [line((0, 2), (6, 2)), line((3, 0), (3, 6))]
TWICE = [line((0, 2), (12, 2)), line((3, 0), (3, 4), (9, 4), (9, 0))]
FOLLOWING = [line((0, 0), (3, 3), (8, 3), (11, 0)), line((0, 6), (3, 3.2), (8, 3.2), (8, 8))]
PARKED = [line((0, 3), (6, 3)), line((3, 0), (3, 3))]


def last_robot(fleet, motions, **fields):
    """The motion of the last robot behind those of the others."""
    index = len(fleet.curves) - 1
    return earliest_motion(fleet.junctions, placed(fleet, [*motions, None]), index, **fields)


def grid(fleet, motions, room):
    """The oracle for the last robot, which keeps `room` [m] more from the others than it must."""
    curve, track = fleet.curves[-1], fleet.junctions.tracks[-1]
    others = [driver(c, m) for c, m in zip(fleet.curves, motions, strict=False)]
    tau = fleet.junctions.tau
    horizon = max(m.finish for m in motions) + track.alone + 3.0 * tau + 3.0
    speed = math.sqrt(track.limits.top)
    return Grid(curve.at_arc, curve.length, speed, others, NEED + room, tau, horizon)


def stations(fleet, anywhere):
    return fleet.junctions.approach(len(fleet.curves) - 1, anywhere).ride.stations[:, PLACE]


@functools.cache
def behind_others(seed, count=4, make=random_fleet):
    """A fleet, and motions of all but the last that were found one after another."""
    fleet = make(seed, count)
    table = placed(fleet, [None] * count)
    for index in range(count - 1):
        motion = earliest_motion(fleet.junctions, table, index)
        if motion is None:
            return None
        table.put(index, motion)
    return fleet, table.found[:-1]


def check_against_grid(fleet, motions):
    """Safe by sampling; not earlier than anything possible; as early as polite waits allow."""
    found = last_robot(fleet, motions)
    free = grid(fleet, motions, -ROOM).arrival()
    strict = grid(fleet, motions, ROOM)
    polite = strict.arrival(stations(fleet, False), polite=True)
    if found is None:
        assert strict.arrival(stations(fleet, True)) == math.inf
        return
    assert fleet.slack([*motions, found]) >= -2e-3
    assert found.finish >= free - SOON
    if math.isinf(fleet.junctions.tracks[-1].limits.accel):
        assert found.finish <= polite + SOON


@pytest.mark.parametrize("curves", [CROSSING, TWICE, FOLLOWING, PARKED])
@pytest.mark.parametrize("tau", [0.0, 0.7])
@pytest.mark.parametrize("accel", [0.8, math.inf])
@pytest.mark.parametrize("begin", [0.0, 3.0])
def test_a_motion_is_safe_and_as_early_as_on_a_grid(curves, tau, accel, begin):
    fleet = fleet_on(curves, tau=tau, accel=accel)
    check_against_grid(fleet, [alone(fleet.junctions.tracks[0], begin)])


@pytest.mark.parametrize("seed", seeds(30))
def test_among_several_robots_a_motion_is_safe_and_as_early_as_on_a_grid(seed):
    if behind_others(seed) is not None:
        check_against_grid(*behind_others(seed))


@pytest.mark.parametrize("seed", range(8))
def test_on_winding_paths_a_motion_is_safe_and_not_earlier_than_possible(seed):
    fleet = winding_fleet(seed, 2, tau=0.1 * seed)
    for begin in (0.0, 4.0):
        check_against_grid(fleet, [alone(fleet.junctions.tracks[0], begin)])


@pytest.mark.parametrize("curves", [CROSSING, TWICE, FOLLOWING, PARKED])
@pytest.mark.parametrize("begin", [0.0, 1.5, 3.0])
def test_with_an_acceleration_no_waits_on_a_grid_are_earlier(curves, begin):
    fleet = fleet_on(curves, tau=0.6, accel=0.8)
    motions = [alone(fleet.junctions.tracks[0], begin)]
    found, strict = last_robot(fleet, motions), grid(fleet, motions, ROOM)
    limits = fleet.junctions.tracks[-1].limits
    best = math.inf
    for waits in many_waits(stations(fleet, True)[1:-1]):
        trial = Motion(limits, waits)
        if trial.finish < best and strict.lets(trial.reached(strict.s), trial.left(strict.s)):
            best = trial.finish
    # A stop that gains less than 0.02 s is left out.
    assert found.finish <= best + 0.02
    assert found.finish >= best - 0.25


def many_waits(places):
    """No wait, or one or two waits on a grid of departures."""
    departures = np.arange(0.0, 16.0, 0.1)
    for depart in departures:
        yield [Wait(0.0, depart, -1)]
    for s, depart in itertools.product(places, departures):
        yield [Wait(s, depart, -1)]
        yield [Wait(0.0, 0.5 * depart, -1), Wait(s, depart, -1)]


@pytest.mark.parametrize("accel", [0.8, math.inf])
def test_a_free_robot_does_not_wait(accel):
    fleet = fleet_on([CROSSING[0], line((0, 4), (6, 4))], accel=accel)
    motion = last_robot(fleet, [alone(fleet.junctions.tracks[0])])
    assert motion.waits == []
    assert motion.finish == pytest.approx(fleet.junctions.tracks[1].alone)


def test_a_robot_that_nobody_has_a_motion_against_does_not_wait():
    fleet = fleet_on(CROSSING)
    assert earliest_motion(fleet.junctions, placed(fleet, [None, None]), 1).waits == []


def test_a_robot_whose_goal_is_crossed_later_waits_until_it_is_free_for_ever():
    fleet = fleet_on(PARKED)
    motion = last_robot(fleet, [alone(fleet.junctions.tracks[0], 5.0)])
    assert motion.finish > 5.0 + 3.0 + NEED + 0.5


@pytest.mark.parametrize(
    "curves",
    [
        [line((0, 3), (3, 3)), line((3, 0), (3, 3))],
        [line((3, 0), (3, 6)), line((3.2, 0), (6, 0))],
        [line((0, 3), (3, 3)), line((3, 0), (3, 6))],
    ],
)
def test_a_goal_a_start_or_a_way_taken_for_ever_leaves_no_motion(curves):
    fleet = fleet_on(curves)
    assert last_robot(fleet, [alone(fleet.junctions.tracks[0])]) is None


@pytest.mark.parametrize("accel", [0.8, math.inf])
def test_a_longer_tau_never_makes_a_robot_earlier(accel):
    finishes = []
    for tau in (0.0, 0.2, 0.5, 1.0, 2.0, 4.0):
        fleet = fleet_on(TWICE, tau=tau, accel=accel)
        finishes.append(last_robot(fleet, [alone(fleet.junctions.tracks[0])]).finish)
    assert finishes == sorted(finishes)


@pytest.mark.parametrize("curves", [CROSSING, TWICE, FOLLOWING])
@pytest.mark.parametrize("accel", [0.8, math.inf])
def test_every_wait_for_somebody_names_its_robot_and_a_zone_ahead(curves, accel):
    fleet = fleet_on(curves, tau=1.0, accel=accel)
    junctions = fleet.junctions
    waits = last_robot(fleet, [alone(junctions.tracks[0], 0.3)]).waits
    assert waits
    for wait in waits:
        assert wait.owner == 0
        assert {junctions.zones.a[wait.zone], junctions.zones.b[wait.zone]} == {0, 1}
        assert wait.s < junctions.span(1, np.array([wait.zone]))[0, 1]


def test_a_robot_leaves_after_its_release_and_arrives_before_the_latest_or_not_at_all():
    fleet = fleet_on(CROSSING, tau=1.0)
    motions = [alone(fleet.junctions.tracks[0], 1.0)]
    for release in (0.0, 0.7, 4.0, 30.0):
        found = last_robot(fleet, motions, departure=Departure(release, math.inf))
        assert found.start_time >= release
        assert fleet.slack([*motions, found]) >= -2e-3
    finish = last_robot(fleet, motions).finish
    assert last_robot(fleet, motions, latest=finish - 1e-3) is None
    assert last_robot(fleet, motions, latest=finish + 1e-3).finish == finish


def test_a_zone_may_be_left_free_or_be_entered_only_after_the_other():
    """The second one is there long before the first: it would never wait of its own accord."""
    fleet = fleet_on(TWICE, tau=0.5)
    first = alone(fleet.junctions.tracks[0], 30.0)
    asked = {
        modes: last_robot(fleet, [first], modes=np.array(modes))
        for modes in itertools.product((FREE, BOTH, AFTER), repeat=2)
    }
    early = fleet.junctions.tracks[1].alone
    for modes, motion in asked.items():
        assert (motion.finish > early + 20.0) == (AFTER in modes)
        for zone in np.flatnonzero(np.array(modes) == AFTER):
            rows = fleet.junctions.rows_of(1)[0]
            middle = (rows.first[zone] + rows.first[zone + 1]) // 2
            mine, theirs = fleet.junctions.tracks[1].cell * rows.cell[[middle]], rows.high[[middle]]
            assert motion.reached(mine) >= first.left(theirs) + 0.5 - 1e-9
    assert asked[FREE, FREE].waits == asked[BOTH, BOTH].waits == []
    assert asked[FREE, AFTER].finish < asked[AFTER, FREE].finish - 3.0
    assert asked[AFTER, FREE].finish == asked[AFTER, AFTER].finish


def is_polite(fleet, motions, found):
    """Tell whether nobody comes near any more to the places that it waits at on its way."""
    seen = grid(fleet, motions, -ROOM)
    at_start = bool(found.waits) and found.waits[0].s <= 0.0
    arrivals = found.arrivals[0 if at_start else 1 :]
    for wait, arrived in zip(found.waits, arrivals, strict=True):
        k = int(np.argmin(np.abs(seen.s - wait.s)))
        if wait.s > 0.0 and wait.depart > arrived + SOON:
            at = math.ceil((arrived + SOON) / seen.tick)
            if not seen.quiet[k, at]:
                return False
    return True


@pytest.mark.parametrize("seed", seeds(30))
def test_no_wait_where_somebody_has_yet_to_pass_unless_all_others_are_longer(seed):
    given = behind_others(seed, 3, tangled_fleet)
    if given is None or last_robot(*given) is None:
        return
    polite = is_polite(*given, last_robot(*given))
    places = stations(given[0], True)
    # The grid's robot has no inertia: one that has may find no such wait.
    if math.isinf(given[0].junctions.tracks[-1].limits.accel):
        least = grid(*given, ROOM).arrival(places, polite=True)
        assert polite or least > last_robot(*given).finish


@pytest.mark.parametrize("seed", seeds(30))
def test_the_quickest_motion_is_safe_no_later_and_before_the_latest_arrival_or_none(seed):
    given = behind_others(seed, 3, tangled_fleet)
    usual = None if given is None else last_robot(*given)
    if usual is None:
        return
    found = last_robot(*given, quickest=True)
    assert found.finish <= usual.finish + SOON
    assert given[0].slack([*given[1], found]) >= -2e-3
    # Stops count as a little time; where an earlier motion has more of them, it is found now.
    earlier = last_robot(*given, quickest=True, latest=found.finish - SOON)
    assert earlier is None or found.finish - 0.5 < earlier.finish < found.finish


def test_a_robot_driven_off_its_start_waits_where_another_passes_later_if_it_must():
    curves = [
        line((0, -4), (0, 6)),
        line((4.4, -3), (4.4, 6)),
        line((0.7, -3), (0.7, 0), (4, 0), (4, 3), (9, 3)),
        line((0, 0), (7, 0)),
    ]
    fleet = fleet_on(curves, [1.0, 1.5, 1.0, 1.0], accel=math.inf)
    tracks = fleet.junctions.tracks
    parked = Motion(tracks[1].limits, [Wait(2.9, 20.0, -1)])
    motions = [alone(tracks[0]), parked, alone(tracks[2], 30.0)]
    found = last_robot(fleet, motions)
    assert grid(fleet, motions, ROOM).arrival(polite=True) == math.inf
    assert not is_polite(fleet, motions, found)
    assert fleet.slack([*motions, found]) >= -2e-3
    check_against_grid(fleet, motions)


def test_a_slow_bend_ahead_is_waited_for_as_long_as_it_takes():
    """The first one creeps around its bend in the middle of the crossing."""
    bend = line((0, 0), (3, 0), (3, 3))
    slow = bent_track(bend, 1.0, 1.0, 0.01)
    fleet = Fleet([bend, line((1.5, -3), (1.5, 3))], None)
    tracks = [slow, track_on(fleet.curves[1])]
    fleet.junctions = Junctions(tracks, [RADIUS] * 2, MARGIN, 0.5)
    check_against_grid(fleet, [Motion(slow.limits, [])])
