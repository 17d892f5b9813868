"""Listeners that were stopped while a robot got another course hear of it all the same."""

import json
import signal
import threading
import time
import tomllib
import urllib.request
from contextlib import ExitStack

import pytest

from coordinator.log.log_file import read_log
from protocol.codec import decode
from protocol.messages import Command, Plan
from protocol.phases import GO
from tests.oracle_differences import changed
from tests.system.fleet_tools import free_endpoint, line_with, splinefleet, started, wait_for

COUNT = 12
WHOLE_WITHIN_S = 2.0
"""A listener that was stopped is whole again so soon after it goes on."""

STOPPED_S = 3.0


class Scenes:
    """The newest scene of a live page, read from its events, and when a scene was first whole."""

    def __init__(self, address):
        self.newest = None
        self.changed = threading.Condition()
        threading.Thread(target=self._read, args=(address,), daemon=True).start()

    def _read(self, address):
        event = ""
        with urllib.request.urlopen(f"{address}api/events?scenes=1", timeout=60.0) as answer:
            for raw in answer:
                line = raw.decode().strip()
                if line.startswith("event: "):
                    event = line.removeprefix("event: ")
                elif line.startswith("data: ") and event in ("scene", "change"):
                    told = json.loads(line.removeprefix("data: "))
                    with self.changed:
                        self.newest = told if event == "scene" else changed(self.newest, told)
                        self.changed.notify_all()

    def wait(self, state, seconds):
        """Wait until a scene is as `state` asks; return how long that took [s]."""
        began = time.monotonic()
        with self.changed:
            reached = self.changed.wait_for(
                lambda: self.newest is not None and state(self.newest), seconds
            )
        assert reached, told(self.newest)
        return time.monotonic() - began


def told(scene):
    """What a scene tells of who drives and who does not, epoch by epoch."""
    names = [robot["id"] for robot in scene["robots"]]
    return [
        (epoch["epoch"], len(epoch["rides"]), {names[a["robot"]]: a["why"] for a in epoch["aside"]})
        for epoch in scene["epochs"]
    ]


def has_all(count, revision=0):
    """A check of scenes: do this many robots have a way, nobody an unheard one, and R2 this one?"""

    def check(scene):
        names = [robot["id"] for robot in scene["robots"]]
        if not scene["epochs"]:
            return False
        epoch = scene["epochs"][-1]
        newest = {names[ride["robot"]]: ride["revision"] for ride in epoch["rides"]}
        return (
            len(newest) == count
            and newest["R2"] >= revision
            and all(aside["why"] != "plan not heard" for aside in epoch["aside"])
        )

    return check


@pytest.fixture
def floor(tmp_path):
    file = tmp_path / "hall.toml"
    done = splinefleet("scenario", "open", "--robots", COUNT, "--seed", 3, "-o", file)
    assert done.returncode == 0, done.stderr
    file.write_text(file.read_text().replace("max_speed = ", "max_speed = 0.2  # "))
    return file


def test_listeners_that_are_stopped_while_a_course_changes_are_whole_again_at_once(floor, tmp_path):
    endpoint, log = free_endpoint(), tmp_path / "beside.mcap"
    with ExitStack() as stack:
        own = tmp_path / "run.mcap"
        coordinator = stack.enter_context(
            started("coordinator", floor, "--listen", endpoint, "--log", own, "--json")
        )
        line_with(coordinator, '"listening"')
        recorder = stack.enter_context(started("record", "--connect", endpoint, "-o", log))
        view = stack.enter_context(started("view", "--connect", endpoint, "--no-open"))
        scenes = Scenes(line_with(view, "http://").strip())
        for n in range(1, COUNT + 1):
            stack.enter_context(started("agent", f"R{n}", "--connect", endpoint))
        scenes.wait(has_all(COUNT), 60.0)
        wait_for(lambda: said(own, is_go), 60.0)

        stopped = time.monotonic()
        for listener in (recorder, view):
            listener.send_signal(signal.SIGSTOP)
        robots = tomllib.loads(floor.read_text())["robots"]
        x, y = next(robot["goal"][:2] for robot in robots if robot["id"] == "R2")
        where = ("--connect", endpoint, "--fleet", read_log(own).metadata["fleet"])
        sent = splinefleet("order", *where, "--to", f"{x},{y}", "--robot", "R2", "--now")
        assert sent.returncode == 0, sent.stderr
        wait_for(lambda: newest_course(own) > 0, 60.0)
        wait_for(lambda: time.monotonic() - stopped > STOPPED_S, 10.0)
        went_on = time.monotonic()
        for listener in (recorder, view):
            listener.send_signal(signal.SIGCONT)
        assert scenes.wait(has_all(COUNT, 1), 30.0) < WHOLE_WITHIN_S, told(scenes.newest)
        wait_for(lambda: newest_course(log) > 0, went_on + WHOLE_WITHIN_S - time.monotonic())
        recorder.send_signal(signal.SIGINT)
        recorder.wait(20.0)
    assert newest_course(log) > 0


def newest_course(log):
    """The revision of R2's newest course in a log."""
    plans = (
        decode("plan", record.payload)
        for record in read_log(log).records
        if record.key.endswith("/plan/R2")
    )
    return max((plan.revision for plan in plans if isinstance(plan, Plan)), default=-1)


def is_go(command):
    return command.phase == GO


def said(log, what):
    """Whether the coordinator's log holds a Command of a kind."""
    if not log.exists():
        return False
    return any(
        isinstance(message := decode("command", record.payload), Command) and what(message)
        for record in read_log(log).records
        if record.key.endswith("/command")
    )
