"""What the coordinator's command tells people besides the fleet's own incidents."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.desk.alarms import Alarms
from coordinator.fleet.phases import GO_LEAD
from coordinator.mission.mission import Mission
from coordinator.mission.replanning_input import Aside, Site
from coordinator.planning.planner import plan_fleet, plan_scenario
from coordinator.service import launch
from coordinator.service.launch import Coordinator
from coordinator.service.meeting_place import MeetingPlace
from coordinator.view.live_table import FleetTable
from protocol.messages import REFUSED, OrderState
from protocol.timing import SECOND
from tests.scenarios import a_robot, a_scenario

HALL = a_scenario([a_robot("R1", (1.0, 1.0), (9.0, 7.0)), a_robot("R2", (1.0, 7.0), (9.0, 1.0))])


@pytest.fixture
def told(monkeypatch):
    lines = []
    monkeypatch.setattr(launch, "tell_now", lines.append)
    return lines


PLACE = "It stands at (1.00, 7.00):"
RESTART = "start its program there (`splinefleet agent R2 --at X Y HEADING --connect ...`)"
ADMIT = "`splinefleet admit R2 --connect ...`"
CARRY = "carry it away and `splinefleet leave R2 --connect ...`"


@pytest.mark.parametrize(
    ("why", "said"),
    [
        ("lost", [f"it is lost, no longer heard. {PLACE} {RESTART} and {ADMIT}, or {CARRY}"]),
        ("unfit", [f"it has failed in 3 epochs. {PLACE} see to it, then {ADMIT}"]),
        ("overloaded", [f"it cannot hold its course. {PLACE} see to it, then {ADMIT}"]),
        ("arrived", []),
        ("closed in", []),
    ],
)
def test_a_robot_that_an_epoch_goes_on_without_is_told_once_with_the_reason(told, why, said):
    mission = Mission.of_plan(HALL, plan_fleet(HALL, effort=0), 9, lambda *_: None)
    coordinator = Coordinator(HALL, effort=0, speed=1.0, events=False)
    one, two = mission.site.scenario.robots
    aside = Aside(two, why, np.array([two.start[:2]]), None)
    mission.site = Site(replace(mission.site.scenario, robots=(one,)), (aside,))
    coordinator._tell_aside(mission, 0)
    coordinator._tell_aside(mission, 0)
    assert told == [f"R2 has no part in the next epoch: {text}" for text in said]


def test_a_robot_that_may_stand_on_a_stretch_is_said_to_stand_between_its_ends():
    stretch = np.array([[1.0, 7.0], [1.02, 7.0], [3.5, 6.25]])
    assert str(Aside(HALL.robots[1], "lost", stretch, None)) == (
        "stands between (1.00, 7.00) and (3.50, 6.25)"
    )


def test_a_refusal_is_told_once_although_it_calls_a_person_on_the_desk(told):
    coordinator = Coordinator(HALL, effort=0, speed=1.0, events=False)
    alarms = Alarms()
    alarms.take_order(OrderState("far", REFUSED, "R1", reason="off the floor"), 0.0)
    alarms.log_failed("the disk is full", 1.0)
    for alarm in alarms.now():
        coordinator._tell_alarm(alarm, alarm.text)
    assert told == ["the disk is full"]


def test_arrivals_count_from_the_first_go_whatever_epoch_they_were_in(told):
    mission = Mission.of_plan(HALL, plan_fleet(HALL, effort=0), 9, lambda *_: None)
    fleet, coordinator = mission.fleet, Coordinator(HALL, effort=0, speed=1.0, events=False)
    events = (6, "all armed"), (9, "floor changed"), (10, "planned"), (11, "all armed")
    for seconds, event in events:
        fleet._turn(event, seconds * SECOND)
    assert fleet.times.start_ns == 11 * SECOND + GO_LEAD
    fleet.members["R1"].done_ns = 20 * SECOND + GO_LEAD
    coordinator._summarise(fleet, False, {})
    assert told == ["R1: arrived 14.0 s after the first GO", "R2: ended idle"]


def test_a_later_plan_that_cannot_be_written_ends_no_fleet(told, tmp_path):
    document = replace(plan_scenario(HALL, effort=0), epoch=2)
    coordinator = Coordinator(HALL, effort=0, speed=1.0, events=False)
    coordinator._keep(document, tmp_path / "gone" / "plan.json", FleetTable(document, str))
    assert told == [
        f"{tmp_path}/gone/plan-2.json: No such file or directory",
        "epoch 2: 2 robots go on",
    ]


def test_going_on_from_a_log_without_another_one_is_warned_of(told, tmp_path):
    coordinator = Coordinator(HALL, effort=0, speed=1.0, events=False)
    with pytest.raises(InputError):
        coordinator.run(MeetingPlace("tcp/127.0.0.1:1"), None, None, 1.0, tmp_path / "none.mcap")
    assert told == [launch.NO_LOG]


def test_an_earlier_log_of_the_same_name_is_kept(told, tmp_path):
    coordinator = Coordinator(HALL, effort=0, speed=1.0, events=False)
    document, log = plan_scenario(HALL, effort=0), tmp_path / "run.mcap"
    for number in range(3):
        log.write_bytes(b"earlier log %d" % number)
        coordinator._recorder(log, document, 9, None).close()
    kept = [(tmp_path / f"run.mcap.{number}").read_bytes() for number in (1, 2, 3)]
    assert kept == [b"earlier log 0", b"earlier log 1", b"earlier log 2"]
    assert told[0] == f"{log} is there already; it is now {log}.1"


@pytest.mark.parametrize(
    ("endpoint", "keys", "said"),
    [
        ("tcp/127.0.0.1:7447", None, "--connect tcp/127.0.0.1:7447"),
        ("tls/[::1]:7447", Path("keys"), "--connect tls/[::1]:7447 --keys keys"),
        ("tcp/0.0.0.0:7447", None, "--connect ..."),
    ],
)
def test_commands_that_are_advised_name_the_endpoint_if_others_reach_it(endpoint, keys, said):
    assert MeetingPlace(endpoint).options(keys) == said


def test_the_advice_to_start_a_robot_again_can_be_followed(told):
    coordinator = Coordinator(HALL, effort=0, speed=1.0, events=False)
    coordinator._reach = MeetingPlace("tcp/127.0.0.1:7447").options(None)
    coordinator._say("aside", text=f"{RESTART} and {ADMIT}")
    reach = "--connect tcp/127.0.0.1:7447"
    assert told == [
        f"start its program there (`splinefleet agent R2 --at X Y HEADING {reach}`) and "
        f"`splinefleet admit R2 {reach}`"
    ]
