"""Logs of fleets in virtual time, gone on from at each of their checkpoints."""

import dataclasses
from itertools import pairwise

import pytest
from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.findings.traffic_numbers import first_go
from coordinator.fleet.log_records import is_checkpoint_key
from coordinator.log.log_file import log_from_bytes, read_log
from coordinator.mission import mission_driver
from coordinator.mission.checkpoint import checkpoint_of, mission_of
from coordinator.mission.in_force import in_force_failures
from coordinator.plan.course_staircases import CourseStaircases
from coordinator.plan.staircases import NO_STAIRCASES
from coordinator.scenario.model import Demand
from coordinator.service.launch import Coordinator
from coordinator.service.replay import check_log, go_on, mission_at_end, scenario_of
from protocol.messages import UNDER_WAY
from protocol.timing import SECOND
from sim.floors.generator import generate
from sim.world.run_logs import RunLogs
from tests.sim.world.test_orders_in_time import a_world, nobody_touches


def a_busy_day(kind, count, seed):
    made = generate(kind, count, seed)
    docks = tuple(place[:2] for one in made.robots for place in (one.start, one.goal))
    robots = tuple(replace(one, goal=one.start, via=()) for one in made.robots)
    demand = Demand(places=docks, per_robot=3, first_within=5.0, seed=seed)
    return replace(made, robots=robots, demand=demand)


@pytest.mark.parametrize(
    ("kind", "faults"),
    [
        ("warehouse", []),
        ("rooms", ["stall:R2@20:9"]),
        ("open", ["kill:R1@9", "coordinator-restart@30:3"]),
    ],
)
def test_a_fleet_goes_on_from_each_checkpoint_as_its_log_says(tmp_path, monkeypatch, kind, faults):
    monkeypatch.setattr(mission_driver, "_CHECKPOINT_SHARE", 0)
    logs = RunLogs(tmp_path)
    world = a_world(a_busy_day(kind, 6, 3), logs=logs, faults=faults, checkpoint_bytes=10_000)
    world.run(600.0)
    logs.close()
    assert nobody_touches(world)
    found = 0
    for path in logs.paths:
        log = read_log(path)
        assert check_log(log).difference == ""
        at = [k for k, one in enumerate(log.records) if is_checkpoint_key(one.key)]
        for k, end in pairwise([*at, None]):
            found += 1
            mission = mission_at_end(replace(log, records=log.records[k:end], complete=False))
            if end is not None:
                assert checkpoint_of(mission) == log.records[end].payload
    assert found > 8


def cut_under_way(world, logs):
    """The log of a coordinator that was killed when several robots were under way."""
    while sum(one.state == UNDER_WAY for one in world.fleet.orders.tasks.values()) < 4:
        world.step()
    world.go_on(2.0)
    return log_from_bytes(logs.cut(), "run.mcap")


@pytest.fixture
def killed(tmp_path):
    logs = RunLogs(tmp_path)
    return cut_under_way(a_world(a_busy_day("warehouse", 6, 3), logs=logs), logs)


def test_arrivals_count_from_the_first_go_after_a_checkpoint_that_follows_it(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(mission_driver, "_CHECKPOINT_SHARE", 0)
    logs = RunLogs(tmp_path)
    world = a_world(a_busy_day("warehouse", 6, 3), logs=logs, checkpoint_bytes=10_000)
    log = cut_under_way(world, logs)
    go_ns = first_go([log], 0)
    assert [one for one in log.records if is_checkpoint_key(one.key)][-1].log_ns > go_ns
    fleet = go_on(log, 77, log.records[-1].log_ns + 9 * SECOND).fleet
    fleet.members["R1"].done_ns = go_ns + 41 * SECOND
    coordinator = Coordinator(scenario_of(log), effort=0, speed=1.0, events=False)
    coordinator._summarise(fleet, False, {})
    assert "R1: arrived 41.0 s after the first GO" in capsys.readouterr().err


def test_nothing_is_planned_to_go_on(killed, monkeypatch):
    def plan(*_):
        raise AssertionError("something is planned")

    for name in ("coordinator.service.replay.plan_here", "coordinator.mission.searches.search"):
        monkeypatch.setattr(name, plan)
    fleet = go_on(killed, 77, killed.records[-1].log_ns + SECOND).fleet
    assert sum(mine.now.revision > 0 for mine in map(fleet.grants.of, fleet.members)) >= 1
    assert {one.state for one in fleet.orders.tasks.values()} >= {UNDER_WAY}


def test_what_is_in_force_has_to_be_proven_to_go_on(killed, monkeypatch):
    mission = mission_at_end(killed)
    assert in_force_failures(mission) == []
    _, staircases = mission.fleet.grants.in_force()
    assert len(staircases.behind)
    mission.fleet.grants._staircases = CourseStaircases(replace_tau(NO_STAIRCASES, staircases))
    assert any("which its staircase does not say" in one for one in in_force_failures(mission))
    monkeypatch.setattr("coordinator.service.replay.mission_at_end", lambda _log: mission)
    with pytest.raises(InputError, match=r"cannot be resumed: R. at .* is too near R"):
        go_on(killed, 77, killed.records[-1].log_ns + SECOND)


def replace_tau(empty, staircases):
    return dataclasses.replace(empty, tau_ms=staircases.tau_ms)


def test_a_checkpoint_of_another_version_or_without_its_plan_is_refused(killed):
    mission = mission_at_end(killed)
    point, scenario = checkpoint_of(mission), scenario_of(killed)
    plans = dict(mission.documents)
    assert checkpoint_of(mission_of(point, scenario, plans, None)) == point
    for bytes_, known, said in (
        (point[:-9], plans, "cannot be read"),
        (point.replace(b"\xa7version\x01", b"\xa7version\x63"), plans, "its version is 99"),
        (point, {}, "the log lacks 1"),
    ):
        with pytest.raises(InputError, match=said):
            mission_of(bytes_, scenario, known, None)


def test_every_attribute_of_a_fleet_is_in_its_checkpoint_or_known_not_to_matter(killed):
    """Whoever adds one to the core decides whether a coordinator that goes on has to know it."""
    fleet = mission_at_end(killed).fleet
    elsewhere = {"name", "boot", "members", "times", "grants", "orders", "_router", "blocks"}
    elsewhere |= {"outside_ns", "words"}
    news = {"incidents", "given_up_news", "_door", "_told_orders"}
    assert vars(fleet).keys() == {*fleet.plain().numbers, *elsewhere, *news}
