"""A whole fleet of processes on this machine: one coordinator, one process per robot.

Decides: which program is started when, how faults are caused, and that no process is left behind.
Processes are started anew, never forked, and only processes started here are ended, by their id.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import msgspec

from coordinator.base.console import tell_now
from coordinator.base.interrupts import held_back
from coordinator.log.box_file import box_text
from coordinator.scenario.model import Robot, Scenario
from coordinator.scenario_files.scenario_reader import scenario_to_json
from protocol.endpoint import endpoint_of
from protocol.host_clock import host_clock_ns
from sim.judging.blackbox import parse_blackbox
from sim.processes.programs import Programs
from sim.processes.relay import Relay
from sim.processes.run_folder import clear_folder, drop_starts
from sim.processes.scripted_body import SCRIPT
from sim.world.fault_text import Fault, Strike, strikes_of, write_fault
from sim.world.random_traffic import Babbler

Process = subprocess.Popen[str]
Event = dict[str, Any]

_GOODBYE_S: Final = 5.0
TROUBLE: Final = ("aside", "back", "fault", "late", "refused", "stays", "timeout", "warning")
"""What went wrong: kinds of a coordinator's events that whoever started the run is told at once."""


class Outcome(msgspec.Struct):
    """The outcome of a run: the coordinator's exit code and events, and whether robots ran."""

    code: int
    started: bool
    events: list[Event]


