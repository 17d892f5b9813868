"""The judge on robots that join a fleet while it drives, and on those that leave it."""

import json

import numpy as np
import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from coordinator.cli.log_commands import commands as exports
from coordinator.findings.info import courses_of, summarise
from coordinator.findings.plans_from_messages import in_force
from coordinator.log.log_file import read_log, readable_logs_before
from coordinator.plan.plan_file import from_json, to_json
from coordinator.planning.planner import plan_scenario
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import GO_ON, HALT, Command, Join, Leave, Order, Tell
from protocol.phases import GO
from sim.cli.run_commands import commands
from sim.judging.blackbox import blackbox_text
from sim.judging.judge import NO_BOX, judge
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import World
from tests.scenarios import a_robot, a_scenario
from tests.sim.world.test_orders_in_time import PERIOD_NS

LEFT_S = 40.0


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """R9 joins at 5 s, after a stop of 2 s, drives, and leaves at LEFT_S; R8 is refused."""
    folder = tmp_path_factory.mktemp("joined")
    robots = [a_robot("R1", (1.0, 3.0), (1.0, 3.0)), a_robot("R2", (6.0, 1.0), (6.0, 1.0))]
    scenario = a_scenario(robots, (12.0, 6.0))
    document = plan_scenario(scenario, effort=0)
    logs = RunLogs(folder)
    world = World(scenario, document, MemoryNetwork(1), period_ns=PERIOD_NS, logs=logs, stays=True)
    session = world._network.session("operator")

    def say(key, message):
        session.put(key(world.fleet.name), encode(message))

    def until(t):
        world.run(world.began_ns / 1e9 + t - world.now_ns / 1e9)

    world.run(1.0)
    until(2.0)
    say(keys.tell, Tell(9, HALT))
    until(4.0)
    say(keys.tell, Tell(9, GO_ON))
    until(5.0)
    say(keys.roster, Join(9, "R9", (10.0, 3.0, 1.0), 0.25, 0.8))
    say(keys.roster, Join(9, "R8", (1.2, 3.0, 0.0), 0.25, 0.8))
    world.add("R9", 0.25, 0.8, 77)
    until(8.0)
    say(keys.order, Order(9, "over", (1.5, 5.0), robot="R9"))
    say(keys.order, Order(9, "other", (10.0, 3.0), robot="R1"))
    until(LEFT_S)
    say(keys.roster, Leave(9, "R9"))
    until(50.0)
    logs.close()
    (folder / "plan.json").write_bytes(to_json(document))
    (folder / "blackbox").mkdir()
    for name, robot in world.robots.items():
        (folder / "blackbox" / f"{name}.csv").write_bytes(blackbox_text(robot.written_rows()))
    return folder


def rows_of(folder, robot):
    lines = (folder / "blackbox" / f"{robot}.csv").read_text().splitlines()
    return [line.split(",") for line in lines]


def write_rows(folder, robot, rows):
    text = "".join(",".join(row) + "\n" for row in rows)
    (folder / "blackbox" / f"{robot}.csv").write_text(text)


@pytest.fixture
def copy(run, tmp_path):
    (tmp_path / "blackbox").mkdir()
    for path in run.glob("**/*.*"):
        if path.is_file():
            (tmp_path / path.relative_to(run)).write_bytes(path.read_bytes())
    return tmp_path


def test_a_robot_that_joined_is_judged_while_it_is_in_the_fleet(run):
    verdict = judge(run)
    assert [one.id for one in verdict.robots] == ["R1", "R2", "R9"]
    assert (verdict.collisions, verdict.collisions_with_obstacles) == (0, 0)
    joined = verdict.robots[2]
    assert joined.arrived
    assert joined.joined == pytest.approx(5.1, abs=0.3)
    assert joined.left == pytest.approx(LEFT_S, abs=0.3)
    assert joined.t > 15.0
    assert joined.tracking_error < 0.025
    assert joined.fault == ""
    assert verdict.is_good()
    times = np.arange(joined.joined, joined.left, 0.005)
    tracks = [np.array(rows_of(run, name)[1:])[:, :3].astype(float) for name in ("R1", "R9")]
    (x1, y1), (x9, y9) = ([np.interp(times, o[:, 0], o[:, k]) for k in (1, 2)] for o in tracks)
    near = next(one for one in verdict.pairs if (one.a, one.b) == ("R1", "R9"))
    assert near.separation == pytest.approx(np.hypot(x1 - x9, y1 - y9).min(), abs=2e-3)


