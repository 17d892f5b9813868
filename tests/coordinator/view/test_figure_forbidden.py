"""What forces a wait, judged by a naive search over lateness and by the plans of the scheduler."""

import math

import msgspec
import numpy as np
import pytest
from matplotlib.figure import Figure

from coordinator.curves.chords import chords_of
from coordinator.plan.document import Reason
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.view.figure_distance_time import draw_times
from coordinator.view.figure_forbidden import first_reached, forbidden, last_left, nearer_than
from coordinator.view.figure_robots import picture_robots
from protocol.timeline import Timeline
from sim.floors.generator import generate
from tests.coordinator.view.test_figure import DOCUMENT, EAST, NORTH, straight

REASON = Reason(
    robot="North_2",
    s=2.5,
    wait=4.5,
    yields_to="East-1",
    zone=(3.4, 4.6),
    their_zone=(3.4, 4.6),
    otherwise=1.0,
)


def document(*robots, waits=(REASON,), **changes):
    return msgspec.structs.replace(
        DOCUMENT, robots=list(robots), waits=list(waits), crossings=[], **changes
    )


def region_of(plan, reason=REASON):
    driven = {one.id: one for one in drive(plan)}
    return forbidden(driven[reason.robot], driven[reason.yields_to], reason, plan)


def test_the_region_is_what_a_naive_search_over_lateness_finds():
    region = region_of(document(EAST, NORTH))
    need = 0.2 + 0.2 + 0.05

    def near(s, t):
        """Whether North_2 at s is too near to East-1 somewhen from t - tau to t + tau."""
        shifts = np.linspace(-1.0, 1.0, 4001)
        theirs = 1.0 + 0.5 * np.clip(t + shifts, 0.0, 16.0)
        return bool(np.any(np.hypot(5.0 - theirs, 1.0 + s - 5.0) < need))

    inner = slice(5, -5, 10)
    for s, begin, end in zip(region.s[inner], region.begin[inner], region.end[inner], strict=True):
        assert near(s, begin + 0.01)
        assert near(s, 0.5 * (begin + end))
        assert near(s, end - 0.01)
        assert not near(s, begin - 0.01)
        assert not near(s, end + 0.01)
    assert region.s[0] == pytest.approx(4.0 - need, abs=0.01)
    assert region.s[-1] == pytest.approx(4.0 + need, abs=0.01)


def test_who_begins_or_parks_in_a_zone_forbids_it_from_ever_or_for_ever():
    beside = straight("East-1", (5.1, 5.0), (9.0, 5.0))
    begins = region_of(document(beside, NORTH), msgspec.structs.replace(REASON, their_zone=(0, 1)))
    assert np.all(begins.begin[20:-20] == -math.inf)
    assert np.all(np.isfinite(begins.end))
    parked = straight("East-1", (1.0, 5.0), (4.9, 5.0))
    parks = region_of(document(parked, NORTH), msgspec.structs.replace(REASON, their_zone=(3, 4)))
    assert np.all(parks.end[20:-20] == math.inf)
    assert np.all(np.isfinite(parks.begin))


def test_robots_that_keep_apart_forbid_nothing():
    far = straight("East-1", (1.0, 9.0), (9.0, 9.9))
    region = region_of(document(far, NORTH))
    assert len(region.s) == len(region.begin) == len(region.end) == 0


def test_times_along_a_path_are_the_inverse_of_the_motion_and_a_rest_has_two():
    line = Timeline([0.0, 1.0, 2.0, 4.0], [0.0, 1.0, 0.5, 0.0], [0.0, 1.5], [2.0, 9.0])
    s = np.array([0.25, 0.9, 1.0, 1.7, 3.9])
    for times in (first_reached(line, s), last_left(line, s)):
        assert [line.s_at(t) for t in times.tolist()] == pytest.approx(s.tolist(), abs=1e-9)
    rest = np.array([1.5])
    assert first_reached(line, rest)[0] == pytest.approx(line.arrivals[1])
    assert last_left(line, rest)[0] == 9.0
    ends = np.array([0.0, 4.0])
    assert first_reached(line, ends).tolist() == [-math.inf, pytest.approx(line.finish)]
    assert last_left(line, ends).tolist() == [2.0, math.inf]


