"""Fleets that live long: coordinators that take over, computers that start anew, old plan times."""

import pytest

from coordinator.findings.info import summarise
from coordinator.findings.log_proof import prove_log
from coordinator.fleet.phases import LONGEST_EPOCH
from coordinator.log.log_file import logs_before, read_log
from coordinator.service.replay import check_log
from protocol.messages import ORDER_DONE, WAITING
from protocol.messages import Order as Said
from protocol.phases import BRAKING, GO
from protocol.timing import SECOND
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import World
from tests.scenarios import a_scenario
from tests.sim.world.test_orders_in_time import (
    PERIOD_NS,
    USUAL_FLAWS,
    a_world,
    idle,
    nobody_touches,
    operator,
    plan_scenario,
    states,
)


def resumed(world, after_s=2.0):
    """Let a coordinator that has died be started again with --resume."""
    world.agenda.once(world.now_ns + round(after_s * SECOND), world.coordinator.come_back)
    world.run(after_s + 0.5)


@pytest.mark.parametrize("seed", range(3))
def test_a_coordinator_whose_log_lacks_a_course_stops_leading_and_the_log_says_why(tmp_path, seed):
    logs = RunLogs(tmp_path)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (8.0, 1.0)), idle("R3", (4.5, 7.0))]
    world = a_world(a_scenario(robots), stays=True, logs=logs, seed=seed)
    say = operator(world)
    world.run(6.0)
    logs._writer.flush()
    cut = logs.paths[-1].read_bytes()
    say(Said(9, "o1", (8.0, 6.0), "R1"))
    world.run(2.5)
    world.coordinator.die()
    world.coordinator._before = cut
    logs.paths[-1].write_bytes(cut)
    resumed(world)
    say(Said(9, "o2", (1.0, 6.0), "R2"))
    say(Said(9, "o3", (2.0 + 2.0 * seed, 2.0), "R3"))
    world.run(40.0)
    logs.close()
    assert world.fleet.superseded
    assert nobody_touches(world)
    proof = prove_log(read_log(logs.paths[-1]), before=logs_before(read_log(logs.paths[-1])))
    assert not proof.holds
    failures = [one for epoch in proof.epochs for one in epoch.failures]
    assert "R1 drives course 1, which the log does not hold" in failures


def test_an_id_that_was_used_before_a_checkpoint_is_another_order_after_it_and_in_the_log(tmp_path):
    logs = RunLogs(tmp_path)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0))]
    world = a_world(a_scenario(robots), stays=True, logs=logs)
    say = operator(world)
    world.run(3.0)
    say(Said(9, "a", (8.0, 1.0), "R1"))
    world.run(20.0)
    world.coordinator.driver.checkpoint(world.now_ns)
    say(Said(9, "a", (1.0, 1.0), "R1"))
    world.run(1.0)
    say(Said(9, "b", (8.0, 6.0), "R2"))
    world.run(4.0)
    world.coordinator.die()
    resumed(world)
    world.run(20.0)
    logs.close()
    assert states(world) == {"a": ORDER_DONE, "b": ORDER_DONE}
    assert check_log(read_log(logs.paths[-1])).difference == ""


def test_a_fleet_takes_orders_and_misses_the_dead_though_the_computers_clock_begins_anew(tmp_path):
    logs = RunLogs(tmp_path)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0)), idle("R3", (4.5, 7.2))]
    world = a_world(a_scenario(robots), stays=True, logs=logs)
    up_ns = [100_000 * SECOND]
    world.coordinator._clock = lambda: world.agenda.now_ns + up_ns[0]
    say = operator(world)
    world.run(6.0)
    world.coordinator.die()
    world.strike(Fault("kill", "R2", 0.0))
    up_ns[0] = 0
    resumed(world)
    say(Said(9, "a", (8.0, 1.0), "R1"))
    say(Said(9, "b", (8.0, 6.0), "R2"))
    world.run(30.0)
    logs.close()
    assert states(world) == {"a": ORDER_DONE, "b": WAITING}
    assert world.fleet.orders.tasks["b"].reason == "R2 is lost"
    assert nobody_touches(world)
    assert check_log(read_log(logs.paths[-1])).difference == ""


def test_after_ten_days_a_fleet_is_planned_anew_and_goes_on_with_its_orders(tmp_path):
    logs = RunLogs(tmp_path)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0))]
    world = a_world(a_scenario(robots), stays=True, logs=logs)
    say = operator(world)
    world.run(3.0)
    world.fleet.times.start_ns -= LONGEST_EPOCH - 5 * SECOND
    world.coordinator.driver.checkpoint(world.now_ns)
    say(Said(9, "a", (8.0, 1.0), "R1"))
    world.run(30.0)
    say(Said(9, "b", (8.0, 6.0), "R2"))
    world.run(20.0)
    logs.close()
    assert (world.fleet.epoch, world.fleet.phase) == (2, GO)
    assert states(world) == {"a": ORDER_DONE, "b": ORDER_DONE}
    assert world.fleet.times.plan_ms(world.now_ns) < 60_000


def test_a_report_that_comes_after_a_newer_one_says_nothing_in_the_proof_of_a_log(tmp_path):
    robots = a_scenario([idle("R1", (1.0, 3.0)), idle("R2", (4.5, 1.0))])
    fleet = []

    def delay_ns(key, _now):
        brakes = fleet and fleet[0].robots["R1"].service.agent.phase == BRAKING
        return SECOND // 3 if brakes and key.endswith("report/R1") else 0

    network = MemoryNetwork(1, fate=delay_ns)
    document, logs = plan_scenario(robots, effort=0), RunLogs(tmp_path)
    options = {"flaws": USUAL_FLAWS, "period_ns": PERIOD_NS, "logs": logs, "stays": True}
    world = World(robots, document, network, seed=1, **options)
    fleet.append(world)
    say = operator(world)
    world.run(5.0)
    say(Said(9, "a", (8.5, 3.0), "R1"))
    world.run(5.0)
    world.strike(Fault("skid", "R1", 0.0, 0.1))
    for _ in range(100):
        world.run(0.02)
        if world.fleet.members["R1"].rest is not None:
            break
    world.strike(Fault("kill", "R1", 0.0))
    world.run(8.0)
    say(Said(9, "b", (4.5, 6.0), "R2"))
    world.run(30.0)
    logs.close()
    assert states(world)["b"] == ORDER_DONE
    assert nobody_touches(world)
    assert prove_log(read_log(logs.paths[-1])).holds


def test_the_log_of_a_coordinator_that_took_over_tells_who_died_meanwhile(tmp_path):
    logs = RunLogs(tmp_path)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0))]
    world = a_world(a_scenario(robots), stays=True, logs=logs)
    say = operator(world)
    world.run(3.0)
    say(Said(9, "a", (8.0, 1.0), "R1"))
    world.run(3.0)
    world.coordinator.die()
    world.strike(Fault("kill", "R1", 0.0))
    resumed(world)
    world.run(20.0)
    logs.close()
    log = read_log(logs.paths[-1])
    told = summarise(log, before=logs_before(log))
    assert [(one["robot"], one["fault"]) for one in told["faults"]] == [("R1", "fell silent")]
    assert told["robots"]["R1"]["fault"] == "fell silent"
    assert told["robots"]["R1"]["nearest"]["robot"] == "R2"
