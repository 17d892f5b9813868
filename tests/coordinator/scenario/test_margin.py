"""The shares of the margin add up to no more than the margin."""

import gzip
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from coordinator.log.log_file import read_log
from coordinator.scenario import margin as shares
from coordinator.scenario.checks import SCENARIO_QUANTITIES
from coordinator.scenario.margin import LEAST_MARGIN, LEAST_TRACK_MM, between_robots, track_mm_for
from coordinator.service.replay import check_log
from robot_agent.core.ride import ARRIVAL_SLACK
from splinefleet import app

CORE_1 = Path(__file__).parents[2] / "golden" / "core_1.mcap"
"""A log of version 0.1.0, whose robots might use half of the margin each."""


@given(st.floats(LEAST_MARGIN, 10.0))
def test_two_robots_and_the_proof_use_no_more_than_the_margin_and_leave_less_than_2_mm(margin):
    track = track_mm_for(margin)
    proof = shares.TOLERANCE + shares.RESOLUTION + 2.0 * shares.SAME
    used = 2e-3 * track + proof + 2.0 * shares.ARC_ERROR
    assert margin - 2e-3 < used <= margin + 1e-12
    assert track >= LEAST_TRACK_MM


@given(st.integers(LEAST_TRACK_MM, 5_000))
def test_the_margin_that_is_read_from_a_plan_message_gives_its_track_tolerance_again(track):
    assert track_mm_for(shares.margin_for(track)) == track
    assert between_robots(track, track).total <= shares.margin_for(track)


def test_the_least_margin_leaves_a_robot_room_to_arrive():
    assert track_mm_for(LEAST_MARGIN) == LEAST_TRACK_MM
    assert 2.0 * ARRIVAL_SLACK <= 1e-3 * LEAST_TRACK_MM


def test_a_check_of_an_older_log_tells_which_version_wrote_it():
    difference = check_log(read_log(CORE_1)).difference
    assert "attachment plan-1.json: tau is not what the planner gives now" in difference
    assert (
        "splinefleet 0.1.0 wrote this log, and only that version reproduces its bytes" in difference
    )


@pytest.mark.parametrize(
    "command",
    [
        ("info", str(CORE_1)),
        ("plot", str(CORE_1), "-o", "run.html"),
        ("verify", "plan-1.json"),
        ("judge", "."),
    ],
)
def test_an_older_log_is_read_as_before(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    log = read_log(CORE_1)
    (tmp_path / "run.mcap").write_bytes(CORE_1.read_bytes())
    (tmp_path / "plan-1.json").write_bytes(log.attachments["plan-1.json"])
    for robot in "AB":
        box = gzip.decompress(log.attachments[f"blackbox/{robot}.csv.gz"])
        (tmp_path / f"{robot}.csv").write_bytes(box)
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output


def test_only_a_margin_that_is_too_small_is_told_what_shares_it_has():
    margin = SCENARIO_QUANTITIES["margin"]
    assert "tables of arc lengths" in margin.complaint(0.001)
    assert margin.complaint(1e6) == "1000000.0 m is above 100000 m"
