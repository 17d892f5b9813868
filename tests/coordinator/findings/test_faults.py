"""Whose fault it is that a robot is not heard."""

from coordinator.findings.faults import Faults
from coordinator.findings.info_fields import Summary
from coordinator.fleet.log_records import LINK_GONE, LINK_UP
from protocol import phases
from protocol.messages import Report

SECOND = 1_000_000_000


def faults():
    """Return the faults of an empty log, and its summary."""
    summary = Summary("f", None, None, 0.0, complete=True, damage="", messages=0)
    found = Faults(summary, lambda time_ns: time_ns / SECOND, {})
    for tick in range(25):  # The coordinator speaks and R1 drives, up to 2.4 s.
        found.hear_coordinator(tick * SECOND // 10)
        found.hear_report(Report(9, tick, 1, phases.MOVING), "R1", tick * SECOND // 10)
    return found, summary


def told(summary):
    """Return the faults that a summary tells of, and that of R1."""
    return [(one.robot, one.fault) for one in summary.faults], summary.robots["R1"].fault


def test_a_robot_has_lost_its_link_while_the_coordinator_speaks():
    found, summary = faults()
    assert found.lose_link("R1", int(2.5 * SECOND))
    found.hear_coordinator(int(2.7 * SECOND))
    assert told(summary) == ([("R1", "lost its link")], "lost its link")


def test_links_that_are_lost_while_the_coordinator_is_away_are_its_own_fault():
    found, summary = faults()
    assert found.lose_link("R1", int(2.5 * SECOND))
    found.hear_coordinator(int(7.9 * SECOND))
    assert told(summary) == ([("", "the coordinator was away for 5.5 s")], None)


def test_links_that_the_coordinator_hears_of_when_it_is_back_are_its_own_fault():
    found, summary = faults()
    found.hear_coordinator(int(7.9 * SECOND))
    assert not any(found.lose_link(robot, 8 * SECOND) for robot in ("R1", "R2"))
    assert told(summary) == ([("", "the coordinator was away for 5.5 s")], None)
    for tick in range(80, 92):
        found.hear_coordinator(tick * SECOND // 10)
    found.find_silent(tick * SECOND // 10, [phases.MOVING])
    assert told(summary)[1] == "fell silent"


def test_links_that_are_lost_just_before_the_router_is_missed_are_the_routers_fault():
    found, summary = faults()
    found.hear_router(LINK_UP, 0)
    assert found.lose_link("R1", int(2.5 * SECOND))
    found.hear_router(LINK_GONE, int(2.6 * SECOND))
    assert told(summary) == ([("", "the router is gone")], None)


def test_no_link_is_lost_while_the_router_is_gone():
    found, summary = faults()
    found.hear_router(LINK_GONE, 2 * SECOND)
    assert not found.lose_link("R1", int(2.5 * SECOND))
    assert told(summary) == ([], None)


def test_a_robot_that_has_arrived_may_leave():
    found, summary = faults()
    found.hear_report(Report(9, 30, 1, phases.DONE), "R1", int(2.45 * SECOND))
    assert not found.lose_link("R1", int(2.5 * SECOND))
    assert told(summary) == ([], None)


def test_a_robot_falls_silent_once_and_is_fine_when_it_is_heard_again():
    found, summary = faults()
    for tick in range(25, 60):
        found.hear_coordinator(tick * SECOND // 10)
        found.find_silent(tick * SECOND // 10, [phases.MOVING])
    assert told(summary) == ([("R1", "fell silent")], "fell silent")
    found.hear_report(Report(9, 31, 1, phases.MOVING), "R1", 6 * SECOND)
    assert told(summary) == ([("R1", "fell silent")], None)


def test_nobody_falls_silent_while_the_coordinator_is_away():
    found, summary = faults()
    found.hear_coordinator(9 * SECOND)
    found.find_silent(9 * SECOND, [phases.MOVING])
    assert told(summary) == ([], None)
