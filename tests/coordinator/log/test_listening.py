"""A fleet's traffic recorded from beside it, on real Zenoh and on a transport held in the hand."""

import threading

import pytest
from typer.testing import CliRunner

from coordinator.base.errors import InputError, LogError
from coordinator.findings.info import summarise
from coordinator.fleet.log_records import LINK_GONE, LINK_UP
from coordinator.log import listening as record
from coordinator.log.listening import Recording
from coordinator.log.log_file import read_log
from protocol import keys
from protocol.codec import encode
from protocol.messages import Clock, Command, Report
from protocol.phases import GO, MOVING, OVER
from protocol.transport import Transport
from protocol.zenoh_transport import ZenohTransport
from splinefleet import app
from tests.protocol.links import PATIENCE_S, free_endpoint

COMMAND, REPORT = keys.command("f"), keys.report("f", "R1")


class Silent(Transport):
    """A transport that says nothing by itself and fails when anything is put."""

    def __init__(self):
        self.handlers = {}

    def put(self, key, payload):
        raise AssertionError(f"{key}: {payload}, of one who only listens")

    def subscribe(self, key_expression, handler):
        self.handlers[key_expression] = handler

    def declare_alive(self, key):
        raise AssertionError(f"{key}, of one who only listens")

    def watch_alive(self, key_expression, handler):
        self.handlers[key_expression] = handler

    def close(self):
        pass


@pytest.fixture(autouse=True)
def _no_lingering(monkeypatch):
    monkeypatch.setattr(record, "LINGER_S", 0.0)


def test_everything_below_the_fleets_name_is_recorded_with_its_stamp(tmp_path):
    link, path = Silent(), tmp_path / "run.mcap"
    recording = Recording(path)
    recording.begin(link, "f")
    (hear, change) = link.handlers["splinefleet/f/**"], link.handlers["splinefleet/f/alive/*"]
    change(keys.alive("f", "R1"), True)
    hear(COMMAND, encode(Command(9, 1, 1, 1, GO, 5, 5)), 10**18)
    hear(REPORT, encode(Report(1, 1, 1, MOVING)), None)
    hear("splinefleet/f/pose/R1/x", b"junk", None)
    hear(COMMAND, b"\xc1", None)
    assert not recording.listener.over.is_set()
    hear(COMMAND, encode(Command(9, 1, 2, 1, OVER, 0, 0)), None)
    change(keys.alive("f", "R1"), False)
    recording.wait()
    assert recording.close() == len(read_log(path).records) == 7
    log = read_log(path)
    assert log.complete
    assert [record.key.rpartition("/f/")[2] for record in log.records] == [
        *("alive/R1", "command", "report/R1", "pose/R1/x", "command", "command", "alive/R1"),
    ]
    assert log.records[1].publish_ns == 10**18
    assert (log.records[0].payload, log.records[-1].payload) == (LINK_UP, LINK_GONE)
    assert (log.metadata["fleet"], log.metadata["passive"]) == ("f", "yes")
    told = summarise(log)
    assert (told["passive"], told["positions_on_wire"], told["bad_messages"]) == (True, 1, 1)


@pytest.mark.parametrize("fleet", ["f", None])
def test_who_hears_nothing_is_told_so_once(tmp_path, monkeypatch, fleet):
    monkeypatch.setattr(record, "_LOOK_S", 0.001)
    link, told = Silent(), []

    def speak():
        told.append("silence")
        for hear in list(link.handlers.values())[:1]:
            hear(COMMAND, encode(Command(9, 1, 1, 1, OVER, 0, 0)), None)

    recording = Recording(tmp_path / "run.mcap", silence=speak)
    recording.begin(link, fleet)
    recording.wait()
    recording.close()
    assert told == ["silence"]


def test_what_a_fleet_says_before_its_first_command_is_recorded_with_its_time(tmp_path):
    link, path, names = Silent(), tmp_path / "run.mcap", []
    recording = Recording(path)
    thread = threading.Thread(target=lambda: names.append(recording.begin(link)))
    thread.start()
    while "splinefleet/**" not in link.handlers:
        thread.join(0.001)
    hear = link.handlers["splinefleet/**"]
    hear(keys.plan("f", "R1"), b"a plan", None)
    hear(keys.hello("g", "R1"), b"of another fleet", None)
    hear(REPORT, encode(Report(1, 1, 1, MOVING)), None)
    before = recording._clock()
    hear(COMMAND, encode(Command(9, 1, 1, 1, GO, 5, 5)), None)
    thread.join()
    hear(keys.report("g", "R1"), b"of another fleet", None)
    hear(COMMAND, encode(Command(9, 1, 2, 1, OVER, 0, 0)), None)
    recording.wait()
    assert (names, recording.close()) == (["f"], 4)
    log = read_log(path)
    assert [record.key for record in log.records] == [
        keys.plan("f", "R1"), REPORT, COMMAND, COMMAND
    ]  # fmt: skip
    assert log.records[1].log_ns <= before <= log.records[2].log_ns