@pytest.mark.parametrize(("at", "touches"), [(LEFT_S - 1.0, 1), (LEFT_S + 1.0, 0), (4.0, 0)])
def test_a_robot_touches_nobody_before_it_joins_or_after_it_left(copy, at, touches):
    head, *rows = rows_of(copy, "R9")
    x, y = next(row[1:3] for row in reversed(rows_of(copy, "R2")))
    before = [row for row in rows if float(row[0]) < at - 0.1]
    after = [row for row in rows if float(row[0]) > at + 0.1]
    times = (at - 0.05, at, at + 0.05)
    places = [before[-1:] or rows[:1], [["", x, y, *rows[0][3:6]]], after[:1] or rows[-1:]]
    put = [[f"{t}", *one[1:6], f"{t}"] for t, (one,) in zip(times, places, strict=True)]
    write_rows(copy, "R9", [head, *before, *put, *after])
    assert judge(copy).collisions == touches


def test_without_its_black_box_a_robot_that_joined_is_not_judged_good(copy):
    (copy / "blackbox/R9.csv").unlink()
    verdict = judge(copy)
    assert [one.id for one in verdict.robots if one.fault == NO_BOX] == ["R9"]
    assert verdict.robots[2].left == pytest.approx(LEFT_S, abs=0.3)
    assert not verdict.is_good()
    assert [(one.a, one.b) for one in verdict.pairs] == [("R1", "R2")]
    answer = CliRunner().invoke(commands, ["judge", str(copy), "--json"])
    assert answer.exit_code == 1
    assert json.loads(answer.stdout)["robots"][2]["fault"] == NO_BOX


def test_a_box_that_counts_from_when_the_fleet_went_on_is_put_in_its_place(copy, run):
    first_ns, *_, second_ns = sorted(starts_in(copy))
    head, *rows = rows_of(copy, "R9")
    later = (second_ns - first_ns) / 1e9
    moved = [[f"{float(row[0]) - later:.6f}", *row[1:6], ""] for row in rows]
    write_rows(copy, "R9", [head, *moved])
    (copy / "blackbox/R9.csv.start").write_text(f"7 {second_ns}\n")
    found, wanted = judge(copy), judge(run)
    assert [one.separation for one in found.pairs] == pytest.approx(
        [one.separation for one in wanted.pairs], abs=1e-4
    )
    assert found.robots[2].tracking_error == pytest.approx(
        wanted.robots[2].tracking_error, abs=1e-3
    )
    log = read_log(copy / "run.mcap")
    told = summarise(log, courses_of(log, [copy / "blackbox"]))
    true = summarise(log, courses_of(log, [run / "blackbox"]))
    assert told["robots"]["R9"]["true_arrival"] == pytest.approx(
        true["robots"]["R9"]["true_arrival"], abs=1e-3
    )


def starts_in(folder):
    """Return the time zeros [ns] that the log's Commands state."""
    said = [
        decode("command", record.payload)
        for record in read_log(folder / "run.mcap").records
        if record.key.endswith("/command")
    ]
    return {one.start_ns for one in said if isinstance(one, Command) and one.phase == GO}


def test_what_a_log_is_exported_to_has_the_robots_that_joined(run, tmp_path):
    log = run / "run.mcap"
    answer = {}
    for to, name in (("csv", "o.csv"), ("foxglove", "o.mcap"), ("vda5050", "orders")):
        done = CliRunner().invoke(exports, ["export", str(log), "--to", to, "-o", tmp_path / name])
        assert done.exit_code == 0, done.output
        answer[to] = done
    rows = [line.split(",") for line in (tmp_path / "o.csv").read_text().splitlines()[1:]]
    joined = [row for row in rows if row[0] == "R9"]
    assert [float(joined[0][k]) for k in (2, 3)] == pytest.approx([10.0, 3.0], abs=1e-3)
    assert [float(joined[-1][k]) for k in (2, 3)] == pytest.approx([1.5, 5.0], abs=1e-3)
    assert b"points/robots/R9" in (tmp_path / "o.mcap").read_bytes()
    assert {path.stem for path in (tmp_path / "orders").iterdir()} == {"R1", "R2"}  # R9 has left.


