"""A fleet behind locks, on real Zenoh: who gets in, who may say what, and what is told of it."""

import socket
import time

import pytest
import zenoh

from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import PROTOCOL_VERSION, Admit, Command, Hello, Plan, Report
from protocol.phases import GO, IDLE
from protocol.transport import NoAnswerError, TransportError
from protocol.zenoh_transport import ZenohTransport
from tests.protocol.links import Inbox
from tests.system.fleet_tools import splinefleet, wait_for
from tests.system.locked_fleet import (
    FLEET,
    coordinator,
    locked_endpoint,
    no_link,
    session_without_key,
)

HELLO = encode(Hello(version=PROTOCOL_VERSION, boot=4))


@pytest.fixture(scope="module")
def gate(tmp_path_factory):
    with coordinator(tmp_path_factory.mktemp("locked")) as running:
        yield running


def is_refused_within_a_second(gate, attempt, *words):
    began = time.monotonic()
    attempt()
    event, came = gate.events.denial(*words, since=began)
    assert came - began < 1.0
    return event


def test_a_key_of_another_authority_is_refused_and_both_sides_are_told_why(gate):
    def attempt():
        no_link(gate, gate.keys.strange, "another authority")

    is_refused_within_a_second(gate, attempt, "somebody", "from another authority")


def test_an_expired_key_is_refused_and_told_whose_it_is(gate):
    def attempt():
        no_link(gate, gate.keys.expired, "expired")

    is_refused_within_a_second(gate, attempt, "robot R1, key 1", "has expired")


def test_who_has_no_key_is_refused(gate):
    def attempt():
        with pytest.raises(zenoh.ZError):
            session_without_key(gate.endpoint, gate.keys.revoked.authority)

    is_refused_within_a_second(gate, attempt, "somebody", "it has no key")


def test_plain_tcp_is_refused(gate):
    def attempt():
        with pytest.raises(TransportError, match="nobody answers"):
            ZenohTransport.connect(gate.endpoint.replace("tls", "tcp"), timeout_s=0.2)

    is_refused_within_a_second(gate, attempt, "somebody", "plain TCP")


def test_a_revoked_key_is_given_nothing_and_heard_by_nobody_while_the_next_one_is(gate):
    began = time.monotonic()
    with (
        gate.connect_with(gate.keys.revoked) as thief,
        gate.connect("robot", "R1") as robot,
        gate.connect("observer") as observer,
    ):
        event, came = gate.events.denial("robot R1, key 2", "127.0.0.1", "revoked", since=began)
        assert came - began < 1.0
        assert event["who"].startswith("robot R1, key 2")
        stolen, given, heard, alive = Inbox(), Inbox(), Inbox(), []
        for expression in (keys.command("*"), keys.plan(FLEET, "R1"), f"{keys.ROOT}/**"):
            thief.subscribe(expression, stolen)
        robot.subscribe(keys.plan(FLEET, "R1"), given)
        robot.subscribe(keys.command(FLEET), given)
        observer.subscribe(keys.report(FLEET, "*"), heard)
        observer.watch_alive(keys.alive(FLEET, "*"), lambda *news: alive.append(news))
        thief.declare_alive(keys.alive(FLEET, "R1"))
        for number in range(50):
            thief.put(keys.report(FLEET, "R1"), encode(Report(666, number, 1, IDLE)))

        def is_served():
            robot.put(keys.hello(FLEET, "R1"), HELLO)
            robot.put(keys.report(FLEET, "R1"), encode(Report(4, 1, 1, IDLE)))
            kinds = {type(decode(keys.split(key)[1], bytes_)) for key, bytes_, _ in given.heard}
            return kinds >= {Plan, Command} and heard.heard

        wait_for(is_served)
        assert stolen.heard == []
        assert {decode("report", payload).boot for payload in heard.payloads()} == {4}
        assert alive == []