def test_another_hosts_clock_is_told_by_the_answers_about_the_time(tmp_path, monkeypatch):
    link, path = Silent(), tmp_path / "run.mcap"
    now = [1_000_000_000_000]
    monkeypatch.setattr(Recording, "_clock", lambda _self: now[0])
    recording = Recording(path)
    recording.begin(link, "f")
    hear = link.handlers["splinefleet/f/**"]
    ahead = 777_000_000_000  # this clock is so far ahead of the coordinator's
    for i in range(5):
        now[0] += 100_000_000
        answered = now[0] - ahead - (1_000_000 if i else 90_000_000)
        hear(keys.clock("f", "R1"), encode(Clock(1, i, answered, answered)), None)
    start = now[0] - ahead
    hear(COMMAND, encode(Command(9, 1, 1, 1, GO, start, start)), None)
    now[0] += 2_000_000_000
    hear(REPORT, encode(Report(1, 1, 1, 5)), None)
    recording.close()
    arrival = summarise(read_log(path))["epochs"][0]["arrivals"]["R1"]
    assert arrival == pytest.approx(2.0, abs=0.002)


def test_a_log_from_beside_cannot_be_checked_and_says_so(tmp_path):
    recording = Recording(tmp_path / "run.mcap")
    recording.begin(Silent(), "f")
    recording.close()
    result = CliRunner().invoke(app, ["replay", str(tmp_path / "run.mcap"), "--check"])
    assert result.exit_code == 1
    assert "a listener's recording" in result.output.replace("\n", " ")


def test_a_recording_that_has_not_begun_leaves_no_file(tmp_path):
    assert Recording(tmp_path / "run.mcap").close() == 0
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_is_told_at_the_beginning_or_at_the_close(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        Recording(tmp_path / "no" / "run.mcap").begin(Silent(), "f")
    recording = Recording(tmp_path / "run.mcap")
    recording.begin(Silent(), "f")
    recording._recorder._writer._stream.close()
    recording.listener.hear(COMMAND, b"x", None)
    recording.wait()
    with pytest.raises(LogError, match="cannot be written"):
        recording.close()


def test_a_fleet_on_zenoh_is_recorded_whole_by_one_who_found_it_by_itself(tmp_path):
    endpoint, path = free_endpoint(), tmp_path / "run.mcap"
    recording, names = Recording(path), []
    command = [encode(Command(9, 1, i, 1, GO, 0, 0)) for i in range(50)]
    report = [encode(Report(1, i, 1, MOVING)) for i in range(50)]
    with ZenohTransport.listen(endpoint) as coordinator, ZenohTransport.connect(endpoint) as robot:
        robot.declare_alive(keys.alive("f", "R1"))
        with ZenohTransport.connect(endpoint) as listener:
            thread = threading.Thread(target=lambda: names.append(recording.begin(listener)))
            thread.start()
            while thread.is_alive():
                coordinator.put(COMMAND, command[0])
                thread.join(0.02)
            assert coordinator.wait_for_listener("splinefleet/f/report/*", PATIENCE_S)
            assert robot.wait_for_listener("splinefleet/f/report/*", PATIENCE_S)
            for one, other in zip(command, report, strict=True):
                coordinator.put(COMMAND, one)
                robot.put(REPORT, other)
                # A sender drops what a link does not take in half a millisecond.
                recording.listener.over.wait(0.005)
            while not recording.listener.over.wait(0.02):
                coordinator.put(COMMAND, encode(Command(9, 1, 99, 1, OVER, 0, 0)))
            recording.wait()
        recording.close()
    assert names == ["f"]
    log = read_log(path)
    found = [record for record in log.records if record.key == COMMAND]
    assert [r.payload for r in found if r.payload in command][-50:] == command
    assert [r.payload for r in log.records if r.key == REPORT] == report
    assert keys.alive("f", "R1") in {record.key for record in log.records}
    late = [r.log_ns + int(log.metadata["wall_offset_ns"]) - r.publish_ns for r in found]
    assert all(0 <= age < 5_000_000_000 for age in late)
    assert summarise(log)["latencies"]["command_age"]["count"] == len(found)


def test_a_file_that_is_there_is_recorded_over_on_wish_only(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"dear")
    asked = ["record", "--connect", free_endpoint(), "--wait", "0.1", "-o", str(path)]
    with pytest.raises(InputError, match=r"--output: .* already exists; --force replaces it"):
        CliRunner().invoke(app, asked, catch_exceptions=False)
    with pytest.raises(InputError, match="File exists"):
        Recording(path).begin(Silent(), "f")
    assert path.read_bytes() == b"dear"
    recording = Recording(path, replace=True)
    recording.begin(Silent(), "f")
    recording.close()
    assert read_log(path).complete
