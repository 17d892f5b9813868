"""Fleets behind the locks of a router: what `keys router` writes, against thieves and strangers."""

import contextlib
import json
import signal

import pytest
import zenoh

from coordinator.log.log_file import read_log
from coordinator.security.denials import is_denial_key
from coordinator.security.key_store import KeyStore
from protocol import keys
from protocol.codec import encode
from protocol.messages import PROTOCOL_VERSION, Admit, Command, Hello, Report
from protocol.phases import GO, IDLE
from protocol.transport import TransportError
from protocol.zenoh_transport import ZenohTransport
from sim.judging.judge import judge
from tests.system.fleet_tools import line_with, splinefleet, wait_for
from tests.system.locked_fleet import (
    FLEET,
    NOW,
    Events,
    no_link,
    session_without_key,
)
from tests.system.locked_hall import HELLO, YARD, LockedHall, served


@pytest.fixture
def hall(tmp_path):
    with contextlib.ExitStack() as stack:
        yield LockedHall(stack, tmp_path)


@pytest.fixture
def both(hall):
    """Both fleets' coordinators wait at the router for their robots."""
    hall.coordinator(hall.two)
    hall.coordinator(hall.yard)
    return hall


def test_a_fleet_arrives_through_a_locked_router_recorded_and_watched_beside(hall):
    log, beside = hall.folder / "run.mcap", hall.folder / "beside.mcap"
    box = hall.folder / "blackbox"
    box.mkdir()
    own = hall.keys.folder
    (own / "authority/private.pem").unlink()
    run = hall.start("coordinator", hall.two, "--keys", own, "--json", "--log", log)
    events = Events(run)
    events.wait(lambda event: event["event"] == "listening")
    recorder = hall.start("record", "--keys", own / "observer/other", "-o", beside)
    page = hall.start("view", "--no-open", "--keys", own / "observer/other")
    wait_for(beside.exists)
    robots = [
        hall.start(
            *("agent", name, "--keys", own / "robot" / name),
            *("--blackbox", box / f"{name}.csv", "--max-accel", 0.6),
        )
        for name in ("R1", "R2")
    ]
    assert "http://127.0.0.1" in line_with(page, "http")
    assert run.wait(60.0) == 0
    assert [robot.wait(20.0) for robot in robots] == [0, 0]
    assert recorder.wait(20.0) == 0
    assert judge(hall.folder).collisions == 0
    kinds = {keys.split(record.key)[1] for record in read_log(beside).records}
    assert kinds == {"hello", "plan", "report", "clock", "command", "alive"}
    assert splinefleet("replay", log, "--check").returncode == 0


def test_a_run_through_a_locked_router_bears_a_cut_network(hall):
    out = hall.folder / "run"
    options = ["--connect", hall.endpoint, "--keys", hall.keys.folder, "--out", out, "--json"]
    done = splinefleet("run", hall.two, *options, "--fault", "cut:R2@1.5:0.3", timeout=120.0)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["judge"]["collisions"] == 0


def test_an_operator_may_name_robots_of_the_fleet_alone(both):
    own = both.keys.folder / "operator/operator"
    options = ["--connect", both.endpoint, "--keys", own, "--fleet", YARD, "--wait", "1.5"]
    for robot in ("RX", "Y1"):
        done = splinefleet("admit", robot, *options)
        assert done.returncode == 1, done.stderr
        assert f"no course for {robot} within 1.5 s" in done.stderr.strip().splitlines()[-1]


