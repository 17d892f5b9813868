"""A link to a fleet: for how long it listens."""

import itertools

from coordinator.cli.fleet_line import FleetLine
from tests.coordinator.desk.fake_fleet import FLEET, FakeFleet


def test_who_waits_for_something_that_lasts_listens_for_as_long_as_the_fleet_is_heard():
    """Each look at the clock takes 0.125 s."""
    for lasts, heard in ((False, 3), (True, 20)):
        fleet = FakeFleet()
        line = FleetLine(fleet, FLEET, 0.5, "", itertools.count(0.0, 0.125).__next__)
        beats = 0
        fleet.beat()
        for _ in line.messages(lambda _: None, lasts=lasts):
            beats += 1
            if beats < 20:
                fleet.beat()
        assert beats == heard
