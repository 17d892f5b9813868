"""The tables for people: at 80 columns rows grow, and no word is cut."""

import io

import msgspec
from rich.console import Console
from rich.table import Table

from coordinator.base.text_table import plain_table
from coordinator.findings import plan_table
from coordinator.findings.wait_summary import WaitSummary, waits_of
from coordinator.findings.wait_table import waits_table
from coordinator.fleet.standstills import Held
from coordinator.mission.fleet_from_plan import muster
from coordinator.plan.document import Reason
from coordinator.plan.wire import packed
from coordinator.planning.planner import plan_scenario
from coordinator.view import live_table
from coordinator.view.live_table import FleetTable
from protocol.phases import DONE, FREEZE, FROZEN, GO, MOVING, OFF_PATH
from sim.judging.judge import PairVerdict, RobotVerdict, Verdict
from sim.processes import summary
from tests.scenarios import a_robot, a_scenario

NAME = "transport-robot-number-25"
HALL = a_scenario([a_robot(NAME, (1.0, 1.0), (9.0, 7.0)), a_robot("R2", (1.0, 7.0), (9.0, 1.0))])


def shown(table, width=80):
    text = io.StringIO()
    Console(file=text, width=width).print(table)
    return text.getvalue()


def assert_fits(said, *words):
    assert "…" not in said
    assert max(map(len, said.splitlines())) <= 80
    for word in words:
        assert f" {word} " in said


def test_a_plain_table_folds_where_rich_cuts():
    columns = ("robot", "arrived s", "tracking error mm", "lateness s", "fault", "where", "why so")
    cells = [NAME, "29.07", "0.1", "0.003", "recording ends at 7.99 s", "x" * 30, "y" * 30]
    cut, whole = Table(*columns), plain_table(*columns)
    for table in (cut, whole):
        table.add_row(*cells)
    assert "…" in shown(cut)
    assert_fits(shown(whole), "arrived", "tracking", "lateness")


def test_plans_waits_and_verdicts_fit():
    document = plan_scenario(HALL, effort=0)
    assert_fits(shown(plan_table.render(document)), "finish", "points")
    reason = Reason(
        robot=NAME, s=123.45, wait=10.25, yields_to=NAME, zone=(111.61, 122.55),
        their_zone=(100.5, 111.4), otherwise=122.25, tried=True,
    )  # fmt: skip
    document.waits.append(reason)
    waits: list[WaitSummary] = waits_of(document)
    assert_fits(shown(waits_table(waits)), "robot", "lets", "other")
    fault = "recording ends at 1207.99 s"
    robots = [RobotVerdict(NAME, True, 1234.56, 0.1234, 12.345, fault, None, 0.0203)]
    verdict = Verdict(0, 0.3, [PairVerdict(NAME, "R2", 0.3, 12.0)], robots)
    told = summary.RunSummary("hall", False, 0, [], [], verdict, {}, {})
    for said in (shown(summary.render(told)), shown(summary.render_verdict(verdict))):
        assert_fits(said, "arrived", "tracking", "lateness", "clock", "unknown")
        assert "times in s from the first GO" in said


def test_the_table_of_a_running_fleet_fits():
    document = plan_scenario(HALL, effort=0)
    fleet = muster(packed(document), 9)
    for member in fleet.members.values():
        member.phase, member.fault = FROZEN, OFF_PATH
    fleet.phase = FREEZE
    assert_fits(shown(FleetTable(document, str).render(fleet, 10**9)), "robot", "phase", "progress")


def test_the_table_of_a_running_fleet_tells_who_is_held_and_since_when(monkeypatch):
    document = plan_scenario(HALL, effort=0)
    fleet = muster(packed(document), 9)
    fleet.phase = GO
    first, second = fleet.members
    for member in fleet.members.values():
        member.phase = MOVING
    monkeypatch.setattr(fleet, "held", lambda: [Held(first, second, 400)])
    said = shown(FleetTable(document, str).render(fleet, 3 * 10**9), width=160)
    assert f"held by {second} since 0.4 s" in said
    assert said.count("held by") == 1


def test_the_table_of_a_fleet_shows_robots_that_have_no_part_in_the_newest_plan(monkeypatch):
    monkeypatch.setattr(live_table, "time_of_day", lambda: "12:00:00")
    document = plan_scenario(HALL, effort=0)
    fleet = muster(packed(document), 9)
    fleet.members["R2"].phase, fleet.members["R2"].finished = DONE, True
    later = plan_scenario(msgspec.structs.replace(HALL, robots=HALL.robots[:1]), effort=0)
    table = FleetTable(document, str)
    table.follow(later)
    told = shown(table.render(fleet, 10**9))
    row = next(line for line in told.splitlines() if " R2 " in line)
    assert " done " in row
    assert " 100 " in row
    assert shown(FleetTable(later, str).render(fleet, 10**9)) == told
