"""The proof of a log: what a coordinator granted is checked Command by Command."""

import msgspec
import pytest
from typer.testing import CliRunner

from coordinator.cli.plan_commands import commands
from coordinator.findings.granted_courses import GrantedCourses
from coordinator.findings.log_proof import prove_log
from coordinator.log.log_file import logs_before, read_log
from coordinator.log.recover import make_whole
from coordinator.plan.staircases import NO_STAIRCASES
from coordinator.plan.wire import packed
from coordinator.planning.planner import plan_scenario
from coordinator.proof.granted import Granted
from coordinator.schedule.staircase_making import with_staircases
from protocol.codec import decode, encode
from protocol.messages import Command, Plan, Report
from protocol.phases import DONE, GO
from sim.campaigns.campaign import LINKS, Wish, make_world, run_seed, run_world
from sim.floors.generator import generate
from sim.world.fault_text import Fault
from sim.world.run_logs import RunLogs
from tests.scenarios import a_robot, a_scenario
from tests.sweeps import seeds

CROSS = a_scenario(
    [a_robot("R1", (1.0, 4.0), (9.0, 4.0)), a_robot("R2", (5.0, 1.0), (5.0, 7.0))], tau=0.6
)


def go(sequence, all_ms, held=()):
    """A Command that grants all robots a plan time [ms], and those held by number another one."""
    return Command(9, 1, sequence, 1, GO, 0, 0, all_ms, held)


@pytest.fixture(scope="module")
def plan():
    return with_staircases(packed(plan_scenario(CROSS)))


@pytest.fixture(scope="module")
def log_path(tmp_path_factory):
    """The log of two robots that cross, in virtual time."""
    folder = tmp_path_factory.mktemp("run")
    scenario = msgspec.structs.replace(CROSS, link=LINKS[0])
    document = plan_scenario(scenario)
    logs = RunLogs(folder)
    world = make_world(scenario, document, 3, [], logs=logs)
    run_world(world, document)
    logs.close()
    return folder / "run.mcap"


def changed(log, change):
    """The log with each message changed by a function of it; None leaves a message as it is."""
    records = []
    for record in log.records:
        kind = record.key.split("/")[2] if record.key.startswith("splinefleet/") else ""
        message = decode(kind, record.payload) if kind in ("plan", "command", "report") else None
        other = None if message is None else change(message)
        payload = record.payload if other is None else encode(other)
        records.append(msgspec.structs.replace(record, payload=payload))
    return msgspec.structs.replace(log, records=records)


def test_a_log_as_it_was_recorded_is_proven(log_path):
    proof = prove_log(read_log(log_path))
    assert proof.holds
    assert proof.epochs[0].commands > 50
    assert all(epoch.proof.holds for epoch in proof.epochs)


def test_authority_that_goes_on_for_a_robot_that_reports_nothing_is_found(log_path):
    def mute(message):
        if isinstance(message, Report):
            return msgspec.structs.replace(message, stamp_ms=None)
        return None

    proof = prove_log(changed(read_log(log_path), mute))
    assert not proof.holds
    assert "has reported 0.000 s" in proof.epochs[0].failures[0]


def test_reports_of_a_strange_process_are_no_progress(log_path):
    def mute(message):
        if isinstance(message, Report):
            return msgspec.structs.replace(message, stamp_ms=None)
        return None

    log = changed(read_log(log_path), mute)
    records = []
    for record in log.records:
        records.append(record)
        if record.key.split("/")[2:3] == ["report"]:
            said = decode("report", record.payload)
            forged = msgspec.structs.replace(said, boot=999, stamp_ms=10**6)
            records.append(msgspec.structs.replace(record, payload=encode(forged)))
    assert not prove_log(msgspec.structs.replace(log, records=records)).holds


def test_a_fleet_that_drives_by_a_plan_that_the_log_does_not_hold_is_found(log_path):
    def elsewhere(message):
        if isinstance(message, Command):
            return msgspec.structs.replace(message, epoch=7)
        return None

    proof = prove_log(changed(read_log(log_path), elsewhere))
    assert not proof.holds
    assert [epoch.epoch for epoch in proof.epochs] == [1, 7]
    assert "does not hold its plan" in proof.epochs[1].proof.failures[0]


def test_a_robot_at_its_goal_holds_nobody_and_is_granted_nothing(plan):
    names = [robot.id for robot in plan.document.robots]
    stairs = plan.staircases
    behind, ahead = int(stairs.behind[0]), int(stairs.ahead[0])
    granted = Granted(plan)
    far, near = 10**8, ((behind, int(stairs.at[0]) - 1),)
    granted.take_command(go(1, far, near))
    granted.take_report(names[ahead], Report(1, 1, 1, DONE))
    granted.take_command(go(2, far, ((behind, int(stairs.at[-1])),)))
    assert granted.failures == []
    assert granted.holder(names[behind]) is None


