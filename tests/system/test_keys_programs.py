"""Programs behind locks: what they write, who runs together, and what is told of wrong options."""

import contextlib
import json
import os

import pytest

from coordinator.log.log_file import read_log
from coordinator.security.denials import denial_of, is_denial_key
from protocol import keys
from protocol.codec import decode
from protocol.phases import GO
from protocol.timing import SECOND
from protocol.zenoh_transport import ZenohTransport
from tests.protocol.links import Inbox
from tests.system.fleet_tools import splinefleet, started, wait_for
from tests.system.locked_fleet import (
    FLEET,
    Events,
    Keys,
    coordinator,
    locked_endpoint,
    no_link,
    scenario_in,
)


@pytest.fixture(scope="module")
def gate(tmp_path_factory):
    with coordinator(tmp_path_factory.mktemp("locked")) as running:
        yield running


def test_every_refusal_is_in_the_log_of_the_coordinator(tmp_path):
    with coordinator(tmp_path) as gate:
        with gate.connect_with(gate.keys.revoked):
            gate.events.denial("revoked")
        no_link(gate, gate.keys.expired, "expired")
        gate.events.denial("expired")
        told = gate.events.denials()
    log = read_log(gate.log)
    assert log.complete
    written = [denial_of(record.payload) for record in log.records if is_denial_key(record.key)]
    assert [denial.text for denial in written[: len(told)]] == told
    info = splinefleet("info", gate.log, "--json")
    faults = json.loads(info.stdout)["faults"]
    assert {fault["kind"] for fault in faults} == {"denied"}
    assert "revoked" in faults[0]["fault"]


def test_a_robot_with_keys_is_heard_again_after_its_network_was_cut_and_nobody_is_refused(tmp_path):
    made, folder = Keys(tmp_path), tmp_path / "out"
    options = ["--out", folder, "--keys", made.folder, "--fault", "cut:R2@1.5:0.3", "--json"]
    done = splinefleet("run", scenario_in(tmp_path), *options, timeout=120.0)
    assert json.loads(done.stdout)["judge"]["collisions"] == 0, done.stderr
    assert "heal" in done.stderr
    records = read_log(folder / "run.mcap").records
    assert not [record for record in records if is_denial_key(record.key)]
    gone = [one for one in records if one.key == keys.command(FLEET)]
    start_ns = next(m.start_ns for one in gone if (m := decode("command", one.payload)).phase == GO)
    last_ns = max(one.log_ns for one in records if one.key == keys.report(FLEET, "R2"))
    assert last_ns - start_ns > 2 * SECOND
    assert splinefleet("replay", folder / "run.mcap", "--check").returncode == 0


def test_robots_with_their_own_folders_a_recorder_and_no_authority_make_a_fleet(tmp_path):
    made, endpoint, log = Keys(tmp_path), locked_endpoint(), tmp_path / "beside.mcap"
    (made.folder / "authority/private.pem").unlink()
    arguments = ["coordinator", scenario_in(tmp_path), "--keys", made.folder, "--listen", endpoint]
    with contextlib.ExitStack() as stack:
        run = stack.enter_context(started(*arguments, "--json"))
        Events(run).wait(lambda event: event["event"] == "listening")
        options = ["--connect", endpoint, "--keys", made.folder / "observer/other", "-o", log]
        recorder = stack.enter_context(started("record", *options))
        wait_for(lambda: "recording" in recorder.stderr.readline())
        robots = [
            stack.enter_context(
                started(
                    "agent", name, "--connect", endpoint, "--keys", made.folder / "robot" / name
                )
            )
            for name in ("R1", "R2")
        ]
        assert run.wait(60.0) == 0
        assert [robot.wait(20.0) for robot in robots] == [0, 0]
        assert recorder.wait(20.0) == 0
    kinds = {keys.split(record.key)[1] for record in read_log(log).records}
    assert kinds == {"hello", "plan", "report", "clock", "command", "alive"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--listen", "tcp/0.0.0.0:7447"], "--insecure"),
        (["--listen", "tcp/hall.local:7447"], "--insecure"),
        (["--listen", "tls/127.0.0.1:7447"], "needs --keys"),
        (["--keys", "nowhere"], "nowhere"),
        (["--keys", "{keys}", "--listen", "tcp/127.0.0.1:7447"], "tls/HOST:PORT"),
        (["--keys", "{keys}/robot/R1"], "register.json"),
    ],
)
def test_a_coordinator_that_may_not_listen_says_so_in_one_line(gate, tmp_path, arguments, said):
    given = [argument.format(keys=gate.keys.folder) for argument in arguments]
    done = splinefleet("coordinator", scenario_in(tmp_path), *given)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert said in done.stderr


def test_a_coordinator_listens_to_the_network_without_keys_when_it_is_told_to(tmp_path):
    endpoint = locked_endpoint().replace("tls/127.0.0.1", "tcp/0.0.0.0")
    arguments = ["coordinator", scenario_in(tmp_path), "--listen", endpoint, "--insecure", "--json"]
    with started(*arguments) as process:
        Events(process).wait(lambda event: event["event"] == "listening")


def test_a_player_with_keys_is_heard_by_observers_alone(gate, tmp_path):
    endpoint, log = locked_endpoint(), tmp_path / "run.mcap"
    with coordinator(tmp_path) as other, other.connect("observer") as observer:
        heard = Inbox()
        observer.subscribe(keys.command(FLEET), heard)
        wait_for(lambda: len(heard.heard) > 2)
    os.replace(other.log, log.with_name("played.mcap"))
    options = ["--listen", endpoint, "--key-folder", gate.keys.folder, "--wait-listener", 20]
    with started("replay", log.with_name("played.mcap"), *options) as player:
        wait_for(lambda: "waiting" in player.stderr.readline())
        robot_files, observer_files = gate.keys.of("robot", "R1"), gate.keys.of("observer", "")
        with ZenohTransport.connect(endpoint, keys=robot_files) as robot:
            given, heard = Inbox(), Inbox()
            robot.subscribe(keys.command(FLEET), given)
            with ZenohTransport.connect(endpoint, keys=observer_files) as observer:
                observer.subscribe("**", heard)
                wait_for(lambda: heard.heard)
                assert player.wait(20.0) == 0
            assert given.heard == []
