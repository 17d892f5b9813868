"""Other ways around for robots that wait long."""

import pytest

from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from sim.floors.generator import generate
from tests.oracle_dense import closest
from tests.oracles import tracks


def late(document):
    return sum(robot.finish_time for robot in document.robots)


def test_a_robot_goes_around_where_that_is_quicker_than_waiting():
    scenario = generate("grid", 8, 3)
    waiting, going = plan_scenario(scenario, effort=4), plan_scenario(scenario, effort=20)
    said = [note for note in going.notes if "goes around" in note]
    assert said
    assert not any("goes around" in note for note in waiting.notes)
    assert late(going) < late(waiting) - len(said)
    worst = closest(tracks(to_json(going)), going.tau, going.margin)
    assert worst.slack > -1e-3


@pytest.mark.parametrize(
    ("kind", "count", "seed", "said"),
    [
        ("warehouse", 8, 8, "goes around"),
        ("open", 12, 3, "leave their shortest ways"),
        ("grid", 15, 2, "leave their shortest ways"),
    ],
)
def test_every_wait_has_its_reason_after_others_have_gone_around(kind, count, seed, said):
    document = plan_scenario(generate(kind, count, seed))
    assert any(said in note for note in document.notes)
    explained = {(reason.robot, round(reason.s, 3)) for reason in document.waits}
    for robot in document.robots:
        for stop in robot.stops:
            if stop.depart > stop.arrive + 0.01:
                assert (robot.id, round(stop.s, 3)) in explained
        if robot.start_time > 0.01:
            assert (robot.id, 0.0) in explained
