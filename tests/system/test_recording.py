"""Logs of real programs: recorded from beside, cut by a kill, made whole, played again."""

import contextlib
import signal

import pytest

from coordinator.base.errors import InputError
from coordinator.log.log_file import read_log
from protocol import keys
from protocol.codec import encode
from protocol.messages import Command, Report
from protocol.phases import GO, MOVING, OVER
from protocol.zenoh_transport import ZenohTransport
from tests.protocol.links import Inbox, free_endpoint
from tests.system.fleet_tools import splinefleet, started, wait_for

COMMAND, REPORT = keys.command("f"), keys.report("f", "R1")


@pytest.fixture
def coordinator():
    endpoint = free_endpoint()
    with ZenohTransport.listen(endpoint) as transport:
        transport.endpoint = endpoint
        yield transport


def speak(coordinator, phase, path):
    """Say something until it is in the file."""
    numbers = iter(range(10_000))

    def is_recorded():
        coordinator.put(COMMAND, encode(Command(9, 1, next(numbers), 1, phase, 0, 0)))
        coordinator.put(REPORT, encode(Report(1, next(numbers), 1, MOVING)))
        with contextlib.suppress(InputError):
            return {COMMAND, REPORT} <= {record.key for record in read_log(path).records}
        return False

    wait_for(is_recorded)


@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_recording_is_closed_and_ends_with_130(tmp_path, coordinator, signal_number):
    path = tmp_path / "beside.mcap"
    with started("record", "--connect", coordinator.endpoint, "-o", path) as process:
        speak(coordinator, GO, path)
        process.send_signal(signal_number)
        assert process.wait(20) == 130
        assert "messages" in process.stderr.read()
    log = read_log(path)
    assert log.complete
    assert {COMMAND, REPORT} <= {record.key for record in log.records}


def test_a_recording_ends_by_itself_when_the_fleet_is_over(tmp_path, coordinator):
    path = tmp_path / "beside.mcap"
    with started("record", "--connect", coordinator.endpoint, "-o", path, "--fleet=f") as process:
        speak(coordinator, GO, path)

        def has_ended():
            coordinator.put(COMMAND, encode(Command(9, 1, 0, 1, OVER, 0, 0)))
            return process.poll() is not None

        wait_for(has_ended)
        assert process.returncode == 0
    assert read_log(path).complete


def test_a_killed_recording_is_made_whole_and_played_to_one_who_listens(tmp_path, coordinator):
    path, whole = tmp_path / "beside.mcap", tmp_path / "whole.mcap"
    with started("record", "--connect", coordinator.endpoint, "-o", path, "--fleet=f") as process:
        speak(coordinator, GO, path)
        process.kill()
        process.wait(20)
    done = splinefleet("recover", path, "-o", whole)
    assert done.returncode == 0, done.stderr
    log = read_log(whole)
    assert log.complete
    assert [(r.key, r.payload, r.log_ns) for r in log.records] == [
        (r.key, r.payload, r.log_ns) for r in read_log(path).records
    ]
    endpoint, inbox = free_endpoint(), Inbox()
    options = ("--listen", endpoint, "--wait-listener", "20", "--prefix", "again", "--speed", "9")
    with (
        started("replay", whole, *options, "--keys", "**/report/*", "--json") as process,
        ZenohTransport.connect(endpoint, timeout_s=20.0) as listener,
    ):
        listener.subscribe("again/**", inbox)
        assert process.wait(60) == 0, process.stderr.read()
        sent = [record.payload for record in log.records if record.key == REPORT]
        inbox.wait(lambda: len(inbox.heard) >= len(sent), 5.0)
    assert inbox.payloads() == sent
    assert {key for key, *_ in inbox.heard} == {f"again/{REPORT}"}


def test_a_replay_that_nobody_hears_plays_nothing(tmp_path, coordinator):
    path = tmp_path / "beside.mcap"
    with started("record", "--connect", coordinator.endpoint, "-o", path, "--fleet=f") as process:
        speak(coordinator, GO, path)
        process.send_signal(signal.SIGINT)
        process.wait(20)
    done = splinefleet("replay", path, "--listen", free_endpoint(), "--wait-listener", "0.2")
    assert done.returncode == 1
    assert "nobody listens after 0.2 s" in done.stderr
