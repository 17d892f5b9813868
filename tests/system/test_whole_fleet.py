"""Whole fleets of real processes over real Zenoh."""

import contextlib
import json
import math
import os
import signal
import threading
from pathlib import Path

import msgspec
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader

from coordinator.log.log_file import read_log
from coordinator.plan.document import Limits
from coordinator.plan.shares_of_tau import shares_of
from coordinator.scenario.model import Link
from protocol.codec import decode
from protocol.messages import Command, Plan, Report
from protocol.phases import FREEZE
from protocol.timing import CLOCK_ERROR, SECOND
from sim.judging.blackbox import read_blackbox
from tests.system.fleet_tools import (
    ROOT,
    TWO_ROBOTS,
    processes_of,
    splinefleet,
    started,
    wait_for,
)


@pytest.fixture(scope="module")
def five(tmp_path_factory):
    """The main job: paper_five with its folder and summary."""
    folder = tmp_path_factory.mktemp("five")
    done = splinefleet(
        "run", ROOT / "examples/paper_five.toml", "--out", folder, "--json", timeout=120.0,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO_ROBOTS)
    return path


def headroom(plan):
    """How far [s] ahead of the plan's time robots are let."""
    limits = [Limits(**robot["limits"]) for robot in plan["robots"]]
    return shares_of(limits, Link()).headroom


def test_five_robots_arrive_and_nobody_touches(five):
    _, summary = five
    assert summary["judge"]["collisions"] == 0
    assert [robot["arrived"] for robot in summary["judge"]["robots"]] == [True] * 5


def test_the_judge_finds_every_pair_apart_and_the_plan_kept(five):
    folder, _ = five
    plan = json.loads((folder / "plan.json").read_text())
    radius = {robot["id"]: robot["radius"] for robot in plan["robots"]}
    done = splinefleet("judge", folder, "--json")
    assert done.returncode == 0, done.stderr
    verdict = json.loads(done.stdout)
    assert len(verdict["pairs"]) == 10
    for pair in verdict["pairs"]:
        assert pair["separation"] > radius[pair["a"]] + radius[pair["b"]]
    for robot in verdict["robots"]:
        assert robot["tracking_error"] < plan["margin"] / 2
        assert robot["lateness"] < 0.25
        assert robot["clock_error"] < CLOCK_ERROR / SECOND
    assert verdict["collisions_with_obstacles"] == 0
    assert 0.5 * plan["margin"] < verdict["least_clearance"] < 1.5 * plan["margin"]


def test_no_position_was_on_the_wire_and_the_robots_said_little(five):
    folder, _ = five
    info = json.loads(splinefleet("info", folder / "run.mcap", "--json").stdout)
    assert info["positions_on_wire"] == 0
    reports = [one for key, one in info["keys"].items() if "/report/" in key]
    assert len(reports) == 5
    assert max(one["bytes_per_second"] for one in reports) <= 90
    # Questions for the time come on top: the more, the busier the machine.
    assert info["robot_payload_bytes_per_second"] <= 110
    assert info["bad_messages"] == 0
    assert info["largest_message_to_robot_bytes"] <= 4000


def test_the_run_leaves_its_files(five):
    folder, _ = five
    for name in ("plan.json", "run.mcap", "summary.json", "plan.svg", "plan.png"):
        assert (folder / name).stat().st_size > 0
    assert len(list((folder / "blackbox").iterdir())) == 5
    assert processes_of(folder) == []


def test_the_log_can_be_run_again_byte_for_byte(five):
    folder, _ = five
    done = splinefleet("replay", folder / "run.mcap", "--check", "--json")
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["plans"] >= 5
    assert answer["commands"] > 50


