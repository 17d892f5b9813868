"""One robot's network: whole, cut, healed."""

import contextlib
import socket

import pytest

from sim.processes.relay import Relay

SILENCE_S = 0.05
DEADLINE_S = 5.0


@pytest.fixture
def network():
    """A relay, a connection through it and the coordinator's end of that connection."""
    with contextlib.ExitStack() as stack:
        listener = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        listener.settimeout(DEADLINE_S)
        relay = Relay(listener.getsockname()[1])
        stack.callback(relay.close)
        robot = stack.enter_context(connected(relay))
        there = stack.enter_context(accepted(listener))
        yield relay, robot, there, listener


def connected(relay):
    return socket.create_connection(("127.0.0.1", relay.port), timeout=DEADLINE_S)


def accepted(listener):
    connection, _ = listener.accept()
    connection.settimeout(DEADLINE_S)
    return connection


def read(connection, count):
    content = b""
    while len(content) < count:
        more = connection.recv(count - len(content))
        assert more, f"ended after {len(content)} of {count} bytes"
        content += more
    return content


def hears_nothing(connection):
    connection.settimeout(SILENCE_S)
    with pytest.raises(TimeoutError):
        connection.recv(1)
    connection.settimeout(DEADLINE_S)
    return True


def test_bytes_pass_both_ways_in_order(network):
    _, robot, there, _ = network
    content = bytes(range(256)) * 2_000
    robot.sendall(content)
    assert read(there, len(content)) == content
    there.sendall(b"plan")
    assert read(robot, 4) == b"plan"


def test_while_cut_nothing_passes_either_way_and_nobody_is_told(network):
    relay, robot, there, _ = network
    relay.cut()
    robot.sendall(b"report")
    there.sendall(b"command")
    assert hears_nothing(there)
    assert hears_nothing(robot)


def test_what_was_sent_meanwhile_arrives_when_healed_before_what_is_sent_then(network):
    relay, robot, there, _ = network
    relay.cut()
    robot.sendall(b"early")
    assert hears_nothing(there)
    relay.heal()
    assert read(there, 5) == b"early"
    robot.sendall(b"late")
    assert read(there, 4) == b"late"


def test_a_relay_may_be_cut_again(network):
    relay, robot, there, _ = network
    for _ in range(3):
        relay.cut()
        robot.sendall(b"x")
        assert hears_nothing(there)
        relay.heal()
        assert read(there, 1) == b"x"


def test_a_robot_that_ends_ends_the_connection_of_the_coordinator(network):
    _, robot, there, _ = network
    robot.close()
    assert there.recv(1) == b""


def test_a_coordinator_that_ends_ends_the_connection_of_the_robot(network):
    _, robot, there, _ = network
    there.close()
    assert robot.recv(1) == b""


def test_the_end_of_a_connection_does_not_pass_a_cut(network):
    relay, robot, there, _ = network
    relay.cut()
    there.close()
    assert hears_nothing(robot)
    relay.heal()
    assert robot.recv(1) == b""


def test_a_connection_made_while_cut_is_carried_on_when_healed(network):
    relay, _, _, listener = network
    relay.cut()
    with connected(relay) as again:
        again.sendall(b"hello")
        listener.settimeout(SILENCE_S)
        with pytest.raises(TimeoutError):
            listener.accept()
        listener.settimeout(DEADLINE_S)
        relay.heal()
        with accepted(listener) as there:
            assert read(there, 5) == b"hello"


def test_without_a_coordinator_the_robot_is_turned_away(network):
    relay, _, _, listener = network
    listener.close()
    with connected(relay) as again:
        assert again.recv(1) == b""


def test_a_closed_relay_leaves_no_connection_and_nobody_listening(network):
    relay, robot, there, _ = network
    relay.cut()
    robot.sendall(b"held for ever")
    relay.close()
    assert robot.recv(1) == b""
    assert there.recv(1) == b""
    with pytest.raises(ConnectionRefusedError):
        connected(relay)
