"""Fleets' logs that several tests take apart."""

import asyncio

import pytest

from coordinator.exchange.motion_story import story_of_log
from coordinator.log import log_writer
from coordinator.log import recorder as recorder_module
from coordinator.log.log_file import read_log
from coordinator.log.log_writer import Attachment
from coordinator.log.recorder import Recorder
from coordinator.mission.mission import Mission
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import packed
from coordinator.planning.planner import plan_fleet, plan_scenario
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from coordinator.service import replay
from coordinator.service.coordinator_service import Service
from tests.coordinator.a_day import drive_a_day
from tests.coordinator.findings.two_epochs import first_plan, log_of, second_plan
from tests.coordinator.service.test_coordinator_service import SCENARIO, Clock, Hand


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """The bytes of a fleet's log in many small chunks, from its first Command to OVER."""
    patch = pytest.MonkeyPatch()
    patch.setattr(log_writer, "CHUNK_BYTES", 90)
    patch.setattr(recorder_module, "FLUSH_PERIOD_S", 60.0)
    scenario = parse_scenario(SCENARIO, "one.toml")
    document = plan_scenario(scenario, effort=3)
    path = tmp_path_factory.mktemp("recover") / "run.mcap"
    recorder = Recorder(
        path,
        metadata={"fleet": "one", "policy": "safe", "boot": "9", "effort": "3"},
        wall_offset_ns=10**18,
        attachments=[Attachment("scenario.json", "application/json", scenario_to_json(scenario))],
    )
    mission = Mission.of_plan(
        scenario, packed(document), 9, lambda s, epoch: plan_fleet(s, effort=3, epoch=epoch)
    )
    recorder.attach("plan-1.json", "application/json", to_json(document))
    service = Service(mission, Hand(), recorder, Clock(), speed=1000.0)
    with recorder:
        assert asyncio.run(service.run(patience_s=60.0))
    patch.undo()
    return path.read_bytes()


@pytest.fixture
def planned_once(monkeypatch):
    """Let a thousand checks of the same log plan its scenario once."""
    known = {}

    def plan_here(scenario, effort, epoch=1):
        key = (scenario_to_json(scenario), effort, epoch)
        if key not in known:
            known[key] = plan_fleet(scenario, effort=effort, epoch=epoch)
        return known[key]

    monkeypatch.setattr(replay, "plan_here", plan_here)


@pytest.fixture(scope="session")
def document():
    """The plan of the first epoch of two."""
    return first_plan()


@pytest.fixture(scope="session")
def second(document):
    """The plan of the second."""
    return second_plan(document)


@pytest.fixture
def story(tmp_path, document, second):
    """What happened in a log of both."""
    return story_of_log(read_log(log_of(tmp_path / "run.mcap", document, second)))


@pytest.fixture(scope="session")
def day(tmp_path_factory):
    """The logs of a fleet that gets orders, and its black boxes."""
    return drive_a_day(tmp_path_factory.mktemp("day"))
