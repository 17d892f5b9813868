"""Who was held, by whom and when, by hand-made Commands and Reports of a plan."""

import msgspec
import pytest

from coordinator.findings.held import Holds
from coordinator.findings.info import summarise
from coordinator.findings.info_table import render
from coordinator.log.records import Log, Record
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import packed
from coordinator.planning.planner import plan_scenario
from coordinator.proof.granted import Granted
from coordinator.schedule.staircase_making import with_staircases
from protocol import keys
from protocol.codec import encode
from protocol.messages import Command, Report
from protocol.phases import FREEZE, GO, MOVING
from tests.coordinator.findings.test_log_proof import CROSS

BEGIN, MS = 10**12, 10**6
BOOT = 9


@pytest.fixture(scope="module")
def plan():
    return with_staircases(packed(plan_scenario(CROSS)))


def told(plan, moments):
    """The summary of a log: (plan time [ms], phase, who is held to where, progress by robot)."""
    fleet, records, names = plan.document.scenario, [], list(plan.messages)
    for number, (at, phase, held, progress) in enumerate(moments, start=1):
        now = BEGIN + at * MS
        for robot, passed in progress.items():
            report = Report(1, number, 1, MOVING, stamp_ms=passed)
            records.append(Record(keys.report(fleet, robot), encode(report), now, now, 0))
        held_by_number = tuple((names.index(robot), to) for robot, to in held.items())
        command = Command(BOOT, 1, number, 1, phase, BEGIN, now, 1_500, held_by_number)
        records.append(Record(keys.command(fleet), encode(command), now, now, 0))
    metadata = {"fleet": fleet, "boot": str(BOOT), "policy": "safe"}
    return summarise(Log(metadata, {"plan-1.json": to_json(plan.document)}, records, True, ""))


def ends(plan):
    """Names of the robots behind and ahead, and where the one behind has to wait [ms]."""
    stairs, names = plan.staircases, list(plan.messages)
    return names[stairs.behind[0]], names[stairs.ahead[0]], int(stairs.at[0]) - 1


def test_a_robot_is_held_while_its_authority_ends_before_the_time_of_the_plan(plan):
    behind, ahead, wait = ends(plan)
    moments = [(at, GO, {}, {behind: at}) for at in range(0, wait - 1_000, 500)]
    stuck = {ahead: 100, behind: wait - 200}
    moments += [(wait + late, GO, {behind: wait}, stuck) for late in (-100, 100, 200, 900)]
    moments += [(wait + 1_000, GO, {}, {ahead: wait})]
    (held,) = told(plan, moments)["held"]
    since, until = (wait + 100) / 1000.0, (wait + 1_000) / 1000.0
    assert held == {
        "robot": behind,
        "by": ahead,
        "from": pytest.approx(since, abs=1e-3),
        "until": pytest.approx(until, abs=1e-3),
    }


def test_it_ends_with_a_freeze_and_is_shown_to_people(plan):
    behind, ahead, wait = ends(plan)
    near = {behind: wait - 200}
    moments = [(wait - 1_700, GO, {}, {}), (wait + 500, GO, {behind: wait}, near)]
    moments += [(wait + 900, FREEZE, {}, {})]
    summary = told(plan, moments)
    assert summary["held"][0]["until"] == pytest.approx((wait + 900) / 1000.0, abs=1e-3)
    (freeze,) = [one["fault"] for one in summary["faults"] if one["kind"] == "freeze"]
    assert freeze == f"the fleet was told to freeze: others were held by {ahead}"
    shown = [str(part) for part in render(summary).renderables]
    assert any(f"{behind} was held by {ahead} from" in text for text in shown)


def test_nobody_is_held_from_a_freeze_on_whomever_its_command_speaks_of(plan):
    behind, ahead, wait = ends(plan)
    granted, holds = Granted(plan), Holds()
    for phase, at in ((GO, wait - 1_700), (GO, wait + 500), (FREEZE, wait + 900)):
        number = list(plan.messages).index(behind)
        held = ((number, wait),) if at > wait else ()
        command = Command(BOOT, 1, 1, 1, phase, BEGIN, BEGIN + at * MS, 1_500, held, 9, 9)
        if phase == GO:
            command = msgspec.structs.replace(command, first=0)
            granted.take_command(command)
            granted.take_report(behind, Report(1, at, 1, MOVING, stamp_ms=wait - 200))
        holds.take(command, granted, at)
        assert [one.by for one in holds.now] == ([ahead] if at == wait + 500 else [])
    holds.take(msgspec.structs.replace(command, phase=GO, epoch=2), None, wait + 1_000)
    assert [one.until_ns for one in holds.all] == [wait + 900]


def test_a_late_robot_that_nobody_is_in_the_way_of_is_held_by_nobody(plan):
    behind, _, wait = ends(plan)
    moments = [(0, GO, {}, {}), (wait + 500, GO, {behind: wait}, {behind: wait - 1_100})]
    assert told(plan, moments)["held"] == []


def test_a_robot_whose_own_silence_ends_its_authority_is_held_by_nobody(plan):
    _, ahead, _ = ends(plan)
    assert told(plan, [(0, GO, {}, {}), (9_000, GO, {ahead: 100}, {})])["held"] == []


def test_nobody_is_held_in_a_log_without_such_commands(plan):
    assert told(plan, [(0, GO, {}, {}), (500, GO, {}, {})])["held"] == []
