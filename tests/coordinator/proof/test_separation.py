"""How near robots come, held against dense sampling of the same bytes."""

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.curves.nurbs import nurbs
from coordinator.plan.document import Path, PlanDocument, RobotPlan, Stop
from coordinator.plan.wire import drive
from coordinator.proof.motion_pieces import Flights, Part
from coordinator.proof.separation import Separation
from coordinator.proof.separation_kernels import BEGIN, DEVIATION, END, X0, X1, nearest
from coordinator.proof.tau_safety import prove_separation
from coordinator.proof.verify import prove_document
from coordinator.scenario.margin import RESOLUTION, TOLERANCE
from tests.sweeps import seeds

TAU = 0.7


def a_plan(name, curve, dice, radius=0.2):
    """A robot that drives a curve with changing speed, waits once, and starts late or at once."""
    length = float(np.float32(curve.length))
    places = np.float32(np.linspace(0.0, length, 6))
    speeds = np.float32(dice.uniform(0.3, 1.2, 6))
    stop = float(np.float32(dice.uniform(0.3, 0.6) * length))
    path = Path(
        degree=curve.degree,
        knots=np.float32(curve.knots).tolist(),
        control_points=[tuple(point) for point in np.float32(curve.points).tolist()],
        weights=np.float32(curve.weights).tolist(),
    )
    return RobotPlan(
        id=name,
        radius=radius,
        start_time=float(dice.choice([0.0, 1.5, 4.0])),
        finish_time=0.0,
        length=length,
        path=path,
        profile=list(zip(places.tolist(), speeds.tolist(), strict=True)),
        stops=[Stop(s=stop, arrive=0.0, depart=float(dice.uniform(2.0, 12.0)))],
        wire_bytes=0,
    )


def winding(dice, count=9):
    """A rational curve over the same floor as all others, in any direction."""
    points = np.column_stack((np.linspace(0.0, 8.0, count), dice.uniform(0.0, 4.0, count)))
    knots = np.concatenate((np.zeros(3), np.arange(count - 2), np.full(3, count - 3)))
    weights = dice.uniform(0.8, 1.25, count)
    return nurbs(3, knots, points[:: dice.choice((1, -1))], weights)


def a_fleet(seed, count=5, radii=None):
    """What robots on wild curves over the same floor make of their bytes."""
    dice = np.random.default_rng(seed)
    radii = [0.2] * count if radii is None else radii
    robots = [
        a_plan(f"R{index}", winding(dice), dice, radius) for index, radius in enumerate(radii)
    ]
    return drive(a_document(robots))


def a_document(robots):
    return PlanDocument(
        scenario="separation", epoch=1, policy="safe", tau=TAU, margin=0.05, robots=robots
    )


def places(driven, time):
    s = np.array([driven.timeline.s_at(t) for t in time.tolist()])
    return driven.curve.at_arc(s)


def sampled(fleet, a, b, tau, step=0.01):
    """The least centre distance of a pair on a grid of times, and how much less it may truly be."""
    time = np.arange(0.0, max(one.timeline.finish for one in fleet) + 1.0, step)
    one, other = places(fleet[a], time), places(fleet[b], time)
    least = np.inf
    for shift in range(round(tau / step) + 1):
        count = len(time) - shift
        for first, second in ((one[:count], other[shift:]), (one[shift:], other[:count])):
            least = min(least, np.hypot(*(first - second).T).min())
    hops = [np.hypot(*np.diff(line, axis=0).T).max() for line in (one, other)]
    return least, 0.5 * sum(hops)


