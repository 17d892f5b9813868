"""A client that floods a fleet with garbage; the fleet must arrive nevertheless.

`python -m benchmarks flood` drives four robots with a coordinator, all real processes, once on a
quiet link and once while another client puts 20,000 messages a second on the fleet's keys; `python
-m benchmarks.flood RATE` does so with another rate.  Ages of Commands are measured in the robots'
own processes, from the time stamp of the coordinator's session to the arrival.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import cycle, islice
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any, Final

from msgspec import convert

from benchmarks.campaign import record
from benchmarks.lanes import lanes
from benchmarks.machine import memory_mb
from benchmarks.table import ROOT, Row
from coordinator.findings.info import summarise
from coordinator.log.log_file import read_log
from coordinator.scenario_files.scenario_reader import scenario_to_json
from protocol import keys
from protocol.codec import encode
from protocol.host_clock import host_clock_ns
from protocol.messages import PROTOCOL_VERSION, Clock, Hello, Report
from protocol.phases import MOVING
from protocol.transport import Handler
from protocol.zenoh_transport import ZenohTransport
from sim.processes.local_fleet import free_port

FLEET: Final = "flooded"
RATE: Final = 20_000
ROBOTS: Final = 4
VICTIM: Final = "R1"
"""The robot on whose keys garbage is put; Command ages are reported for the other robots."""

_SECONDS: Final = 20.0
_SPEED: Final = 0.5
_BATCH_S: Final = 0.002
_LOOK_S: Final = 0.1
_PATIENCE_S: Final = 120.0
_MIX: Final = 4_096
Process = subprocess.Popen[str]


def flood(rate: int = RATE, seconds: float = _SECONDS) -> list[Row]:
    """Drive the fleet on a quiet link, then through a flood; return a row of figures for each.

    "heard" is the number of messages in the coordinator's log, "dropped" the number that it
    dropped, as it reports.  "memory" and "growth" are those of the coordinator's process.
    """
    return [run_beside(0, seconds), run_beside(rate, seconds)]


def run_beside(rate: int, seconds: float) -> Row:
    """Drive the fleet beside a client that puts `rate` messages a second; return the figures."""
    with TemporaryDirectory() as name, ended() as processes:
        folder, endpoint = Path(name), f"tcp/127.0.0.1:{free_port()}"
        (folder / "lanes.json").write_bytes(scenario_to_json(lanes(ROBOTS, seconds, FLEET)))

        def start(what: str, *arguments: str) -> Process:
            processes.append(_start(folder / f"{what}.jsonl", *arguments))
            return processes[-1]

        coordinator = start(
            *("coordinator", "splinefleet", "coordinator", str(folder / "lanes.json")),
            *(f"--listen={endpoint}", f"--log={folder / 'run.mcap'}", "--effort=0", "--json"),
        )
        _wait_for(lambda: "listening" in (folder / "coordinator.jsonl").read_text())
        robots = [f"R{number + 1}" for number in range(ROBOTS)]
        driving = [start(robot, "benchmarks.flood", "robot", robot, endpoint) for robot in robots]
        memory = [memory_mb(coordinator.pid)]
        flooding = []
        if rate:
            flooding.append(start("flood", "benchmarks.flood", "flood", endpoint, str(rate)))
        while coordinator.poll() is None:
            memory.append(memory_mb(coordinator.pid))
            time.sleep(_LOOK_S)
        for process in (*flooding, *driving):
            process.communicate(timeout=_PATIENCE_S)
        told = {file.stem: _last_line(file) for file in folder.glob("*.jsonl")}
        trouble = _trouble(folder / "coordinator.jsonl")
        log = summarise(read_log(folder / "run.mcap"))
    ages = [age for robot in robots for age in told[robot]["ages_ms"]]
    ended_well = [one["arrived"] is not None for one in told["coordinator"]["robots"]]
    return {
        "asked/s": rate,
        "sent/s": round(told["flood"]["rate"]) if rate else 0,
        "sent": told["flood"]["sent"] if rate else 0,
        "heard": int(str(log["messages"])),
        "dropped": sum(told["coordinator"]["dropped"].values()),
        "Commands": len(ages),
        "age ms": _share(ages, 0.5),
        "99 % ms": _share(ages, 0.99),
        "most ms": _share(ages, 1.0),
        "memory MB": memory[0],
        "growth MB": max(memory) - memory[0],
        "freezes": convert(log["freezes"], int),
        "arrived": f"{sum(ended_well)} of {ROBOTS}",
        "trouble": trouble,
    }


def messages(seed: int = 1) -> list[tuple[str, bytes]]:
    """Return keys and payloads of a hostile client: garbage, other kinds, strangers, wildcards.

    No message is one that the victim itself could have sent, because it has to arrive as well.
    """
    dice = Random(seed)
    kinds = (keys.hello, keys.report, keys.clock, keys.admit, keys.plan)
    sound: list[Callable[[int], bytes]] = [
        lambda n: encode(Hello(PROTOCOL_VERSION, n)),
        lambda n: encode(Report(n, n, 1, MOVING)),
        lambda n: encode(Report(n, n, 1, MOVING, stamp_ms=n)),
        lambda n: encode(Clock(n, n)),
    ]
    found = []
    for number in range(_MIX):
        kind = dice.choice(kinds)
        match number % 8:
            case 0:
                found.append((kind(FLEET, f"X{number}"), dice.choice(sound)(number)))
            case 1:
                found.append((f"{keys.ROOT}/{FLEET}/report/*", dice.choice(sound)(number)))
            case 2:
                found.append((kind(FLEET, VICTIM), dice.randbytes(dice.randint(4_000, 9_000))))
            case 3:
                found.append((keys.report(FLEET, VICTIM), dice.choice(sound)(number)))
            case _:
                found.append((kind(FLEET, VICTIM), dice.randbytes(dice.randint(0, 400))))
    return found


def _await_end(over: threading.Event) -> None:
    """Set `over` when stdin has ended."""
    sys.stdin.read()
    over.set()


def put_flood(endpoint: str, rate: int) -> None:
    """Put messages at a rate until stdin ends, and print their number."""
    import zenoh

    config = zenoh.Config()
    for name, value in (
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
        ("transport/shared_memory/enabled", False),
    ):
        config.insert_json5(name, json.dumps(value))
    over = threading.Event()
    threading.Thread(target=_await_end, args=(over,), daemon=True).start()
    with zenoh.open(config) as session:
        source, sent, began = cycle(messages()), 0, time.monotonic()
        while not over.wait(_BATCH_S):
            due = round((time.monotonic() - began) * rate)
            for key, payload in islice(source, due - sent):
                session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)
                sent += 1
        passed = time.monotonic() - began
    sys.stdout.write(json.dumps({"sent": sent, "rate": sent / passed}) + "\n")


class ListeningTransport(ZenohTransport):
    """A robot's link that records the age of each Command on arrival [ms]."""

    ages_ms: list[float]

    def subscribe(self, key_expression: str, handler: Handler) -> None:
        """Subscribe as usual; the age of each Command is recorded before the handler is called."""
        self.ages_ms = getattr(self, "ages_ms", [])

        def hear(key: str, payload: bytes, sent_ns: int | None) -> None:
            if sent_ns is not None and key == keys.command(FLEET):
                self.ages_ms.append((time.time_ns() - sent_ns) / 1e6)
            handler(key, payload, sent_ns)

        super().subscribe(key_expression, hear)


