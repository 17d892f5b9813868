"""A coordinator with its desk: commands over HTTP reach fleet and log, and nothing stays."""

import json
import os
import signal
import urllib.error
import urllib.request
from contextlib import ExitStack

import pytest

from coordinator.log.log_file import read_log
from protocol import keys
from protocol.codec import decode
from protocol.messages import Order, Tell
from tests.system.fleet_tools import (
    TWO_ROBOTS,
    free_endpoint,
    line_with,
    splinefleet,
    started,
    wait_for,
)

THEIRS = {
    "orderId": "theirs-7",
    "serialNumber": "R2",
    "nodes": [
        {"nodeId": "here", "sequenceId": 0, "nodePosition": {"x": 2.0, "y": 3.4}},
        {"nodeId": "there", "sequenceId": 2, "nodePosition": {"x": 2.0, "y": 2.6}},
    ],
}


def ask(address, path, method="GET", body=None):
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(
        address + path, data, {"Content-Type": "application/json"}, method=method
    )
    try:
        with urllib.request.urlopen(request, timeout=20.0) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.loads(error.read())


def test_a_fleet_is_commanded_over_http_and_the_log_says_by_whom(tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    endpoint, log = free_endpoint(), tmp_path / "run.mcap"
    with ExitStack() as stack:
        options = ("--listen", endpoint, "--log", log, "--stay", "--page", "127.0.0.1:0", "--json")
        coordinator = stack.enter_context(started("coordinator", tmp_path / "two.toml", *options))
        address = json.loads(line_with(coordinator, "http://", 60.0))["address"]
        for robot in ("R1", "R2"):
            stack.enter_context(started("agent", robot, "--connect", endpoint))

        def phases():
            robots = ask(address, "api/fleet")[1]["robots"]
            return {one["id"]: one["phase"] for one in robots}

        wait_for(lambda: phases() == {"R1": "done", "R2": "done"}, 60.0)
        status, order = ask(address, "api/orders", "POST", {"goal": [0.6, 2.0], "robot": "R1"})
        assert (status, order["state"]) == (201, "under way")
        assert ask(address, "api/freeze", "POST")[1]["phase"] == "stop"
        assert ask(address, "api/resume", "POST")[1]["phase"] == "go"
        wait_for(lambda: ask(address, f"api/orders/{order['id']}")[1]["state"] == "done", 60.0)
        (tmp_path / "theirs.json").write_text(json.dumps(THEIRS))
        options = ("--vda5050", tmp_path / "theirs.json", "--connect", endpoint, "--wait")
        done = splinefleet("order", *options)
        assert done.returncode == 0
        assert "theirs-7: R2 is under way, arrives " in " ".join(done.stderr.split())
        state = ask(address, "api/vda5050/R2")[1]
        assert (state["orderId"], state["driving"], state["nodeStates"]) == ("theirs-7", False, [])
        assert state["agvPosition"]["x"] == pytest.approx(2.0, abs=1e-4)
        assert ask(address, "api/end", "POST")[0] == 202
        assert coordinator.wait(30.0) == 0
    records = read_log(log).records
    told = [
        message
        for record in records
        if (place := keys.split(record.key)) is not None
        and isinstance(message := decode(place[1], record.payload), Order | Tell)
    ]
    assert {one.by for one in told if getattr(one, "id", "") != "theirs-7"} == {"page"}


def test_a_desk_ends_with_its_coordinator_even_if_that_is_killed(tmp_path):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    with ExitStack() as stack:
        options = ("--listen", free_endpoint(), "--page", "127.0.0.1:0", "--json")
        coordinator = stack.enter_context(started("coordinator", tmp_path / "two.toml", *options))
        address = json.loads(line_with(coordinator, "http://", 60.0))["address"]
        assert ask(address, "api/fleet")[0] == 200
        os.kill(coordinator.pid, signal.SIGKILL)

        def is_gone():
            try:
                ask(address, "api/fleet")
            except (urllib.error.URLError, ConnectionError):
                return True
            return False

        wait_for(is_gone, 10.0)


@pytest.mark.parametrize("command", ["run", "simulate"])
def test_a_run_with_a_page_takes_orders_until_it_is_told_to_end(tmp_path, command):
    (tmp_path / "two.toml").write_text(TWO_ROBOTS)
    out = tmp_path / "out"
    options = (tmp_path / "two.toml", "--page", "127.0.0.1:0", "--out", out)
    with started(command, *options) as process:
        told = line_with(process, "http://", 90.0, "stderr")
        address = told[told.index("http") :].strip()
        line_with(process, "orders are taken until the mission is ended", 20.0, "stderr")
        idle = {"R1": "done", "R2": "done"}

        def phases():
            robots = ask(address, "api/fleet")[1]["robots"]
            return {one["id"]: one["phase"] for one in robots}

        wait_for(lambda: phases() == idle, 60.0)
        asked = {"goal": [0.6, 2.0], "robot": "R1"}
        status, outlook = ask(address, "api/preview", "POST", asked)
        assert (status, outlook["robot"], outlook["way"][-1]) == (200, "R1", [0.6, 2.0])
        _, order = ask(address, "api/orders", "POST", asked)
        assert order["planned_arrival"] - order["accepted"] == pytest.approx(
            outlook["arrives"], abs=1.5
        )
        wait_for(lambda: ask(address, f"api/orders/{order['id']}")[1]["state"] == "done", 60.0)
        assert ask(address, "api/end", "POST")[0] == 202
        assert process.wait(60.0) == 0
    summary = json.loads((out / "summary.json").read_text())
    assert [one["state"] for one in summary["orders"]] == ["done"]