def test_a_robot_can_neither_speak_as_another_nor_as_the_coordinator_nor_hear_their_plans(gate):
    with (
        gate.connect("robot", "R1") as thief,
        gate.connect("robot", "R2") as victim,
        gate.connect("observer") as observer,
    ):
        heard, stolen, own, alive = Inbox(), Inbox(), Inbox(), []
        observer.subscribe(f"{keys.ROOT}/**", heard)
        observer.watch_alive(keys.alive(FLEET, "*"), lambda key, _: alive.append(key))
        for expression in (f"{keys.ROOT}/**", keys.plan(FLEET, "*"), keys.plan(FLEET, "R2")):
            thief.subscribe(expression, stolen)
        thief.subscribe(keys.clock(FLEET, "R2"), stolen)
        victim.subscribe(keys.plan(FLEET, "R2"), own)
        forbidden = {
            keys.hello(FLEET, "R2"): HELLO,
            keys.report(FLEET, "R2"): encode(Report(666, 1, 1, IDLE)),
            keys.clock(FLEET, "R2"): b"\x90",
            keys.command(FLEET): encode(Command(666, 9, 1, 1, GO, 0, 0)),
            keys.plan(FLEET, "R2"): b"\x90",
            keys.plan(FLEET, "R1"): b"\x90",
            keys.admit(FLEET, "R2"): encode(Admit(666)),
            "splinefleet/other/report/R1": b"\x90",
            "another/key": b"\x90",
        }
        for key, payload in forbidden.items():  # One by one: Zenoh drops some of many at once.
            began = time.monotonic()
            thief.put(key, payload)
            _, came = gate.events.denial("robot R1, key 3", f"publish on {key}", since=began)
            assert came - began < 1.0
        thief._session.delete(keys.plan(FLEET, "R2"))
        thief.declare_alive(keys.alive(FLEET, "R2"))
        thief.declare_alive(keys.alive(FLEET, "R1"))
        gate.events.denial("robot R1, key 3", f"declare itself alive on {keys.alive(FLEET, 'R2')}")
        gate.events.denial("robot R1, key 3", f"subscribe to {keys.plan(FLEET, 'R2')}")
        gate.events.denial("robot R1, key 3", f"subscribe to {keys.ROOT}/**")
        gate.events.denial("robot R1, key 3", f"delete {keys.plan(FLEET, 'R2')}")

        def is_served():
            victim.put(keys.hello(FLEET, "R2"), HELLO)
            thief.put(keys.report(FLEET, "R1"), encode(Report(7, 1, 1, IDLE)))
            return own.heard and keys.report(FLEET, "R1") in {key for key, _, _ in heard.heard}

        wait_for(is_served)
        of_thief = [
            (key, payload) for key, payload, _ in heard.heard if payload in forbidden.values()
        ]
        assert [pair for pair in of_thief if pair[0] != keys.hello(FLEET, "R2")] == []
        assert {key for key, _, _ in stolen.heard} <= {keys.command(FLEET)}
        wait_for(lambda: keys.alive(FLEET, "R1") in alive)
        assert keys.alive(FLEET, "R2") not in alive


def test_an_observer_hears_all_of_the_fleet_and_can_say_nothing(gate):
    with (
        gate.connect("observer", "other") as curious,
        gate.connect("observer") as observer,
        gate.connect("robot", "R1") as robot,
    ):
        heard, own, seen = Inbox(), Inbox(), Inbox()
        observer.subscribe(f"{keys.ROOT}/**", heard)
        curious.subscribe(keys.hello("*", "*"), seen)
        robot.subscribe(keys.plan(FLEET, "R1"), own)
        for number, kind in enumerate((keys.hello, keys.plan, keys.report, keys.clock, keys.admit)):
            curious.put(kind(FLEET, "R1"), b"forged %d" % number)
            gate.events.denial("observer other, key 1", f"publish on {kind(FLEET, 'R1')}")
        curious.put(keys.command(FLEET), b"forged")
        curious.declare_alive(keys.alive(FLEET, "R1"))
        gate.events.denial("observer other, key 1", f"publish on {keys.command(FLEET)}")
        gate.events.denial(
            "observer other, key 1", f"declare itself alive on {keys.alive(FLEET, 'R1')}"
        )

        def is_served():
            robot.put(keys.hello(FLEET, "R1"), HELLO)
            return (
                own.heard
                and seen.heard
                and keys.plan(FLEET, "R1") in [k for k, _, _ in heard.heard]
            )

        wait_for(is_served)
        assert not any(payload.startswith(b"forged") for payload in heard.payloads())
        assert not any(payload.startswith(b"forged") for payload in own.payloads())


