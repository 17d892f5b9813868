"""Listeners that were stopped while the fleet began an epoch hear its plans all the same."""

import json
import signal
import threading
import time
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


def has_all(count, epoch):
    """A check of scenes: does this many robots have a way in an epoch, and nobody unheard one?"""

    def check(scene):
        return any(
            one["epoch"] >= epoch
            and len(one["rides"]) == count
            and all(aside["why"] != "plan not heard" for aside in one["aside"])
            for one in scene["epochs"]
        )

    return check


@pytest.fixture
def floor(tmp_path):
    file = tmp_path / "hall.toml"
    done = splinefleet("scenario", "open", "--robots", COUNT, "--seed", 3, "-o", file)
    assert done.returncode == 0, done.stderr
    file.write_text(file.read_text().replace("max_speed = ", "max_speed = 0.2  # "))
    return file


def test_listeners_that_are_stopped_across_an_epoch_are_whole_again_at_once(floor, tmp_path):
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
        agents = [
            stack.enter_context(started("agent", f"R{n}", "--connect", endpoint))
            for n in range(1, COUNT + 1)
        ]
        scenes.wait(has_all(COUNT, 1), 60.0)
        wait_for(lambda: said(own, is_go), 60.0)

        stopped = time.monotonic()
        for listener in (recorder, view):
            listener.send_signal(signal.SIGSTOP)
        agents[0].kill()
        wait_for(lambda: said(own, is_of_next_epoch), 60.0)
        wait_for(lambda: time.monotonic() - stopped > STOPPED_S, 10.0)
        went_on = time.monotonic()
        for listener in (recorder, view):
            listener.send_signal(signal.SIGCONT)
        assert scenes.wait(has_all(COUNT - 1, 2), 30.0) < WHOLE_WITHIN_S, told(scenes.newest)
        others = {f"R{n}" for n in range(2, COUNT + 1)}
        wait_for(lambda: newest_plans(log) == others, went_on + WHOLE_WITHIN_S - time.monotonic())
        recorder.send_signal(signal.SIGINT)
        recorder.wait(20.0)
    assert newest_plans(log) == others


def newest_plans(log):
    """The robots whose plans of the newest epoch, after the first, a log holds."""
    plans = [
        (message.epoch, message.robot)
        for record in read_log(log).records
        if "/plan/" in record.key and isinstance(message := decode("plan", record.payload), Plan)
    ]
    newest = max(epoch for epoch, _ in plans)
    return {robot for epoch, robot in plans if epoch == newest >= 2}


def is_go(command):
    return command.phase == GO


def is_of_next_epoch(command):
    return command.epoch >= 2


def said(log, what):
    """Whether the coordinator's log holds a Command of a kind."""
    if not log.exists():
        return False
    return any(
        isinstance(message := decode("command", record.payload), Command) and what(message)
        for record in read_log(log).records
        if record.key.endswith("/command")
    )
