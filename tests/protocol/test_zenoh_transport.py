"""What only Zenoh can get wrong: opening, losing and finding the link again."""

import json
import socket
import threading
import time

import pytest
import zenoh

from protocol import zenoh_transport
from protocol.transport import TransportError
from protocol.zenoh_transport import ZenohTransport
from tests.protocol.links import PATIENCE_S, Inbox, ZenohLink, free_endpoint

_HELD_UP_S = 30.0
"""So long a session would wait for a robot that hangs if it insisted on being heard."""


@pytest.fixture
def link():
    made = ZenohLink()
    try:
        yield made
    finally:
        made.close()


def test_a_second_coordinator_on_the_same_port_is_told_so(link, capfd):
    link.session("coordinator")
    with pytest.raises(TransportError) as caught:
        ZenohTransport.listen(link.endpoint)
    assert str(caught.value) == (
        f"{link.endpoint}: the port is in use; is another coordinator running?"
    )
    assert capfd.readouterr() == ("", "")


def test_a_robot_that_finds_nobody_is_told_so_in_time(capfd):
    endpoint = free_endpoint()
    began = time.monotonic()
    with pytest.raises(TransportError) as caught:
        ZenohTransport.connect(endpoint, timeout_s=0.2)
    assert time.monotonic() - began < 2.0
    assert str(caught.value) == f"{endpoint}: nobody answers; is the coordinator or router running?"
    assert capfd.readouterr() == ("", "")


def test_a_robot_is_not_held_up_by_a_port_that_accepts_and_says_nothing():
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        endpoint = f"tcp/127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(TransportError, match="nobody answers"):
            ZenohTransport.connect(endpoint, timeout_s=0.2)


@pytest.mark.parametrize(
    "endpoint",
    [
        "",
        "nonsense",
        "127.0.0.1:7447",
        "tcp/127.0.0.1",
        "tcp/:7447",
        "tcp/127.0.0.1:port",
        "tcp/127.0.0.1:0",
        "tcp/127.0.0.1:65536",
        "foo/127.0.0.1:7447",
        "tcp/a b:7447",
        "tcp/127.0.0.1:7447\n",
        "tcp/127.0.0.1:7447#iface=lo",
    ],
)
@pytest.mark.parametrize("opening", [ZenohTransport.listen, ZenohTransport.connect])
def test_a_malformed_endpoint_is_refused_at_once_in_one_sentence(opening, endpoint):
    with pytest.raises(TransportError) as caught:
        opening(endpoint)
    assert repr(endpoint) in str(caught.value)
    assert "tcp/HOST:PORT" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_address_of_another_machine_cannot_be_listened_on():
    with pytest.raises(TransportError) as caught:
        ZenohTransport.listen("tcp/192.0.2.1:7447")  # RFC 5737: nobody's address
    assert str(caught.value).startswith("tcp/192.0.2.1:7447: cannot listen there: ")
    assert ".rs:" not in str(caught.value)


def test_a_robot_may_start_before_its_coordinator(link):
    opened = []

    def connect():
        opened.append(link.session("R1"))

    robot_starts = threading.Thread(target=connect)
    robot_starts.start()
    try:
        coordinator = link.session("coordinator")
    finally:
        robot_starts.join(PATIENCE_S)
    inbox = Inbox()
    opened[0].subscribe("f/command", inbox)
    link.say_until_heard(coordinator, "f/command", b"go", inbox)


def test_a_robot_finds_a_coordinator_that_was_restarted(link):
    first = link.session("coordinator")
    robot = link.session("R1")
    down, up = Inbox(), Inbox()
    robot.subscribe("f/command", down)
    link.say_until_heard(first, "f/command", b"first", down)
    first.close()
    robot.put("f/report", b"into the void")
    second = link.session("coordinator")
    second.subscribe("f/report", up)
    link.say_until_heard(second, "f/command", b"second", down)
    link.say_until_heard(robot, "f/report", b"here", up)
    assert set(up.payloads()) <= {b"into the void", b"here"}


