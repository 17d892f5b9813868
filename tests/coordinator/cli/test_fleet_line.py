"""A link to a fleet: for how long it listens."""

import time

from coordinator.cli.fleet_line import FleetLine
from tests.coordinator.desk.fake_fleet import FLEET, FakeFleet


def test_who_waits_for_something_that_lasts_listens_for_as_long_as_the_fleet_is_heard():
    for lasts in (False, True):
        fleet = FakeFleet()
        line, began, beats = FleetLine(fleet, FLEET, 0.5, ""), time.monotonic(), 0
        fleet.beat()
        for _ in line.messages(lambda _: None, lasts=lasts):
            beats += 1
            if beats < 4:
                time.sleep(0.2)
                fleet.beat()
        assert (beats == 4, time.monotonic() - began > 1.0) == (lasts, lasts)