def test_arc_lengths_near_a_place_agree_with_samples_of_the_path():
    curve = drive(document(straight("East-1", (0.0, 0.0), (3.0, 4.0)), NORTH))[0].curve
    dice = np.random.default_rng(3)
    places = dice.uniform(-0.5, 4.5, (60, 2))
    least, greatest = nearer_than(places, chords_of(curve), 1.0, (0.5, 4.5))
    s = np.linspace(0.5, 4.5, 8001)
    way = curve.at_arc(s)
    for place, low, high in zip(places, least, greatest, strict=True):
        near = s[np.hypot(*(way - place).T) <= 1.0]
        if len(near) > 2:
            assert (low, high) == pytest.approx((near[0], near[-1]), abs=2e-3)
        else:
            assert high - low < 0.01


@pytest.mark.parametrize(("kind", "robots"), [("circle", 6), ("warehouse", 8)])
def test_a_robot_keeps_out_of_what_forces_its_wait_by_little_more_than_it_has_to(kind, robots):
    plan = plan_scenario(generate(kind, robots, 1))
    driven = {one.id: one for one in drive(plan)}
    assert plan.waits
    for reason in plan.waits:
        line = driven[reason.robot].timeline
        region = region_of(plan, reason)
        arrives = first_reached(line, region.s)
        assert np.all(arrives > region.end - 0.02)
        if reason.wait > 0.1:  # The zone that is named forbids half of the wait or more.
            assert np.min(arrives - region.end) < 0.25 + 0.5 * reason.wait


def lanes(plan):
    axes = Figure(figsize=(8, 8)).add_axes((0.1, 0.1, 0.8, 0.8))
    draw_times(axes, plan, picture_robots(plan))
    return axes, [shade for shade in axes.collections if shade.get_gid() == "forbidden"]


def test_a_lane_shows_what_forces_its_waits_in_the_others_colour_and_only_there():
    plan = document(EAST, NORTH)
    axes, (shade,) = lanes(plan)
    low, high = shade.get_datalim(axes.transData).intervaly
    assert -2.0 < low < high < -1.0
    east = picture_robots(plan)["East-1"]
    assert shade.get_facecolor()[0, :3] == pytest.approx(
        [int(east.colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    )
    assert "shaded" in axes.get_xlabel()


def test_lanes_too_low_to_see_anything_in_show_no_regions():
    crowd = [straight(f"R{i}", (0.0, 0.1 * i), (9.0, 0.1 * i)) for i in range(60)]
    axes, shades = lanes(document(EAST, NORTH, *crowd))
    assert shades == []
    assert "shaded" not in axes.get_xlabel()


def test_the_words_of_a_wait_stand_clear_of_what_is_shaded():
    axes, (shade,) = lanes(document(EAST, NORTH))
    (words,) = [text for text in axes.texts if text.get_text() == "4.5 s for East-1"]
    assert not words.get_window_extent().overlaps(shade.get_window_extent())


@pytest.mark.parametrize(
    "changes",
    [
        {"robot": "nobody"},
        {"yields_to": "nobody"},
        {"yields_to": "North_2"},
        {"zone": (9.0, -1.0), "their_zone": (1e300, -1e300)},
        {"zone": (-1e300, 1e300), "their_zone": (-1e300, 1e300)},
    ],
)
def test_a_wait_that_makes_no_sense_does_not_spoil_the_picture(changes):
    plan = document(EAST, NORTH, waits=[msgspec.structs.replace(REASON, **changes)])
    axes, shades = lanes(plan)
    assert len(shades) <= 1
    axes.get_figure(root=True).canvas.draw()