def test_a_robot_can_not_pose_as_another_or_the_coordinator_and_reads_no_plan_but_its_own(both):
    thief, victim, observer = (
        both.connect("robot", "R1"),
        both.connect("robot", "R2"),
        both.connect("observer"),
    )
    alive = []
    heard = both.hears(observer, f"{keys.ROOT}/**")
    observer.watch_alive(keys.alive(FLEET, "*"), lambda key, _: alive.append(key))
    stolen = both.hears(
        thief, f"{keys.ROOT}/**", keys.plan(FLEET, "*"), keys.plan(FLEET, "R2"),
        keys.clock(FLEET, "R2"), keys.report(FLEET, "*"), keys.hello(FLEET, "*"),
    )  # fmt: skip
    forged = {
        keys.hello(FLEET, "R2"): encode(Hello(version=PROTOCOL_VERSION, boot=666)),
        keys.report(FLEET, "R2"): encode(Report(666, 1, 1, IDLE)),
        keys.command(FLEET): encode(Command(666, 9, 1, 1, GO, 0, 0)),
        keys.admit(FLEET, "R2"): encode(Admit(666)),
        keys.plan(FLEET, "R1"): b"forged",
        keys.plan(FLEET, "R2"): b"forged",
        keys.clock(FLEET, "R2"): b"forged",
    }
    for key, payload in forged.items():
        thief.put(key, payload)
    thief._session.delete(keys.plan(FLEET, "R2"))
    thief.declare_alive(keys.alive(FLEET, "R2"))
    thief.declare_alive(keys.alive(FLEET, "R1"))
    served(FLEET, "R2", victim)
    served(FLEET, "R1", thief)
    wait_for(lambda: keys.report(FLEET, "R1") in {key for key, _, _ in heard.heard})
    wait_for(lambda: keys.alive(FLEET, "R1") in alive)
    assert keys.alive(FLEET, "R2") not in alive
    assert {b"", *forged.values()}.isdisjoint(heard.payloads())
    assert {key for key, _, _ in stolen.heard} <= {keys.plan(FLEET, "R1"), keys.command(FLEET)}


def test_fleets_at_one_router_can_neither_hear_nor_speak_to_each_other(both):
    spy, native, observer = (
        both.connect("robot", "R1"),
        both.connect("robot", "Y1"),
        both.connect("observer"),
    )
    heard, alive = both.hears(observer, f"{keys.ROOT}/{YARD}/**"), []
    observer.watch_alive(keys.alive(YARD, "*"), lambda key, _: alive.append(key))
    kinds = (keys.hello, keys.plan, keys.report, keys.clock, keys.admit)
    theirs = [kind(YARD, name) for kind in kinds for name in ("R1", "Y1", "*")]
    stolen = both.hears(spy, f"{keys.ROOT}/{YARD}/**", keys.command(YARD), *theirs)
    commands = both.hears(spy, keys.command("*"))
    for key in (keys.command(YARD), *(key for key in theirs if "*" not in key)):
        spy.put(key, b"forged")
    spy.declare_alive(keys.alive(YARD, "R1"))
    spy.declare_alive(keys.alive(YARD, "Y1"))
    native.declare_alive(keys.alive(YARD, "Y1"))
    served(FLEET, "R1", spy)
    served(YARD, "Y1", native)
    wait_for(lambda: keys.report(YARD, "Y1") in {key for key, _, _ in heard.heard})
    wait_for(lambda: commands.heard and alive)
    assert {key for key, _, _ in commands.heard} == {keys.command(FLEET)}
    assert b"forged" not in heard.payloads()
    assert stolen.heard == []
    assert alive == [keys.alive(YARD, "Y1")]


def test_an_observer_hears_both_fleets_and_can_say_nothing(both):
    curious, observer, robot = (
        both.connect("observer", "other"),
        both.connect("observer"),
        both.connect("robot", "Y1"),
    )
    heard = both.hears(observer, f"{keys.ROOT}/**")
    own = both.hears(robot, keys.plan(YARD, "Y1"), keys.command(YARD), keys.clock(YARD, "Y1"))
    alive = []
    observer.watch_alive(keys.alive(YARD, "*"), lambda key, _: alive.append(key))
    for kind in (keys.hello, keys.plan, keys.report, keys.clock, keys.admit):
        curious.put(kind(YARD, "Y1"), b"forged")
    curious.put(keys.command(YARD), b"forged")
    curious.declare_alive(keys.alive(YARD, "Y1"))
    served(YARD, "Y1", robot)
    expected = {keys.plan(YARD, "Y1"), keys.command(YARD), keys.command(FLEET)}
    wait_for(lambda: {key for key, _, _ in heard.heard} >= expected)
    assert b"forged" not in heard.payloads() + own.payloads()
    assert alive == []


