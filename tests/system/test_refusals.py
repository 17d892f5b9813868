"""What people are told when something does not fit: one sentence, exit code 2."""

import time

import pytest

from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Hello, Refusal
from protocol.zenoh_transport import ZenohTransport
from tests.system.fleet_tools import (
    TWO_ROBOTS,
    free_endpoint,
    line_with,
    splinefleet,
    started,
    wait_for,
)


@pytest.fixture(scope="module")
def coordinator(tmp_path_factory):
    """A coordinator that waits for its robots: its endpoint and scenario file."""
    scenario = tmp_path_factory.mktemp("two") / "two.toml"
    scenario.write_text(TWO_ROBOTS)
    endpoint = free_endpoint()
    with started("coordinator", scenario, "--listen", endpoint, "--json") as process:
        line_with(process, "listening")
        yield endpoint, scenario


def only_line(done, code=2):
    assert done.returncode == code, done.stderr
    (line,) = done.stderr.strip().splitlines()
    return line


def test_a_second_coordinator_on_the_same_port_is_told_so(coordinator):
    endpoint, scenario = coordinator
    line = only_line(splinefleet("coordinator", scenario, "--listen", endpoint))
    assert "in use" in line


def test_a_robot_with_an_unknown_name_is_told_so(coordinator):
    line = only_line(splinefleet("agent", "R9", "--connect", coordinator[0]))
    assert "R9 is not in fleet two" in line


def test_a_robot_too_wide_for_its_plan_is_told_so(coordinator):
    line = only_line(splinefleet("agent", "R1", "--connect", coordinator[0], "--radius", 0.4))
    assert "radius 0.4 m" in line


def test_a_robot_of_another_protocol_version_is_told_so(coordinator):
    heard = []
    with ZenohTransport.connect(coordinator[0]) as transport:
        transport.subscribe(keys.plan("two", "R1"), lambda _k, payload, _t: heard.append(payload))

        def answered():
            transport.put(keys.hello("two", "R1"), encode(Hello(version=9, boot=4)))
            time.sleep(0.05)
            return heard

        wait_for(answered)
    refusal = decode("plan", heard[0])
    assert isinstance(refusal, Refusal)
    assert "protocol version 9" in refusal.reason


def test_a_robot_without_a_coordinator_is_told_so():
    done = splinefleet("agent", "R1", "--connect", free_endpoint(), "--wait", 1)
    assert "nobody answers" in only_line(done, code=1)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["plan", "nowhere.toml"], "nowhere.toml"),
        (["verify", "nowhere.json"], "nowhere.json"),
        (["info", "nowhere.mcap"], "nowhere.mcap"),
        (["replay", "nowhere.mcap", "--check"], "nowhere.mcap"),
        (["judge", "nowhere"], "nowhere"),
        (["plot", "nowhere.json", "-o", "x.svg"], "nowhere.json"),
        (["run", "nowhere.toml"], "nowhere.toml"),
        (["fly"], "fly"),
        (["plan"], "SCENARIO"),
        (["agent", "R1", "--connect", "udp/x"], "udp/x"),
        (["agent", "R1", "--connect", "tcp/127.0.0.1:1", "--driver", "x.py:Base"], "no file /"),
    ],
)
def test_wrong_usage_is_told_in_one_line(arguments, said):
    assert said.lower() in only_line(splinefleet(*arguments)).lower()


def test_all_problems_of_a_scenario_are_told_at_once(tmp_path):
    bad = tmp_path / "bad.toml"
    text = TWO_ROBOTS.replace("radius = 0.15", "radius = -1").replace("tau", "taw")
    bad.write_text(text)
    done = splinefleet("plan", bad)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 3
    assert "Traceback" not in done.stderr


def test_a_plan_that_cannot_be_is_told_with_exit_code_1_and_no_file(tmp_path):
    closed = tmp_path / "closed.toml"
    walls = "obstacles = [[[0.0, 2.4], [4.0, 2.4], [4.0, 2.6], [0.0, 2.6]]]\n[[robots]]"
    closed.write_text(TWO_ROBOTS.replace("[[robots]]", walls, 1))
    done = splinefleet("plan", closed, "-o", tmp_path / "plan.json")
    line = only_line(done, code=1)
    assert "R2" in line
    assert "workspace.obstacles[0]" in line
    assert not (tmp_path / "plan.json").exists()