def drive(robot: str, endpoint: str) -> None:
    """Run one robot to its end, and print the ages of the Commands that it received [ms]."""
    from robot_agent.service import Robot as Me
    from robot_agent.service import run_robot
    from sim.world.body import SimulatedBody

    transport = ListeningTransport.connect(endpoint, 30.0)
    assert isinstance(transport, ListeningTransport)
    run_robot(
        Me(robot, 0.2, _SPEED, _SPEED),
        transport,
        SimulatedBody(_SPEED),
        clock=host_clock_ns,
        sleep=lambda ns: time.sleep(ns / 1e9),
        fleet=FLEET,
        give_up_ns=30 * 10**9,
    )
    ages = [] if robot == VICTIM else transport.ages_ms
    sys.stdout.write(json.dumps({"ages_ms": [round(age, 3) for age in ages]}) + "\n")


@contextmanager
def ended() -> Iterator[list[Process]]:
    """Yield a list; every process put into it is ended, by its id, when the block is left."""
    processes: list[Process] = []
    try:
        yield processes
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def _start(said: Path, module: str, *arguments: str) -> Process:
    """Start a module as a process whose output goes into the file `said`."""
    with said.open("w") as output:
        return subprocess.Popen(
            [sys.executable, "-m", module, *arguments],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=output,
            text=True,
        )


def _wait_for(state: Callable[[], bool]) -> None:
    deadline = time.monotonic() + _PATIENCE_S
    while not state():
        if time.monotonic() > deadline:
            raise TimeoutError("a program of the benchmark does not become ready in time")
        time.sleep(_LOOK_S)


def _last_line(said: Path) -> dict[str, Any]:
    lines = said.read_text().splitlines()
    if not lines:
        raise RuntimeError(f"{said.stem} has printed nothing")
    found: dict[str, Any] = json.loads(lines[-1])
    return found


def _trouble(said: Path) -> str:
    """Return the coordinator's events that explain why the fleet stopped."""
    events = [json.loads(line) for line in said.read_text().splitlines()]
    kinds = ("timeout", "fault", "stays", "aside", "superseded", "log")
    return "; ".join(event["text"] for event in events if event["event"] in kinds)


def _share(values: list[float], part: float) -> float:
    """Return the value that a share `part` of the values does not exceed."""
    ordered = sorted(values)
    return ordered[max(math.ceil(part * len(ordered)) - 1, 0)]


def main() -> None:
    """Measure and write benchmarks/results/flood.json; or run one of the processes for it."""
    match sys.argv[1:]:
        case ["flood", endpoint, rate]:
            put_flood(endpoint, int(rate))
        case ["robot", robot, endpoint]:
            drive(robot, endpoint)
        case rates:
            record("flood", {"a fleet beside a flood": flood(*map(int, rates))})


if __name__ == "__main__":
    main()