def test_an_observer_is_told_the_plans_that_it_asks_for_and_a_robot_is_not(gate):
    with gate.connect("observer") as observer, gate.connect("robot", "R1") as robot:
        told, stolen = Inbox(), Inbox()

        def is_told():
            robot.ask(keys.plan(FLEET, "*"), stolen)
            observer.ask(keys.plan(FLEET, "*"), told)
            return {keys.plan(FLEET, "R1"), keys.plan(FLEET, "R2")} <= {k for k, _, _ in told.heard}

        wait_for(is_told)
        assert stolen.heard == []


def test_an_operator_can_admit_and_nothing_else(gate):
    with gate.connect("operator") as operator, gate.connect("observer") as observer:
        heard, answers = Inbox(), Inbox()
        observer.subscribe(f"{keys.ROOT}/**", heard)
        operator.subscribe(keys.plan("*", "R1"), answers)
        operator.put(keys.report(FLEET, "R1"), b"forged")
        operator.put(keys.command(FLEET), b"forged")
        gate.events.denial("operator operator, key 1", keys.report(FLEET, "R1"))
        gate.events.denial("operator operator, key 1", keys.command(FLEET))

        def is_answered():
            operator.put(keys.admit(FLEET, "R1"), encode(Admit(17)))
            return answers.heard

        wait_for(is_answered)
        assert b"forged" not in heard.payloads()


def test_a_robot_of_no_scenario_is_told_that_it_has_no_part(gate):
    began = time.monotonic()
    with gate.connect("robot", "R9"):
        gate.events.denial("robot R9, key 1", "no part in this fleet", since=began)


def test_no_pattern_in_a_common_name_stands_for_anybody_else(gate):
    with gate.connect("observer") as observer:
        heard = Inbox()
        observer.subscribe(keys.report(FLEET, "*"), heard)
        for files in gate.keys.patterns:
            began = time.monotonic()
            with gate.connect_with(files) as trickster, gate.connect("robot", "R1") as robot:
                stolen, given = Inbox(), Inbox()
                trickster.subscribe(keys.command(FLEET), stolen)
                robot.subscribe(keys.command(FLEET), given)
                gate.events.denial("not in the register", since=began)
                trickster.put(keys.report(FLEET, "R1"), b"forged")
                trickster.put(keys.report(FLEET, "R1"), b"forged")
                wait_for(lambda given=given: len(given.heard) > 1)
                assert stolen.heard == []
        assert b"forged" not in heard.payloads()


def test_a_robot_does_not_take_another_robot_for_its_coordinator(gate):
    endpoint = locked_endpoint()
    with (
        ZenohTransport.listen(endpoint, gate.keys.of("robot", "R1")),
        pytest.raises(TransportError, match="not trusted"),
    ):
        ZenohTransport.connect(endpoint, timeout_s=0.3, keys=gate.keys.of("robot", "R2"))


def test_a_robot_without_keys_and_one_with_keys_are_told_that_the_other_side_has_others(gate):
    done = splinefleet("agent", "R1", "--connect", gate.endpoint)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "needs --keys" in done.stderr
    endpoint = locked_endpoint()
    with ZenohTransport.listen(endpoint.replace("tls", "tcp")):
        options = ["--connect", endpoint, "--wait", 0.5, "--keys", gate.keys.folder]
        done = splinefleet("agent", "R1", *options)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "does not speak TLS" in done.stderr


def test_a_coordinator_that_hangs_is_told_as_nobody_who_answers(gate):
    with socket.create_server(("127.0.0.1", 0)) as hung:
        endpoint = f"tls/127.0.0.1:{hung.getsockname()[1]}"
        with pytest.raises(NoAnswerError, match="nobody answers"):
            ZenohTransport.connect(endpoint, timeout_s=0.3, keys=gate.keys.of("robot", "R1"))