@pytest.mark.parametrize("seed", range(6))
def test_the_least_slack_is_never_far_above_that_of_sampling_and_not_far_below(seed):
    fleet = a_fleet(seed)
    keep = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
    closest = Separation(Flights(fleet), TAU).least(keep)
    unsure = 10.0 * max(one.arc_error for one in fleet)
    slacks = {}
    for a in range(5):
        for b in range(a + 1, 5):
            least, error = sampled(fleet, a, b, TAU)
            slacks[a, b] = least - keep[a] - keep[b]
            assert closest.slack <= slacks[a, b] + RESOLUTION
    error = sampled(fleet, closest.a, closest.b, TAU)[1]
    assert slacks[closest.a, closest.b] - error <= closest.slack + unsure
    here = places(fleet[closest.a], np.array([closest.t_a]))[0]
    there = places(fleet[closest.b], np.array([closest.t_b]))[0]
    assert abs(closest.t_a - closest.t_b) <= TAU + 1e-9
    assert np.hypot(*(here - there)) == pytest.approx(closest.distance, abs=RESOLUTION)
    np.testing.assert_allclose(0.5 * (here + there), (closest.x, closest.y), atol=RESOLUTION)


@pytest.mark.parametrize("seed", range(4))
def test_every_pair_that_comes_too_near_is_told_with_its_own_worst_place(seed):
    fleet = a_fleet(seed, 8)
    keep = np.full(8, 0.15)
    found = Separation(Flights(fleet), TAU).below(keep, -TOLERANCE)
    alone = {}
    for a in range(8):
        for b in range(a + 1, 8):
            pair = Separation(Flights([fleet[a], fleet[b]]), TAU).least(keep[:2])
            if pair.slack < -TOLERANCE:
                alone[a, b] = pair.slack
    assert {(one.a, one.b) for one in found} == set(alone)
    assert [one.slack for one in found] == sorted(one.slack for one in found)
    for one in found:
        assert one.slack == pytest.approx(alone[one.a, one.b], abs=RESOLUTION)


@pytest.mark.parametrize("seed", range(6))
def test_of_a_part_only_the_courses_asked_for_are_compared_and_only_in_their_spans(seed):
    fleet, dice = a_fleet(seed, 5), np.random.default_rng(seed)
    spans = [tuple(np.sort(dice.uniform(0.0, 25.0, 2)).tolist()) for _ in fleet]
    spans[1] = (spans[1][0], np.inf)
    part = Part(spans, [index == 2 for index in range(5)])
    found = Separation(Flights(fleet, part), TAU).least(np.zeros(5))
    least = np.inf
    for index in (0, 1, 3, 4):
        mine, his = (
            np.arange(begin, min(end, 40.0), 0.02) for begin, end in (spans[2], spans[index])
        )
        near = np.abs(mine[:, None] - his) <= TAU
        apart = np.hypot(*(places(fleet[2], mine)[:, None] - places(fleet[index], his)).T).T
        least = min(least, np.where(near, apart, np.inf).min(initial=np.inf))
    assert (found is None) == (least == np.inf)
    if found is not None:
        assert 2 in (found.a, found.b)
        assert least - 0.05 <= found.slack <= least + 1e-3


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tolerance", [2e-2, 1e-4])
def test_no_robot_is_farther_from_its_pieces_than_they_say(seed, tolerance):
    fleet = a_fleet(seed, 3)
    flights = Flights(fleet)
    pieces = flights.pieces(tolerance)
    assert pieces.rows[:, DEVIATION].max() <= tolerance + 3.0 * max(one.arc_error for one in fleet)
    for index, driven in enumerate(fleet):
        rows = pieces.rows[pieces.robot == index]
        begin, end = rows[:, BEGIN], rows[:, END]
        assert begin[0] == 0.0
        assert end[-1] == flights.finish
        np.testing.assert_array_equal(begin[1:], end[:-1])
        part = np.random.default_rng(seed).uniform(0.0, 1.0, len(rows))
        true = places(driven, begin + part * (end - begin))
        first, last = rows[:, X0 : X0 + 2], rows[:, X1 : X1 + 2]
        straight = first + part[:, None] * (last - first)
        assert (np.hypot(*(true - straight).T) <= rows[:, DEVIATION] + 1e-9).all()