@pytest.mark.parametrize("share", [0.02, 0.35, 0.6, 0.999])
def test_a_changed_byte_in_the_log_is_found_and_placed(five, tmp_path, share):
    content = bytearray((five[0] / "run.mcap").read_bytes())
    content[int(share * len(content))] ^= 0x40
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(content)
    done = splinefleet("replay", damaged, "--check")
    assert done.returncode == 1
    assert "byte" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_stock_reader_reads_the_log_with_its_checks_on(five):
    with (five[0] / "run.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        kinds = {schema.name for schema, _, _ in reader.iter_messages() if schema is not None}
        boxes = {f"blackbox/R{number}.csv.gz" for number in range(1, 6)}
        attached = {a.name for a in reader.iter_attachments()}
        assert attached == {"scenario.json", "plan-1.json", *boxes}
    assert kinds >= {f"splinefleet.{name}" for name in ("Hello", "Command", "Report", "Clock")}


def test_the_one_behind_a_killed_robot_is_sent_around_it_and_says_nowhere_where_it_is(
    tmp_path, scenario
):
    folder = tmp_path / "out"
    done = splinefleet("run", scenario, "--out", folder, "--fault", "kill:R1@2", "--json")
    assert done.returncode == 1, done.stderr
    assert "R1 has lost its link" in done.stderr
    assert "R1 is not heard. By its course it stands, or will stop, between" in done.stderr
    records = read_log(folder / "run.mcap").records
    messages = [decode(record.key.split("/")[2], record.payload) for record in records]
    assert not any(isinstance(m, Command) and m.phase == FREEZE for m in messages)
    assert not any(isinstance(m, Report) and m.rest is not None for m in messages)
    courses = {m.revision for m in messages if isinstance(m, Plan) and m.robot == "R2"}
    assert courses == {0, 1}
    verdict = json.loads(done.stdout)["judge"]
    assert verdict["collisions"] == 0
    assert "frozen" not in read_blackbox(folder / "blackbox" / "R2.csv").phases
    assert [robot["id"] for robot in verdict["robots"] if robot["arrived"]] == ["R2"]


def test_a_killed_coordinator_leaves_robots_that_stop_by_themselves(tmp_path, scenario):
    folder = tmp_path / "out"
    done = splinefleet("run", scenario, "--out", folder, "--fault", "coordinator-kill@2", "--json")
    assert done.returncode == 1, done.stderr
    topics = []
    with (folder / "run.mcap").open("rb") as stream, contextlib.suppress(EndOfFile):
        for _, channel, _ in NonSeekingReader(stream).iter_messages(log_time_order=False):
            topics.append(channel.topic)
    assert topics.count("splinefleet/two/command") > 20
    log = read_log(folder / "run.mcap")
    assert not log.complete
    last = max(r.log_ns for r in log.records if r.key.endswith("command"))
    starts = [
        m.start_ns
        for r in log.records
        if r.key.endswith("command") and isinstance(m := decode("command", r.payload), Command)
    ]
    heard = (last - max(starts)) / SECOND
    plan = json.loads((folder / "plan.json").read_text())
    for robot in plan["robots"]:
        box = read_blackbox(folder / "blackbox" / f"{robot['id']}.csv")
        moving = box.t[:-1][abs(box.s[1:] - box.s[:-1]) > 1e-6]
        braking = 0.5 * robot["limits"]["max_speed"] / robot["limits"]["max_accel"]
        assert moving[-1] <= heard + headroom(plan) + braking + 0.3
        assert box.phases[-1] == "moving"
        assert box.s[-1] < robot["length"]


def test_a_coordinator_that_stalls_for_less_than_the_headroom_stops_nobody(tmp_path, scenario):
    folder = tmp_path / "out"
    with started("run", scenario, "--out", folder, "--json") as run:
        box = folder / "blackbox" / "R1.csv"
        wait_for(lambda: box.exists() and len(box.read_text().splitlines()) > 150)
        (coordinator,) = [
            process
            for process in processes_of(folder)
            if b"\0coordinator\0" in Path(f"/proc/{process}/cmdline").read_bytes()
        ]
        os.kill(coordinator, signal.SIGSTOP)
        threading.Event().wait(0.45)
        os.kill(coordinator, signal.SIGCONT)
        output, errors = run.communicate(timeout=30.0)
    assert run.returncode == 0, errors
    assert json.loads(output)["succeeded"]


def test_ctrl_c_leaves_no_process_and_no_broken_log(tmp_path, scenario):
    folder = tmp_path / "out"
    with started("run", scenario, "--out", folder) as run:
        box = folder / "blackbox" / "R1.csv"
        wait_for(lambda: box.exists() and len(box.read_text().splitlines()) > 50)
        os.killpg(run.pid, signal.SIGINT)
        assert run.wait(20.0) == 130
    assert processes_of(folder) == []
    log = read_log(folder / "run.mcap")
    assert log.complete
    assert log.damage == ""


def test_plan_messages_hold_what_the_plan_file_says(five):
    folder, _ = five
    plan = json.loads((folder / "plan.json").read_text())
    sent = {}
    for record in read_log(folder / "run.mcap").records:
        if "/plan/" in record.key:
            message = decode("plan", record.payload)
            assert isinstance(message, Plan)
            sent[message.robot] = len(record.payload)
    for robot in plan["robots"]:
        assert sent[robot["id"]] <= robot["wire_bytes"] <= 350
        assert math.isfinite(robot["finish_time"])
    assert msgspec.json.decode((folder / "summary.json").read_bytes())["succeeded"]