def test_a_robot_that_claims_a_goal_to_which_nobody_let_it_drive_has_not_passed_anything(plan):
    names = [robot.id for robot in plan.document.robots]
    stairs = plan.staircases
    behind, ahead = int(stairs.behind[0]), int(stairs.ahead[0])
    granted = Granted(plan)
    granted.take_command(go(1, int(stairs.at[0]) - 1))
    granted.take_report(names[ahead], Report(1, 1, 1, DONE, stamp_ms=10**8))
    assert granted.failures == []
    granted.take_command(go(2, int(stairs.at[0]) - 1, ((behind, int(stairs.at[-1])),)))
    assert "must have passed" in granted.failures[0]


def test_authority_of_a_held_robot_that_is_granted_as_to_all_others_is_found(plan):
    """One robot is behind the other: what it may not pass is left out of the Command."""
    names = [robot.id for robot in plan.document.robots]
    stairs = plan.staircases
    behind, ahead = int(stairs.behind[0]), int(stairs.ahead[0])
    needs = int(stairs.at[0])
    granted = Granted(plan)
    before = ((behind, needs - 1),)
    granted.take_command(go(1, needs + 500, before))
    assert granted.failures == []
    granted.take_command(go(2, needs + 600))
    assert len(granted.failures) == 1
    assert f"grants {names[behind]} plan time" in granted.failures[0]
    assert f"; {names[ahead]} must have passed" in granted.failures[0]


def test_a_step_too_far_is_found(plan):
    names = [robot.id for robot in plan.document.robots]
    stairs = plan.staircases
    behind, ahead = int(stairs.behind[0]), int(stairs.ahead[0])
    passed, last = int(stairs.need[0]) - 100, int(stairs.at[0])
    for step, failures in ((-1, 0), (0, 1)):
        granted = Granted(plan)
        granted.take_command(go(1, passed))
        granted.take_report(names[ahead], Report(1, 1, 1, 2, stamp_ms=passed))
        held = ((behind, last + step),)
        granted.take_command(go(2, passed + 1, held))
        assert len(granted.failures) == failures


def test_authority_for_a_robot_that_has_left_is_found(plan):
    robot = plan.document.robots[1].id
    granted = Granted(plan)
    granted.leave(robot)
    granted.take_command(go(1, 100, ((1, 0),)))
    assert granted.failures == []
    granted.take_command(go(2, 100))
    assert granted.failures == [
        f"Command 2 of epoch 1 lets {robot} drive, which has left the fleet"
    ]


def test_a_report_that_claims_more_than_was_granted_counts_no_further(plan):
    names = [robot.id for robot in plan.document.robots]
    granted = Granted(plan)
    for robot in names:
        granted.take_report(robot, Report(1, 1, 1, 2, stamp_ms=10**6))
    granted.take_command(go(1, 10**6))
    assert granted.failures


def test_what_a_coordinator_that_died_may_have_granted_counts_as_far_as_the_log_says(plan):
    """The log said ahead that robots may be told to drive up to 5 s; its last Commands are lost."""
    names = [robot.id for robot in plan.document.robots]
    found = []
    for may_have_ms in (0, 5_000):
        granted = Granted(plan)
        granted.take_command(go(1, 1_000))
        granted.lose_sight(may_have_ms)
        for robot in names:
            granted.take_report(robot, Report(1, 1, 1, 2, stamp_ms=10**6))
        found.append(granted._passed[: len(names)].tolist())
    assert found == [[1_000.0] * len(names), [5_000.0] * len(names)]


def next_course(plan, number, revision=1, begin_ms=2_000):
    """A further course of R1, with other numbers."""
    first = plan.driven[0].plan
    return msgspec.structs.replace(first, number=number, revision=revision, begin_ms=begin_ms)


def test_what_is_in_no_log_counts_on_the_next_course_as_far_as_that_is_the_same(plan):
    granted = Granted(plan)
    granted.take_command(go(1, 1_000))
    granted.lose_sight(5_000)
    granted.add_course("R1", next_course(plan, 2), [], NO_STAIRCASES, 3_000)
    assert granted.stretches("R1") == [(0, 0.0, 5_000.0), (1, 0.0, 3_000.0)]
    granted.take_report("R1", Report(1, 1, 1, 2, stamp_ms=10**6, revision=1))
    assert granted.stretches("R1") == [(1, 3_000.0, 3_000.0)]


def test_what_was_granted_to_numbers_that_were_not_known_yet_counts_for_their_courses(plan):
    granted = Granted(plan)
    ahead = Command(9, 1, 1, 1, GO, 0, 0, 1_000, ((3, 4_000), (4, 0)), last=5)
    granted.add_course("R1", next_course(plan, 5), [], NO_STAIRCASES, 2_000)
    granted.take_command(ahead)
    granted.take_report("R1", Report(1, 1, 1, 2, stamp_ms=2_000, revision=1))
    granted.add_course("R1", next_course(plan, 3, 2, 2_500), [], NO_STAIRCASES, 2_500)
    assert granted.stretches("R1")[1] == (2, 2_000.0, 4_000.0)


def test_a_command_that_says_nothing_of_a_course_grants_nothing_on_it(plan):
    granted = Granted(plan)
    granted.add_course("R1", next_course(plan, 2), [], NO_STAIRCASES, 2_000)
    granted.take_command(Command(9, 1, 1, 1, GO, 0, 0, 3_000, (), last=1))
    assert granted.stretches("R1") == [(0, 0.0, 3_000.0), (1, 0.0, 2_000.0)]