@pytest.mark.parametrize("seed", seeds(80))
def test_the_nearest_moment_of_two_pieces_is_that_of_a_grid(seed):
    dice = np.random.default_rng(seed)
    a, b = dice.uniform(-2.0, 2.0, (2, 7))
    for piece in (a, b):
        piece[:2] = np.sort(dice.uniform(0.0, 3.0, 2))
        piece[4:6] = piece[2:4] if dice.random() < 0.2 else piece[4:6]
    if dice.random() < 0.2:
        b[4:6] = b[2:4] + (a[4:6] - a[2:4]) * (b[1] - b[0]) / (a[1] - a[0])
    tau = float(dice.choice([0.0, 0.3, 1.0, 5.0]))
    best = nearest(a, b, tau)
    t_a = np.linspace(a[0], a[1], 201)[:, None]
    allowed = [np.clip(t_a + tau * part, b[0], b[1]) for part in np.linspace(-1.0, 1.0, 201)]
    t_b = np.concatenate(allowed, axis=1)
    x, y = (
        a[i] + (t_a - a[0]) / (a[1] - a[0]) * (a[i + 2] - a[i])
        - b[i] - (t_b - b[0]) / (b[1] - b[0]) * (b[i + 2] - b[i])
        for i in (2, 3)
    )  # fmt: skip
    gap = np.where(np.abs(t_a - t_b) <= tau + 1e-12, np.hypot(x, y), np.inf).min()
    assert best.distance <= gap + 1e-9
    if np.isfinite(gap):
        assert best.distance >= gap - 0.06
        assert a[0] - 1e-9 <= best.t_a <= a[1] + 1e-9
        assert b[0] - 1e-9 <= best.t_b <= b[1] + 1e-9
        assert abs(best.t_a - best.t_b) <= tau + 1e-9


def straight(name, start, goal, radius):
    curve = nurbs(1, [0, 0, 1, 1], [start, goal])
    robot = a_plan(name, curve, np.random.default_rng(0), radius)
    return replace(robot, start_time=0.0, stops=[])


def test_a_fleet_that_stands_far_apart_is_measured_as_well():
    fleet = drive(
        a_document([straight("A", (0, 0), (1, 0), 0.1), straight("B", (900, 0), (901, 0), 0.1)])
    )
    closest = Separation(Flights(fleet), TAU).least(np.array([0.1, 0.1]))
    least, error = sampled(fleet, 0, 1, TAU)
    assert least - error <= closest.distance <= least + RESOLUTION
    assert Separation(Flights(fleet[:1]), TAU).least(np.array([0.1])) is None


def test_the_tightest_pair_and_the_nearest_pair_are_told_apart():
    robots = [
        straight("A", (0, 0), (4, 0), 0.5),
        straight("B", (0, 1.2), (4, 1.2), 0.5),
        straight("C", (0, 9), (4, 9), 0.1),
        straight("D", (0, 9.6), (4, 9.6), 0.1),
    ]
    apart = prove_separation(Flights(drive(a_document(robots))), TAU, 0.05)
    assert apart.separation == pytest.approx(0.6, abs=RESOLUTION)
    assert apart.slack == pytest.approx(0.15, abs=RESOLUTION)
    tightest, nearest_pair = apart.tightest.split("; the least separation is another pair's: ")
    assert tightest.startswith("A at")
    assert "1.200" in tightest
    assert tightest.endswith("need 1.0500 m")
    assert nearest_pair.startswith("C at")
    assert nearest_pair.endswith("need 0.2500 m")


def test_many_pairs_that_come_too_near_are_told_worst_first_and_then_counted():
    robots = [straight(f"R{i}", (0, 0.1 * i), (4, 0.1 * i), 0.3) for i in range(12)]
    document = a_document(robots)
    proof = prove_document(document)
    told = [failure for failure in proof.failures if "apart near" in failure]
    near = sum(min(6, 11 - i) for i in range(12))
    assert not proof.holds
    assert proof.pairs == 66
    assert len(told) == 20
    assert f"and {near - 20} more pairs come too near" in proof.failures
    assert proof.least_slack == pytest.approx(0.1 - 0.65, abs=RESOLUTION)