class LocalFleet:
    """Runs a scenario in `folder`, which gets the plan, the logs and the black boxes.

    A robot whose body is to fail drives a FaultyBody, whose script is `faults/<robot>.txt`; a robot
    whose network is to be cut connects through a relay.  The first coordinator writes run.mcap; one
    that is started again resumes from the previous log and writes run-2.mcap, and so on.  If
    `router` is an endpoint, all programs connect to it; otherwise the coordinator listens on a free
    port.  With a `page`, HOST:PORT, the operator's page is served there, and the fleet takes orders
    until it is told to end.  `cores` names, by robot, programs in place of the agent's core.
    """

    def __init__(
        self,
        scenario: Scenario,
        folder: Path,
        *,
        speed: float,
        effort: int,
        faults: list[Fault],
        router: str | None = None,
        keys: Path | None = None,
        page: str | None = None,
        cores: Mapping[str, Path] = MappingProxyType({}),
    ) -> None:
        self.scenario = scenario
        self.folder = folder
        self.speed = speed
        self.faults = list(faults)
        self._programs = Programs(folder, scenario.name, speed, effort, keys, cores)
        self.endpoint = router or self._programs.endpoint(free_port())
        self._desk = () if page is None else (f"--page={page}", "--stay")
        self._meet = f"--{'connect' if router else 'listen'}={self.endpoint}"
        place = endpoint_of(self.endpoint, locked=keys is not None)
        self._host, self._port = place.host, place.port
        self._strikes = strikes_of(faults)
        self._logs = [folder / "run.mcap"]
        self._robots: dict[str, Process] = {}
        self._processes: list[Process] = []
        self._hung: list[Process] = []
        self._relays: dict[str, Relay] = {}
        self._babblers: list[Babbler] = []
        self._events: queue.SimpleQueue[tuple[Process, Event | None]] = queue.SimpleQueue()
        self._told: list[Event] = []
        self._start_ns = 0

    def run(self) -> Outcome:
        """Run until the last coordinator has ended or was killed; then end every process.

        Raises TransportError when a robot has no usable keys.
        """
        for one in self.scenario.robots:
            self._programs.keys_of(one.id)
        self._prepare_folder()
        with ExitStack() as stack:
            stack.callback(lambda: drop_starts(self.folder, self._start_ns))
            for robot in {fault.robot for fault in self.faults if fault.act == "cut"}:
                self._relays[robot] = Relay(self._port, self._host)
                stack.callback(self._relays[robot].close)
            stack.callback(self._end_processes)
            stack.callback(self._end_babblers)
            self._coordinator = self._start_coordinator(
                f"--log={self._logs[0]}", f"--plan-out={self.folder / 'plan.json'}"
            )
            if self._follow():
                self._drive_on()
            code = self._coordinator.wait()
            self._say_goodbye()
        if code == -signal.SIGKILL and self._start_ns:
            self._tell_how_to_go_on()
        return Outcome(code, self.has_started, self._told)

    @property
    def has_started(self) -> bool:
        """Return whether any robot was started."""
        return bool(self._robots)

    def _prepare_folder(self) -> None:
        clear_folder(self.folder)
        (self.folder / "scenario.json").write_bytes(scenario_to_json(self.scenario))
        if any(fault.act == "body" for fault in self.faults):
            (self.folder / "faults").mkdir(exist_ok=True)

    def _script(self, robot: str) -> Path:
        return self.folder / "faults" / f"{robot}.txt"

    def _start_coordinator(self, *options: str) -> Process:
        options = (self._meet, *options, *self._desk)
        process = self._start(self._programs.coordinator(*options), stdout=subprocess.PIPE)
        threading.Thread(target=self._read_events, args=(process,), daemon=True).start()
        return process

    def _resume_coordinator(self) -> None:
        """Start a coordinator that resumes from the log of the previous one."""
        before = self._logs[-1]
        self._logs.append(self.folder / f"run-{len(self._logs) + 1}.mcap")
        self._coordinator = self._start_coordinator(f"--resume={before}", f"--log={self._logs[-1]}")

    def _start_robot(self, robot: Robot) -> Process:
        relay = self._relays.get(robot.id)
        faulty = any(fault.robot == robot.id and fault.act == "body" for fault in self.faults)
        endpoint = self._programs.endpoint(relay.port) if relay else self.endpoint
        return self._start(
            self._programs.agent(robot, endpoint, faulty),
            stdout=subprocess.DEVNULL,
            env={**os.environ, SCRIPT: str(self._script(robot.id))},
        )

    def _start(self, command: list[str], stdout: int, env: dict[str, str] | None = None) -> Process:
        """Start a program that is ended with the run, even if the run is interrupted meanwhile."""
        with held_back():
            process = subprocess.Popen(
                command, stdout=stdout, stdin=subprocess.DEVNULL, text=True, env=env
            )
            self._processes.append(process)
        return process

    def _read_events(self, process: Process) -> None:
        """Put a coordinator's events into the queue, and None when it has ended."""
        assert process.stdout is not None
        with process.stdout as lines:
            for line in lines:
                try:
                    self._events.put((process, json.loads(line)))
                except json.JSONDecodeError:
                    tell_now(line.rstrip())
        self._events.put((process, None))

    def _follow(self) -> bool:
        """Start the robots when the coordinator listens; True at GO, False if it ends before."""
        while (event := self._events.get()[1]) is not None:
            self._told.append(event)
            if event["event"] == "listening":
                tell_now(event["text"])
                for robot in self.scenario.robots:
                    self._robots[robot.id] = self._start_robot(robot)
            elif event["event"] == "phase" and event["phase"] == "GO":
                self._start_ns = int(event["start_ns"])
                return True
            else:
                _tell_trouble(event)
        return False

    def _drive_on(self) -> None:
        """Apply the faults at their times from the first GO on, until no coordinator is left."""
        while True:
            try:
                process, event = self._events.get(timeout=self._next_strike_s())
            except queue.Empty:
                self._strike(self._strikes.pop(0))
                continue
            if event is not None:
                self._told.append(event)
                _tell_trouble(event)
                if event["event"] == "waiting":  # Before GO, programs that start are waited for.
                    tell_now(event["text"])
            elif process is self._coordinator and not self._awaits_resumption():
                self._tell_if_killed()
                break
        for strike in self._strikes:
            if strike.first:
                tell_now(f"{write_fault(strike.fault)}: the run had ended before")

    def _awaits_resumption(self) -> bool:
        """Return whether the coordinator was killed and another is to follow."""
        killed = self._coordinator.wait() == -signal.SIGKILL
        return killed and any(strike.act == "resume" for strike in self._strikes)

    def _tell_if_killed(self) -> None:
        """Tell what a coordinator that was killed leaves behind."""
        if self._coordinator.wait() == -signal.SIGKILL:
            tell_now("the coordinator has ended: robots stand where their authority ends")

    def _tell_how_to_go_on(self) -> None:
        """Tell how to go on from the last log, and where each robot's program is started again."""
        log, later = self._logs[-1], self.folder / f"run-{len(self._logs) + 1}.mcap"
        command = self._programs.coordinator_for_people(
            self._meet, f"--resume={log}", f"--log={later}", *self._desk
        )
        tell_now(f"to go on: `{command}`; then start the robots where they stand, and admit them")
        for robot in self.scenario.robots:
            box = self.folder / "blackbox" / f"{robot.id}.csv"
            rows = parse_blackbox(box_text(box, None), str(box))[0] if box.is_file() else None
            if rows is not None and len(rows):
                x, y, heading = rows[-1, 1:4]
                told = self._programs.way_back(robot.id, self.endpoint, (x, y, heading))
                tell_now(f"{robot.id} stands at ({x:.2f}, {y:.2f}): {told}")

    def _next_strike_s(self) -> float | None:
        """Return the real seconds until the next strike, None when none is left."""
        if not self._strikes:
            return None
        now = host_clock_ns() * self.speed
        return max(0.0, (self._start_ns - now) / 1e9 + self._strikes[0].time) / self.speed

    def _strike(self, strike: Strike) -> None:
        fault = strike.fault
        target = self._robots[fault.robot] if fault.robot else self._coordinator
        match strike.act:
            case "kill":
                target.kill()
            case "stop":
                target.send_signal(signal.SIGSTOP)
                self._hung.append(target)
            case "continue":
                target.send_signal(signal.SIGCONT)
                self._hung.remove(target)
            case "body":
                with self._script(fault.robot).open("a") as script:
                    script.write(f"{fault.kind} {fault.value}\n")
            case "cut":
                self._relays[fault.robot].cut()
            case "heal":
                self._relays[fault.robot].heal()
            case "babble":
                seconds = fault.value / self.speed
                name = self.scenario.name
                own = self._programs.keys_of(fault.robot)
                self._babblers.append(Babbler(self.endpoint, name, fault.robot, seconds, own))
            case "resume":
                self._resume_coordinator()
        text = write_fault(fault) + ("" if strike.first else f": {strike.act}")
        tell_now(text)
        self._told.append({"event": "strike", "robot": fault.robot, "text": text})

    def _say_goodbye(self) -> None:
        """Wait for the robots to end; those without a coordinator get time to come to rest."""
        deadline = time.monotonic() + _GOODBYE_S / min(self.speed, 1.0)
        for process in self._robots.values():
            if process not in self._hung:
                _wait(process, deadline)

    def _end_babblers(self) -> None:
        for babbler in self._babblers:
            babbler.close()

    def _end_processes(self) -> None:
        for process in self._hung:
            process.kill()
        for process in self._processes:
            process.terminate()
        deadline = time.monotonic() + _GOODBYE_S
        for process in self._processes:
            _wait(process, deadline)
            process.kill()
            process.wait()


def _tell_trouble(event: Event) -> None:
    if event["event"] in (*TROUBLE, "alarm", "order", "order state", "page", "resumed", "until"):
        tell_now(str(event["text"]))


def _wait(process: Process, deadline: float) -> None:
    """Wait for a process to end, but not beyond the deadline."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(max(0.0, deadline - time.monotonic()))


def free_port() -> int:
    """Return a port of the loopback interface on which no program listens now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
