"""The coordinator's shell on a transport that the test holds in its hands."""

import asyncio
import itertools

import msgspec
import pytest

from coordinator.base.errors import LogError
from coordinator.log.log_file import read_log
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.mission.mission import Mission
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import packed
from coordinator.planning.planner import plan_fleet, plan_scenario
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from coordinator.service.coordinator_service import Service
from coordinator.service.replay import check_log
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import PROTOCOL_VERSION, REFUSED, Command, Hello, Plan, Report, Rest
from protocol.phases import ARMED, DONE, FREEZE, FROZEN, GO, HOLD, MOVING, OFF_PATH, OVER
from protocol.timing import MILLISECOND
from protocol.transport import Transport

SCENARIO = b"""
name = "one"
tau = 0.5
[workspace]
bounds = [0.0, 0.0, 3.0, 3.0]
[[robots]]
id = "R1"
start = [0.5, 0.5]
goal = [2.5, 2.5]
radius = 0.1
max_speed = 1.0
"""


class Hand(Transport):
    """A transport whose other end is a robot that answers every Command at once."""

    def __init__(self):
        self.handlers = []
        self.commands = []
        self.plans = []
        self.sequence = itertools.count(1)

    def put(self, key, payload):
        message = decode(keys.split(key)[1], payload)
        if isinstance(message, Command):
            self.commands.append(message)
            self.respond(message)
        if isinstance(message, Plan):
            self.plans.append(message)

    def subscribe(self, _key_expression, handler):
        self.handlers.append(handler)

    def declare_alive(self, key):
        pass

    def watch_alive(self, _key_expression, handler):
        pass

    def close(self):
        pass

    def respond(self, command):
        if command.sequence == 1:
            self.say(keys.hello("one", "R1"), Hello(PROTOCOL_VERSION, 5))
        moving = MOVING if command.sequence < 8 else DONE
        phase = {HOLD: ARMED, GO: moving, OVER: DONE, FREEZE: DONE}
        report = Report(5, next(self.sequence), 1, phase[command.phase])
        self.say(keys.report("one", "R1"), report)

    def say(self, key, message):
        self.handlers[0](key, encode(message), None)


class Clock:
    """A clock on which time passes at every look: no test waits for it."""

    def __init__(self, step=MILLISECOND):
        self.now = 10**9
        self.step = step

    def __call__(self):
        self.now += self.step
        return self.now


def _mission(scenario, document):
    return Mission.of_plan(
        scenario, packed(document), 9, lambda s, epoch: plan_fleet(s, effort=3, epoch=epoch)
    )


@pytest.fixture
def scenario():
    return parse_scenario(SCENARIO, "one.toml")


@pytest.fixture
def recorded(tmp_path, scenario):
    """A service with its hand, its recorder, and the path of the log."""
    document = plan_scenario(scenario, effort=3)
    recorder = Recorder(
        tmp_path / "run.mcap",
        metadata={"fleet": "one", "policy": "safe", "boot": "9", "effort": "3"},
        wall_offset_ns=10**18,
        attachments=[
            Attachment("scenario.json", "application/json", scenario_to_json(scenario)),
            Attachment("plan-1.json", "application/json", to_json(document)),
        ],
    )
    hand = Hand()
    service = Service(
        _mission(scenario, document), hand, recorder, Clock(20 * MILLISECOND), speed=1000.0
    )
    yield service, hand, recorder
    recorder.close()


async def test_a_fleet_is_run_to_its_end_and_its_log_can_be_run_again(recorded, tmp_path):
    service, hand, recorder = recorded
    assert await service.run(patience_s=60.0)
    recorder.close()
    assert {command.phase for command in hand.commands} == {HOLD, GO, OVER}
    result = check_log(read_log(tmp_path / "run.mcap"))
    assert result.difference == ""
    assert result.commands == len(hand.commands)


async def test_a_decision_that_the_code_would_not_take_is_found_at_its_message(recorded, tmp_path):
    service, hand, recorder = recorded
    await service.run(patience_s=60.0)
    recorder.close()
    log = read_log(tmp_path / "run.mcap")
    place = next(
        i
        for i, record in enumerate(log.records)
        if record.key == keys.command("one") and decode("command", record.payload).phase == GO
    )
    record = log.records[place]
    told = decode("command", record.payload)
    payload = encode(msgspec.structs.replace(told, phase=HOLD, start_ns=0))
    log.records[place] = msgspec.structs.replace(record, payload=payload)
    result = check_log(log)
    assert f"message {place} on {record.key}" in result.difference
    assert hand.commands


async def test_a_fleet_whose_robots_never_come_is_given_up(recorded):
    service, hand, _ = recorded
    service._clock.step = 60 * MILLISECOND
    hand.respond = lambda _command: None
    assert not await service.run(patience_s=3.0)
    assert "R1" in service.fleet.incidents[-1].text


@pytest.mark.parametrize("phase", [HOLD, GO])
async def test_a_log_that_cannot_be_written_is_told_at_once_and_no_go_is_sent_without_it(
    recorded, phase
):
    service, hand, recorder = recorded
    answer, told = hand.respond, []

    def fill_the_disk(command):
        if command.phase == phase:
            recorder._writer._stream.close()
            recorder.record("any", b"", 1)
            recorder.sync()
        answer(command)

    def watch(fleet, _now):
        if recorder.error is not None and fleet.phase != OVER:
            told.append([one.text for one in fleet.incidents if one.kind == "log"])

    hand.respond, service._watch = fill_the_disk, watch
    assert await service.run(patience_s=60.0) == (phase == GO)
    assert not recorder.sync()
    assert told
    assert all(len(texts) == 1 and "the log cannot be written" in texts[0] for texts in told)
    assert {one.phase for one in hand.commands} == ({HOLD} if phase == HOLD else {HOLD, GO, OVER})
    with pytest.raises(LogError):
        recorder.close()


async def test_a_robot_that_stopped_is_sent_no_further_course_without_a_log(recorded):
    service, hand, recorder = recorded
    answer = hand.respond

    def fail_on_the_way(command):
        if command.phase == GO:
            recorder._writer._stream.close()
            stopped = Report(5, next(hand.sequence), 1, FROZEN, OFF_PATH, Rest(0.1, 1))
            hand.say(keys.report("one", "R1"), stopped)
            return
        if command.phase == HOLD:
            answer(command)

    hand.respond = fail_on_the_way
    assert not await service.run(patience_s=60.0)
    assert service.fleet.orders.tasks["way-1"].state == REFUSED
    assert {(one.phase, one.epoch) for one in hand.commands} == {(HOLD, 1), (GO, 1), (OVER, 1)}
    assert {(plan.epoch, plan.revision) for plan in hand.plans} == {(1, 0)}
    with pytest.raises(LogError):
        recorder.close()


async def test_a_flood_is_dropped_and_counted_beyond_its_bound_and_ends_nothing(recorded):
    service, hand, _ = recorded

    def flood():
        for _ in range(20_000):
            hand.handlers[0]("splinefleet/one/report/R1", b"junk", None)

    asyncio.get_running_loop().call_soon(flood)
    await service.run(patience_s=60.0)
    assert sum(service.driver.intake.dropped.values()) > 15_000
    assert service.fleet.bad_messages > 0