def test_the_time_stamp_is_in_nanoseconds_since_1970(link):
    coordinator, robot, inbox = link.session("coordinator"), link.session("R1"), Inbox()
    robot.subscribe("f/command", inbox)
    link.say_until_heard(coordinator, "f/command", b"go", inbox)
    sent_ns = inbox.heard[0][2]
    assert isinstance(sent_ns, int)
    assert abs(sent_ns - time.time_ns()) < 60 * 10**9


def test_a_put_with_nobody_connected_returns_at_once(link):
    coordinator, robot = link.session("coordinator"), link.session("R1")
    coordinator.close()
    began = time.monotonic()
    for _ in range(100):
        robot.put("f/report", bytes(4_000))
    assert time.monotonic() - began < 1.0


def test_a_robot_is_alive_again_for_a_coordinator_that_was_restarted(link):
    first, robot = link.session("coordinator"), link.session("R1")
    before, after = Inbox(), Inbox()
    first.watch_alive("f/alive/*", lambda key, alive: before(key, alive, None))
    robot.declare_alive("f/alive/R1")
    link.until(lambda: None, before, lambda: before.payloads() == [True])
    first.close()
    second = link.session("coordinator")
    second.watch_alive("f/alive/*", lambda key, alive: after(key, alive, None))
    link.until(lambda: None, after, lambda: after.payloads() == [True])
    assert before.payloads() == [True]


def test_who_insists_on_being_heard_by_a_robot_that_hangs_holds_nobody_up(monkeypatch, link):
    patience = "transport/link/tx/queue/congestion_control/block/wait_before_close"
    monkeypatch.setitem(zenoh_transport._ROUTER, patience, round(1e6 * _HELD_UP_S))
    coordinator, hung, other = (link.session(name) for name in ("coordinator", "R1", "R2"))
    inbox, over = Inbox(), threading.Event()
    hung.subscribe("f/clock/R1", lambda *_: over.wait())
    other.subscribe("f/command", inbox)
    link.say_until_heard(coordinator, "f/command", b"hold", inbox)
    config = zenoh.Config()
    for name, value in {"mode": "client", "connect/endpoints": [link.endpoint]}.items():
        config.insert_json5(name, json.dumps(value))
    try:
        with zenoh.open(config) as stranger:
            began, block = time.monotonic(), zenoh.CongestionControl.BLOCK
            for _ in range(1_000):  # 40 MB, more than all that lies between holds
                stranger.put("f/clock/R1", bytes(40_000), congestion_control=block)
            link.say_until_heard(coordinator, "f/command", b"go", inbox)
            assert time.monotonic() - began < 0.5 * _HELD_UP_S
    finally:
        over.set()


def test_what_is_put_patiently_all_arrives_however_much_it_is(link):
    coordinator, listener, inbox = link.session("coordinator"), link.session("R1"), Inbox()
    listener.subscribe("f/report/*", inbox)
    link.say_until_heard(coordinator, "f/report/R1", b"begin", inbox)
    sent = [index.to_bytes(2) + bytes(60_000) for index in range(400)]  # 24 MB
    for payload in sent:
        coordinator.put_patiently("f/report/R2", payload)
    inbox.wait(lambda: inbox.payloads()[-1] == sent[-1], PATIENCE_S)
    arrived = [payload for key, payload, _ in inbox.heard if key == "f/report/R2"]
    assert arrived == sent


def test_who_asks_gets_every_answer_of_the_coordinator(link):
    coordinator, listener, inbox = link.session("coordinator"), link.session("R1"), Inbox()
    answers = [("f/plan/R1", b"plan"), ("f/plan/R1", b"times"), ("f/plan/R2", b"other")]
    coordinator.answer("f/plan/*", lambda: answers)
    link.until(
        lambda: listener.ask("f/plan/*", inbox),
        inbox,
        lambda: len(inbox.heard) >= len(answers),
    )
    assert [(key, payload) for key, payload, _ in inbox.heard[:3]] == answers


def test_a_question_that_nobody_answers_is_no_error_and_returns_at_once(link):
    link.session("coordinator")
    listener, inbox = link.session("R1"), Inbox()
    began = time.monotonic()
    listener.ask("f/plan/*", inbox)
    assert time.monotonic() - began < 1.0
    listener.close()
    listener.ask("f/plan/*", inbox)
    assert inbox.heard == []
