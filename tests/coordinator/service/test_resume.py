"""Going on from the log of a coordinator that died, wherever its log ends."""

import asyncio
import random
from contextlib import suppress

import pytest

from coordinator.base.errors import InputError
from coordinator.fleet.phases import GO_LEAD
from coordinator.log.log_file import RESUMED, log_from_bytes, read_log
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.mission.mission import Mission
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_fleet
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from coordinator.service.coordinator_service import Service
from coordinator.service.launch import Coordinator
from coordinator.service.replay import check_log, go_on
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import PROTOCOL_VERSION, Command, Hello, Report, Rest
from protocol.phases import (
    ARMED,
    BRAKING,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    OVER,
)
from protocol.timing import MILLISECOND, SECOND
from tests.coordinator.service.test_coordinator_service import SCENARIO as FAST
from tests.coordinator.service.test_coordinator_service import Clock, Hand

EFFORT = 3
CUTS = 60

SCENARIO = FAST.replace(b"max_speed = 1.0", b"max_speed = 0.25")
OTHER_FLOOR = SCENARIO.replace(
    b"3.0, 3.0]", b"3.0, 3.0]\nobstacles = [[[1.0, 0.0], [2.0, 0.0], [2.0, 0.2]]]"
)


class FarHand(Hand):
    """A robot that drives until its coordinator is ended, at the `last` Command with GO."""

    def __init__(self, last):
        super().__init__()
        self.last, self.coordinator = last, None

    def respond(self, command):
        """Arm, drive, and freeze when told to, where it says then."""
        if (command.sequence, command.term) == (1, 1):
            self.say(keys.hello("one", "R1"), Hello(PROTOCOL_VERSION, 5))
        phase = {HOLD: ARMED, GO: MOVING, FREEZE: FROZEN}.get(command.phase, DONE)
        rest = Rest(0.5, command.epoch) if command.phase == FREEZE else None
        number = 1_000 * command.term + next(self.sequence)
        report = Report(5, number, command.epoch, phase, 0, rest)
        self.say(keys.report("one", "R1"), report)
        self.last -= command.phase == GO
        if self.last == 0:
            self.coordinator.cancel()


def planner(scenario, epoch):
    return plan_fleet(scenario, effort=EFFORT, epoch=epoch)


def logged(path, mission, scenario, *inner, **metadata):
    """The bytes of the log of a mission that drives for a while; a coordinator that is ended."""
    known = {"fleet": "one", "policy": "safe", "effort": str(EFFORT), "speed": "1.0"}
    files = [
        Attachment("scenario.json", "application/json", scenario_to_json(scenario)),
        Attachment("plan-1.json", "application/json", to_json(mission.document)),
        *inner,
    ]
    recorder = Recorder(path, metadata=known | metadata, wall_offset_ns=10**18, attachments=files)
    hand, clock = FarHand(10), Clock(30 * MILLISECOND)
    clock.now = int(metadata.get("began_ns", clock.now))
    service = Service(mission, hand, recorder, clock, speed=1000.0)

    async def run():
        hand.coordinator = asyncio.current_task()
        with suppress(asyncio.CancelledError):
            await service.run(60.0)

    asyncio.run(run())
    recorder.close()
    return path.read_bytes()


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    """The bytes of a log in which a robot sets out, and drives when its coordinator is ended."""
    scenario = parse_scenario(SCENARIO, "one.toml")
    mission = Mission.of_plan(scenario, planner(scenario, 1), 9, planner)
    return logged(tmp_path_factory.mktemp("log") / "run.mcap", mission, scenario, boot="9")


@pytest.fixture(scope="module")
def sequel(story, tmp_path_factory):
    """The bytes of the log that resumes it on another floor: the fleet is planned anew."""
    other = parse_scenario(OTHER_FLOOR, "one.toml")
    before = log_from_bytes(story, "run.mcap")
    began_ns = before.records[-1].log_ns + SECOND
    mission = go_on(before, 10, began_ns, other)
    inner = Attachment(RESUMED, "application/octet-stream", story)
    path = tmp_path_factory.mktemp("sequel") / "run.mcap"
    return logged(path, mission, other, inner, boot="10", began_ns=str(began_ns))


def test_the_sequel_has_a_second_epoch_that_went(sequel):
    log = log_from_bytes(sequel, "run.mcap")
    told = [decode("command", r.payload) for r in log.records if r.key == keys.command("one")]
    assert {(m.epoch, m.phase) for m in told} >= {(1, FREEZE), (2, HOLD), (2, GO)}
    assert check_log(log).difference == ""


