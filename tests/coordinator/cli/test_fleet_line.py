"""A link to a fleet: for how long it listens."""

import itertools

import msgspec
import pytest
import typer

from coordinator.cli.fleet_line import FleetLine
from protocol import keys
from protocol.phases import OVER, STOP
from tests.coordinator.desk.fake_fleet import FLEET, FakeFleet, a_command


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


def test_who_is_not_answered_is_told_which_fleets_are_heard(capsys):
    fleet = FakeFleet()
    line = FleetLine(fleet, "other", 0.5, "", itertools.count(0.0, 0.125).__next__)
    line.note_others()
    fleet.beat()
    fleet.tell(keys.command("port"), a_command())
    assert list(line.messages(lambda _: None)) == []
    with pytest.raises(typer.Exit) as caught:
        line.must_be_heard()
    assert caught.value.exit_code == 1
    said = (
        "no coordinator of fleet other has answered within 0.5 s; the fleets heard are hall, port"
    )
    assert " ".join(capsys.readouterr().err.split()) == said


def test_who_hears_nothing_is_told_of_no_fleet(capsys):
    line = FleetLine(FakeFleet(), None, 0.5, "", itertools.count(0.0, 0.125).__next__)
    line.unanswered("order o1")
    said = "no coordinator has answered to order o1 within 0.5 s"
    assert " ".join(capsys.readouterr().err.split()) == said


def test_the_phase_is_that_of_the_fleet_that_is_asked():
    fleet = FakeFleet()
    line = FleetLine(fleet, FLEET, 0.5, "", itertools.count(0.0, 0.125).__next__)
    assert line.phase is None
    fleet.tell(keys.command(FLEET), msgspec.structs.replace(a_command(), phase=STOP))
    fleet.tell(keys.command("port"), msgspec.structs.replace(a_command(), phase=OVER))
    assert len(list(line.messages(lambda _: None))) == 1
    assert line.phase == STOP