def test_the_newest_courses_of_a_log_are_those_of_the_robots_that_are_there(run):
    document = from_json((run / "plan.json").read_bytes(), "plan.json")
    log = read_log(run / "run.mcap")
    left = next(k for k, one in enumerate(log.records) if one.key.endswith("/leave-R9"))
    before = replace(log, records=log.records[:left])
    robots = {one.id: one for one in in_force(document, document, [before]).robots}
    assert set(robots) == {"R1", "R2", "R9"}
    assert robots["R9"].path.control_points[-1] == pytest.approx((1.5, 5.0))
    assert robots["R9"].radius == 0.25
    assert robots["R2"] == document.robot("R2")
    after = in_force(document, document, [log])
    assert {one.id for one in after.robots} == {"R1", "R2"}
    assert after.proof is None
    assert in_force(document, document, []) == document


def test_nobody_is_near_a_robot_that_has_left(copy):
    head, *rows = rows_of(copy, "R9")
    x, y = rows_of(copy, "R2")[-1][1:3]
    rows = [row for row in rows if float(row[0]) < 44.0]
    put = [["44.0", *rows[-1][1:6], "44.0"], ["45.0", x, y, *rows[-1][3:6], "45.0"]]
    write_rows(copy, "R9", [head, *rows, *put])
    log = read_log(copy / "run.mcap")
    told = summarise(log, courses_of(log, [copy / "blackbox"]))["robots"]
    assert told["R9"]["nearest"]["distance"] > 0.5
    assert told["R9"]["nearest"]["t"] < LEFT_S + 0.3


def test_info_of_a_resumed_log_agrees_with_the_judge(tmp_path):
    """R9 joins and drives, the coordinator is started again, the fleet stops for a while, R9 drives
    on and leaves.
    """
    robots = [a_robot("R1", (1.0, 3.0), (1.0, 3.0)), a_robot("R2", (6.0, 1.0), (6.0, 1.0))]
    scenario = a_scenario(robots, (12.0, 6.0))
    document, logs = plan_scenario(scenario, effort=0), RunLogs(tmp_path)
    world = World(scenario, document, MemoryNetwork(1), period_ns=PERIOD_NS, logs=logs, stays=True)
    session = world._network.session("operator")

    def say(key, message, seconds):
        session.put(key(world.fleet.name), encode(message))
        world.run(seconds)

    world.run(2.0)
    say(keys.order, Order(9, "first", (1.0, 5.0), robot="R1"), 1.0)
    world.add("R9", 0.25, 0.8, 77)
    say(keys.roster, Join(9, "R9", (10.0, 3.0, 1.0), 0.25, 0.8), 3.0)
    say(keys.order, Order(9, "over", (3.0, 3.0), robot="R9"), 20.0)
    world.strike(Fault("coordinator-restart", "", 0.0, 1.0))
    world.run(4.0)
    say(keys.tell, Tell(9, HALT), 8.0)
    say(keys.tell, Tell(9, GO_ON), 1.0)
    say(keys.order, Order(9, "on", (10.0, 5.0), robot="R9"), 20.0)
    say(keys.roster, Leave(9, "R9"), 3.0)
    logs.close()
    boxes = tmp_path / "blackbox"
    boxes.mkdir()
    for name, robot in world.robots.items():
        (boxes / f"{name}.csv").write_bytes(blackbox_text(robot.written_rows()))
    assert len(logs.paths) == 2
    log, verdict = read_log(logs.paths[-1]), judge(logs.paths[-1])
    before = readable_logs_before(log)
    told = summarise(log, courses_of(log, [boxes], before), before)
    for one in verdict.robots:
        robot = told["robots"][one.id]
        apart = [p.separation for p in verdict.pairs if one.id in (p.a, p.b)]
        assert robot["nearest"]["distance"] == pytest.approx(min(apart), abs=1e-3)
        assert robot["tracking_error"] == pytest.approx(one.tracking_error, abs=2e-3)
        assert robot["true_arrival"] == pytest.approx(one.t, abs=1e-3)
        assert abs(robot["late"]) < 0.5
        assert one.lateness < 0.5