def cut(story, phase, more):
    """A log that ends so many records after the first Command of a phase."""
    log = log_from_bytes(story, "run.mcap")
    said = ((i, decode("command", r.payload)) for i, r in enumerate(log.records))
    at = next(i for i, m in said if isinstance(m, Command) and m.phase == phase)
    del log.records[at + more :]
    return log, log.records[-1].log_ns + 2 * SECOND


@pytest.mark.parametrize(
    ("which", "found"), [("story", {(1, HOLD), (1, GO)}), ("sequel", {(1, FREEZE), (2, GO)})]
)
def test_wherever_the_log_ends_the_fleet_goes_on_where_it_was(which, found, request):
    story = request.getfixturevalue(which)
    chance, resumed = random.Random(5), set()
    for _ in range(CUTS):
        try:
            log = log_from_bytes(story[: chance.randrange(len(story))], "run.mcap")
        except InputError:
            continue  # Cut within the first bytes, before anything was said.
        if not log.records:
            continue
        told = [m for r in log.records if isinstance(m := decode("command", r.payload), Command)]
        if told and told[-1].phase == OVER:
            with pytest.raises(InputError, match="has ended"):
                go_on(log, 77, log.records[-1].log_ns + SECOND)
            continue
        last_ns = log.records[-1].log_ns
        fleet = go_on(log, 77, last_ns + SECOND).fleet
        assert fleet.members["R1"].boot in (None, 5)
        if not told:
            continue
        command = decode("command", fleet.tick(last_ns + SECOND)[0].payload)
        assert (command.boot, command.term) == (77, told[-1].term + 1)
        resumed.add((command.epoch, command.phase))
        if (command.epoch, command.phase) == (told[-1].epoch, told[-1].phase) == (1, GO):
            passed_ns = last_ns + SECOND - command.start_ns
            assert passed_ns == last_ns - told[-1].start_ns - GO_LEAD
        if fleet.members["R1"].planned:
            assert decode("plan", fleet.members["R1"].plan).boot == 77
    assert resumed >= found


def test_a_fleet_goes_on_in_its_second_epoch(sequel):
    log = log_from_bytes(sequel, "run.mcap")
    told = [decode("command", r.payload) for r in log.records]
    at = max(i for i, m in enumerate(told) if isinstance(m, Command) and m.phase == GO)
    del log.records[at + 1 :]
    now = log.records[-1].log_ns + SECOND
    command = decode("command", go_on(log, 77, now).fleet.tick(now)[0].payload)
    assert (command.epoch, command.phase, command.term) == (2, GO, 3)


