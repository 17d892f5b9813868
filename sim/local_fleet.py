"""A whole fleet of processes on this machine: one coordinator, one process per robot.

Decides: who is started when, which faults strike, and that no process is left behind.  Processes
are started anew, never forked, and only processes started here are ended, by their id.
"""

from __future__ import annotations

import json
import queue
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, Final

import msgspec

from coordinator.console import tell
from coordinator.scenario import Robot, Scenario
from coordinator.scenario_file import scenario_to_json
from sim.faults import Fault

Process = subprocess.Popen[str]
Event = dict[str, Any]

_GOODBYE_S: Final = 5.0
_GIVE_UP_S: Final = 30.0
"""A robot whose fleet has vanished, this program included, ends after so long [s]."""
_COMMAND: Final = (sys.executable, "-m", "splinefleet")


class Outcome(msgspec.Struct):
    """How a run ended: the coordinator's exit code, whether robots ran, what was told."""

    code: int
    started: bool
    events: list[Event]


class LocalFleet:
    """Runs a scenario in `folder`, which gets the plan, the log and the black boxes."""

    def __init__(
        self, scenario: Scenario, folder: Path, *, speed: float, effort: int, faults: list[Fault]
    ) -> None:
        self.scenario = scenario
        self.folder = folder
        self.speed = speed
        self.effort = effort
        self.faults = list(faults)
        self.endpoint = f"tcp/127.0.0.1:{_free_port()}"
        self._robots: dict[str, Process] = {}
        self._events: queue.SimpleQueue[Event | None] = queue.SimpleQueue()
        self._told: list[Event] = []
        self._start_ns = 0

    def run(self) -> Outcome:
        """Run until the coordinator ends or is killed by a fault; then end every process."""
        (self.folder / "blackbox").mkdir(parents=True, exist_ok=True)
        (self.folder / "scenario.json").write_bytes(scenario_to_json(self.scenario))
        with self._processes() as processes:
            coordinator = self._start_coordinator(processes)
            if self._follow(processes):
                self._drive_on(coordinator)
            code = coordinator.wait()
            self._say_goodbye(code)
        return Outcome(code, bool(self._robots), self._told)

    @contextmanager
    def _processes(self) -> Iterator[list[Process]]:
        processes: list[Process] = []
        try:
            yield processes
        finally:
            for process in processes:
                process.terminate()
            deadline = time.monotonic() + _GOODBYE_S
            for process in processes:
                _wait(process, deadline)
                process.kill()
                process.wait()

    def _start_coordinator(self, processes: list[Process]) -> Process:
        process = subprocess.Popen(
            [
                *_COMMAND,
                "coordinator",
                str(self.folder / "scenario.json"),
                f"--listen={self.endpoint}",
                f"--log={self.folder / 'run.mcap'}",
                f"--plan-out={self.folder / 'plan.json'}",
                f"--speed={self.speed}",
                f"--effort={self.effort}",
                "--json",
            ],
            stdout=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
            text=True,
        )
        processes.append(process)
        assert process.stdout is not None
        threading.Thread(target=self._read_events, args=(process.stdout,), daemon=True).start()
        return process

    def _start_robot(self, robot: Robot) -> Process:
        return subprocess.Popen(
            [
                *_COMMAND,
                "agent",
                robot.id,
                f"--connect={self.endpoint}",
                f"--fleet={self.scenario.name}",
                f"--radius={robot.radius}",
                f"--max-speed={robot.max_speed}",
                f"--max-accel={robot.max_accel}",
                f"--blackbox={self.folder / 'blackbox' / f'{robot.id}.csv'}",
                f"--speed={self.speed}",
                f"--give-up={_GIVE_UP_S}",
                "--quiet",
            ],
            stdout=subprocess.DEVNULL,
            stdin=subprocess.DEVNULL,
            text=True,
        )

    def _read_events(self, stream: IO[str]) -> None:
        """Put the coordinator's JSON lines into the queue; None when it has ended."""
        for line in stream:
            try:
                self._events.put(json.loads(line))
            except json.JSONDecodeError:
                tell(line.rstrip())
        self._events.put(None)

    def _follow(self, processes: list[Process]) -> bool:
        """Start the robots when the coordinator listens; True at GO, False when it has ended."""
        while (event := self._events.get()) is not None:
            self._told.append(event)
            if event["event"] == "listening":
                for robot in self.scenario.robots:
                    self._robots[robot.id] = self._start_robot(robot)
                    processes.append(self._robots[robot.id])
            elif event["event"] == "phase" and event["text"] == "GO":
                self._start_ns = int(event["start_ns"])
                return True
            elif event["event"] == "refused":
                tell(str(event["text"]))
        return False

    def _drive_on(self, coordinator: Process) -> None:
        """From GO on: let the faults strike in time, until the coordinator has ended."""
        while True:
            due = self._next_fault_s()
            try:
                event = self._events.get(timeout=due)
            except queue.Empty:
                self._strike(self.faults.pop(0), coordinator)
                continue
            if event is None:
                return
            self._told.append(event)
            if event["event"] in ("fault", "refused"):
                tell(str(event["text"]))

    def _strike(self, fault: Fault, coordinator: Process) -> None:
        target = self._robots[fault.robot] if fault.robot else coordinator
        target.send_signal(fault.signal)
        tell(f"{' '.join(filter(None, (fault.kind, fault.robot)))} at {fault.time} s")
        if fault.kind == "coordinator-hang":
            time.sleep(_GOODBYE_S / self.speed)
            coordinator.kill()

    def _next_fault_s(self) -> float | None:
        """Return the real seconds until the next fault, None when none is left."""
        if not self.faults:
            return None
        now = time.monotonic_ns() * self.speed
        return max(0.0, (self._start_ns - now) / 1e9 + self.faults[0].time) / self.speed

    def _say_goodbye(self, code: int) -> None:
        """Wait for the robots to end; those without a coordinator get time to come to rest."""
        if code != 0:
            time.sleep(_GOODBYE_S / self.speed)
            return
        deadline = time.monotonic() + _GOODBYE_S
        for process in self._robots.values():
            _wait(process, deadline)


def _wait(process: Process, deadline: float) -> None:
    """Wait for a process to end, but not beyond the deadline."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(max(0.0, deadline - time.monotonic()))


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
