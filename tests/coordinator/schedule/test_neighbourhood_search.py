"""Robots that are planned again among the others."""

from coordinator.motion.velocity_profile import Motion, SpeedLimits, Wait
from coordinator.schedule import neighbourhood_search
from coordinator.schedule.neighbourhood_search import Improvement
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import fleet_on, placed


def test_a_robot_that_leaves_a_rest_earlier_drives_as_slowly_before_it(monkeypatch):
    """Its way has been crossed when it comes to the crossing, only because it drives slowly."""
    fleet = fleet_on([line((0, 0), (10, 0)), line((5, -5), (5, 5))])
    slow = SpeedLimits(10.0, 0.25, 1.0, ())
    waits = [Wait(8.0, 60.0, -1)]
    motions = [Motion(slow, waits), Motion(fleet.junctions.tracks[1].limits, [])]
    assert fleet.slack(motions) > 0.0 > fleet.slack([Motion(motions[1].limits, waits), motions[1]])
    table = placed(fleet, motions)
    # As where all that it does before the rest leaves it no other time.
    monkeypatch.setattr(neighbourhood_search, "earliest_motion", lambda *_, **__: None)
    Improvement(fleet.junctions, table, [0, 1], [0, 0]).plan_again([0])
    assert fleet.slack(table.all()) > 0.0


def test_a_robot_rests_no_longer_than_it_has_to_though_it_has_no_other_time(monkeypatch):
    fleet = fleet_on([line((0, 0), (10, 0)), line((9, -9), (9, 9))])
    motions = [Motion(track.limits, []) for track in fleet.junctions.tracks]
    motions[0] = Motion(motions[0].limits, [Wait(5.0, 60.0, -1)])
    table = placed(fleet, motions)
    monkeypatch.setattr(neighbourhood_search, "earliest_motion", lambda *_, **__: None)
    Improvement(fleet.junctions, table, [0, 1], [0, 0]).plan_again([0])
    found = table.all()
    assert found[0].finish < 20.0
    assert fleet.slack(found) >= 0.0