def test_a_frozen_robot_is_asked_where_it_rests_and_planned_from_there(sequel):
    log, now = cut(sequel, FREEZE, 4)
    mission = go_on(log, 77, now)
    fleet = mission.fleet
    fleet.members["R1"].rest = None
    fleet.tick(now)
    assert mission.request(now + SECOND) is None
    key = keys.report("one", "R1")
    fleet.hear(key, encode(Report(5, 90_000, 1, FROZEN, 1)), now)
    (sent,) = fleet.tick(now + SECOND // 10)
    assert decode("command", sent.payload).wanted == ("R1",)
    fleet.hear(key, encode(Report(5, 90_001, 1, FROZEN, 1, Rest(0.75, 1))), now)
    fleet.tick(now + SECOND // 5)
    request = mission.request(now + SECOND // 5)
    assert request.epoch == 2
    assert request.told[0].s == 0.75
    assert mission.solve(request).document.epoch == 2


def test_a_robot_that_rests_where_it_cannot_be_by_the_log_shows_that_it_is_not_the_newest(sequel):
    for s, is_newest in ((0.75, True), (2.9, False)):
        log, now = cut(sequel, FREEZE, 1)
        mission = go_on(log, 77, now)
        mission.fleet.tick(now)
        rests = Report(5, 90_000, 1, FROZEN, 1, Rest(s, 1))
        mission.fleet.hear(keys.report("one", "R1"), encode(rests), now)
        mission.fleet.tick(now + SECOND // 5)
        before = len(mission.fleet.incidents)
        assert (mission.request(now + SECOND // 5) is not None) == is_newest
        assert mission.fleet.superseded != is_newest
        told = [one.text for one in mission.fleet.incidents[before:]]
        farther = "R1 rests farther along its path than it could be"
        assert told == [f"{farther}, which the log does not hold; is it the newest log?"] * (
            not is_newest
        )


@pytest.mark.parametrize(
    ("phase", "is_newest"),
    [
        (ARMED, True),
        (IDLE, True),
        (FROZEN, True),
        (MOVING, False),
        (BRAKING, False),
        (DONE, False),
    ],
)
def test_a_robot_that_has_set_out_though_the_log_holds_no_go_ends_the_going_on(
    story, phase, is_newest
):
    log, now = cut(story, HOLD, 4)
    mission = go_on(log, 77, now)
    fleet = mission.fleet
    fleet.tick(now)
    key = keys.report("one", "R1")
    fleet.hear(key, encode(Report(6, 10_000, 1, MOVING, 0)), now + 1)
    assert not fleet.superseded
    fleet.hear(key, encode(Report(5, 10_000, 1, phase)), now + 1)
    assert fleet.superseded != is_newest


def test_a_log_that_has_ended_or_is_none_is_not_gone_on_from(story, tmp_path):
    log = log_from_bytes(story, "run.mcap")
    with pytest.raises(InputError, match="the log cannot be resumed"):
        go_on(log.__class__({}, {}, [], True, ""), 77, 0)
    broken = tmp_path / "x.mcap"
    broken.write_bytes(story)
    assert RESUMED not in read_log(broken).attachments


def test_a_log_in_which_nothing_was_said_is_told_to_hold_no_message(story):
    log = log_from_bytes(story, "run.mcap")
    log.records.clear()
    with pytest.raises(
        InputError, match="it holds no message: nothing was under way, start a new run"
    ):
        go_on(log, 77, SECOND)


@pytest.mark.parametrize(
    ("old", "new", "difference"),
    [
        ("tau = 0.5", "tau = 0.6", "tau 0.5, but the scenario now has 0.6"),
        ("radius = 0.1", "radius = 0.2", "robots[R1].radius 0.1, but the scenario now has 0.2"),
        (
            "3.0, 3.0]",
            "3.0, 3.0]\nobstacles = [[[1.0, 0.0], [2.0, 0.0], [2.0, 0.2]]]",
            "workspace.obstacles none, but the scenario now has [[1.0,0.0],[2.0,0.0],[2.0,0.2]]"
            "; --with-scenario plans the fleet anew on the new floor",
        ),
    ],
)
def test_a_scenario_that_differs_from_the_log_is_not_gone_on_with(
    story, tmp_path, old, new, difference
):
    (tmp_path / "run.mcap").write_bytes(story[: len(story) // 4])
    scenario = parse_scenario(SCENARIO.replace(old.encode(), new.encode()), "one.toml")
    with pytest.raises(InputError) as caught:
        Coordinator(scenario, effort=EFFORT, speed=1.0, events=False)._go_on(
            9, tmp_path / "run.mcap"
        )
    (problem,) = caught.value.problems
    assert problem == f"--resume: {tmp_path / 'run.mcap'} was planned with {difference}"


def test_with_its_scenario_a_fleet_goes_on_on_another_floor_and_with_the_same_robots(
    story, tmp_path, capsys
):
    (tmp_path / "run.mcap").write_bytes(story[: len(story) // 4])
    other = OTHER_FLOOR
    coordinator = Coordinator(
        parse_scenario(other, "one.toml"), effort=EFFORT, speed=1.0, events=False
    )
    mission = coordinator._go_on(9, tmp_path / "run.mcap", with_scenario=True)
    assert mission.fleet.phase == FREEZE
    said = f"goes on from {tmp_path / 'run.mcap'}: 1 robot is under way"
    assert said in " ".join(capsys.readouterr().err.split())
    assert len(mission.site.scenario.workspace.obstacles) == 1
    wider = parse_scenario(other.replace(b"radius = 0.1", b"radius = 0.2"), "one.toml")
    with pytest.raises(InputError) as caught:
        Coordinator(wider, effort=EFFORT, speed=1.0, events=False)._go_on(
            9, tmp_path / "run.mcap", with_scenario=True
        )
    (problem,) = caught.value.problems
    assert problem.endswith("planned with robots[R1].radius 0.1, but the scenario now has 0.2")


def test_a_fleet_at_another_speed_is_not_gone_on_with(story, tmp_path):
    (tmp_path / "run.mcap").write_bytes(story[: len(story) // 4])
    scenario = parse_scenario(SCENARIO, "one.toml")
    with pytest.raises(InputError, match=r"--resume: .* is the log of a fleet at --speed 1\.0"):
        Coordinator(scenario, effort=EFFORT, speed=2.0, events=False)._go_on(
            9, tmp_path / "run.mcap"
        )