def test_a_robot_of_no_fleet_and_a_revoked_key_are_given_nothing_and_heard_by_nobody(both):
    strangers = [both.connect_with(both.keys.revoked), both.connect("robot", "R9")]
    observer, robot = both.connect("observer"), both.connect("robot", "R1")
    heard = both.hears(observer, f"{keys.ROOT}/**")
    own = [keys.command("*"), keys.command(FLEET), keys.plan(FLEET, "R1"), f"{keys.ROOT}/**"]
    stolen = [both.hears(stranger, *own) for stranger in strangers]
    for stranger in strangers:
        stranger.put(keys.report(FLEET, "R1"), encode(Report(666, 1, 1, IDLE)))
        stranger.put(keys.command(FLEET), encode(Command(666, 9, 1, 1, GO, 0, 0)))
    served(FLEET, "R1", robot)
    wait_for(lambda: keys.report(FLEET, "R1") in {key for key, _, _ in heard.heard})
    assert [inbox.heard for inbox in stolen] == [[], []]
    assert {encode(Report(666, 1, 1, IDLE)), encode(Command(666, 9, 1, 1, GO, 0, 0))}.isdisjoint(
        heard.payloads()
    )


def test_who_has_no_key_another_authoritys_or_an_expired_one_is_refused_and_told_why(hall):
    no_link(hall, hall.keys.strange, "another authority")
    no_link(hall, hall.keys.expired, "expired")
    with pytest.raises(zenoh.ZError):
        session_without_key(hall.endpoint, hall.keys.revoked.authority)
    with pytest.raises(TransportError, match="nobody answers"):
        ZenohTransport.connect(hall.endpoint.replace("tls", "tcp"), timeout_s=0.2)


def test_the_routers_key_opens_no_link(hall):
    no_link(hall, hall.keys.of("router", ""), "refuses these keys")


def test_a_key_that_is_revoked_counts_until_the_router_starts_with_what_is_written_then(hall):
    hall.coordinator(hall.two)
    robot = hall.connect("robot", "R1")
    served(FLEET, "R1", robot)
    KeyStore(hall.keys.folder).revoke("robot", "R1", NOW)
    hall.write()
    hall.router.kill()
    hall.router.wait(5.0)
    hall.start_router()
    observer, other = hall.connect("observer"), hall.connect("robot", "R2")
    heard, given = (
        hall.hears(observer, keys.report(FLEET, "*")),
        hall.hears(robot, keys.plan(FLEET, "R1")),
    )
    wait_for(robot.has_router)
    robot.put(keys.hello(FLEET, "R1"), HELLO)
    robot.put(keys.report(FLEET, "R1"), encode(Report(4, 1, 1, IDLE)))
    served(FLEET, "R2", other)
    wait_for(lambda: heard.heard)
    assert {key for key, _, _ in heard.heard} == {keys.report(FLEET, "R2")}
    assert given.heard == []


def test_what_a_router_refuses_is_in_its_own_log_and_not_in_the_coordinators(tmp_path, monkeypatch):
    monkeypatch.setenv("RUST_LOG", "warn,zenoh::net::routing::interceptor::access_control=info")
    with contextlib.ExitStack() as stack:
        hall, log = LockedHall(stack, tmp_path), tmp_path / "run.mcap"
        monkeypatch.delenv("RUST_LOG")
        run = hall.start(
            "coordinator", hall.two, "--keys", hall.keys.folder, "--json", "--log", log
        )
        Events(run).wait(lambda event: event["event"] == "listening")
        no_link(hall, hall.keys.expired, "expired")
        hall.connect_with(hall.keys.revoked)
        served(FLEET, "R1", hall.connect("robot", "R1"))
        run.send_signal(signal.SIGINT)
        assert run.wait(20.0) == 130
        hall.router.terminate()
        told = hall.router.stdout.read()
    assert "certificate expired" in told
    assert "did not match any configured ACL subject" in told
    assert not [record for record in read_log(log).records if is_denial_key(record.key)]