@pytest.mark.parametrize("is_before", [True, False])
def test_a_course_keeps_off_those_that_others_went_around_when_it_was_found(plan, is_before):
    granted = GrantedCourses(plan, prove=True)
    granted.take_command(go(1, 4_000))
    steps = [lambda: granted.go_around("R2"), lambda: granted.take_search("R1", 1)]
    for step in steps if is_before else reversed(steps):
        step()
    anew = msgspec.structs.replace(plan.driven[0].plan, number=2, revision=1)
    granted.take_plan("R1", anew)
    assert any("of where R2 may stand" in one for one in granted.failures) is is_before


def test_a_number_given_twice_is_found(log_path):
    def twice(message):
        return msgspec.structs.replace(message, number=0) if isinstance(message, Plan) else None

    proof = prove_log(changed(read_log(log_path), twice))
    assert not proof.holds
    assert len(proof.epochs[0].failures) == 1
    assert (
        "R2 was sent is not the one proven; its number 0 is that of R1"
        in (proof.epochs[0].failures[0])
    )


def test_a_plan_that_leaves_a_stop_earlier_than_proven_is_found(log_path):
    def early(message):
        if not isinstance(message, Plan) or not message.stops:
            return None
        return msgspec.structs.replace(message, stops=b"")

    proof = prove_log(changed(read_log(log_path), early))
    assert [one.split(" that ")[1] for one in proof.epochs[0].failures] == [
        "R1 was sent is not the one proven"
    ]


def test_the_command_line_proves_a_log_and_says_so(log_path):
    done = CliRunner().invoke(commands, ["verify", str(log_path)])
    assert done.exit_code == 0
    assert "Commands granted no more than is safe" in done.output
    done = CliRunner().invoke(commands, ["verify", str(log_path), "--json"])
    assert msgspec.json.decode(done.output)["holds"] is True


def test_of_a_log_that_was_not_closed_is_said_that_its_end_is_not_proven(log_path, tmp_path):
    cut = tmp_path / "cut.mcap"
    data = log_path.read_bytes()
    cut.write_bytes(data[: read_log(log_path).records[-1].offset + 10])
    done = CliRunner().invoke(commands, ["verify", str(cut)])
    assert done.exit_code == 0
    assert "was not closed; what may have come after its end is not proven" in done.stderr
    assert "was not closed" not in CliRunner().invoke(commands, ["verify", str(log_path)]).output


@pytest.mark.parametrize("seed", [11, 21, 22, *seeds(8)])
def test_every_log_of_a_campaign_is_proven_whatever_fails(seed, tmp_path):
    run_seed(generate("warehouse", 8, 1), seed, Wish(tau=0.3), folder=tmp_path)
    for path in tmp_path.glob("*.mcap"):
        log = read_log(path)
        proof = prove_log(log, before=logs_before(log))
        assert [failure for epoch in proof.epochs for failure in epoch.failures] == []
        assert all(epoch.proof.holds for epoch in proof.epochs)


@pytest.mark.parametrize("at", [2.0, 4.5, 7.0])
def test_the_log_of_a_coordinator_that_took_over_is_proven_from_the_one_before(at, tmp_path):
    faults = [Fault("coordinator-restart", "", at, 1.5)]
    outcome = run_seed(generate("warehouse", 8, 1), 3, Wish(tau=0.3), faults, tmp_path)
    assert outcome.over
    assert outcome.epochs == 1
    logs = [read_log(path) for path in sorted(tmp_path.glob("*.mcap"))]
    assert len(logs) == 2
    assert all(prove_log(log, before=logs_before(log)).holds for log in logs)


def test_a_log_that_has_lost_messages_is_not_proven(log_path, tmp_path):
    data = bytearray(log_path.read_bytes())
    chunk = read_log(log_path).records[0].offset
    data[chunk + 60] ^= 0xFF
    damaged, whole = tmp_path / "damaged.mcap", tmp_path / "whole.mcap"
    damaged.write_bytes(data)
    whole.write_bytes(make_whole(bytes(data), "damaged.mcap").data)
    for path in (damaged, whole):
        done = CliRunner().invoke(commands, ["verify", str(path), "--json"])
        told = msgspec.json.decode(done.stdout)
        assert (done.exit_code, told["holds"]) == (1, False)
        assert f"damaged at byte {chunk} (chunk)" in told["damage"]
        shown = " ".join(CliRunner().invoke(commands, ["verify", str(path)]).stdout.split())
        assert "messages may be missing, and these are not proven" in shown
    assert prove_log(read_log(log_path)).damage == ""


def test_a_log_that_was_cut_short_and_recovered_is_proven(log_path, tmp_path):
    data = log_path.read_bytes()
    whole = tmp_path / "whole.mcap"
    whole.write_bytes(make_whole(data[: len(data) // 2], "cut.mcap").data)
    assert prove_log(read_log(whole)).holds
