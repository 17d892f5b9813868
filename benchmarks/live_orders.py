"""A working fleet of real processes that gets orders from commands while its coordinator is killed.

`python -m benchmarks.live_orders [ROBOTS] [SECONDS]`: 20 robots and 600 s by default.  Every few
seconds a command of its own process gives an order, by name or for any robot, sends a robot
elsewhere at once, or cancels an order.  Halfway the coordinator is killed and another goes on from
its log.  The judge looks at the black boxes; every order that a command was told is taken has to be
over, once, and the log has to be proven and to run again to the same bytes.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from random import Random
from threading import Thread
from typing import Final

import msgspec
from msgspec.structs import replace

from benchmarks.orders import day
from benchmarks.table import Row, show
from coordinator.findings.info import summarise
from coordinator.findings.info_fields import Summary
from coordinator.log.log_file import logs_before, read_log
from sim.judging.judge import judge
from sim.processes.boxed_log import newest_log
from sim.processes.local_fleet import LocalFleet
from sim.world.fault_text import parse_faults

_PAUSE: Final = (1.5, 4.5)
"""Seconds between two commands, at least and at most."""

_SHARES: Final = (("cancel", 0.1), ("now", 0.25), ("any", 0.5))
"""Commands by a throw of the dice below these shares; the others are orders by name."""

_OPEN: Final = ("waiting", "under way", "lost")
_COMMAND: Final = (sys.executable, "-m", "splinefleet")


class Operator:
    """Somebody who gives commands for a while; `taken`: the orders that were taken, as told."""

    def __init__(self, endpoint: str, places: list[tuple[float, float]], robots: list[str]) -> None:
        self._connect = ("--connect", endpoint)
        self._places, self._robots = places, robots
        self.taken: list[str] = []
        self.done: Counter[str] = Counter()
        """Commands by kind, and `failed` for those with an exit code of 1."""

    def work(self, seconds: float, dice: Random) -> None:
        """Give commands for so long [s], then tell the fleet to end."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            time.sleep(dice.uniform(*_PAUSE))
            throw = dice.random()
            kind = next((kind for kind, share in _SHARES if throw < share), "named")
            if kind == "cancel" and self.taken:
                self._say(kind, "cancel", dice.choice(self.taken[-10:]))
            else:
                self._order(kind, dice)
        self._say("end", "end", "--patience", "600")

    def _order(self, kind: str, dice: Random) -> None:
        x, y = dice.choice(self._places)
        name = f"live-{len(self.taken) + self.done['failed']}"
        words = ["order", "--to", f"{x},{y}", "--id", name]
        if kind != "any":
            words += ["--robot", dice.choice(self._robots)]
        if kind == "now":
            words.append("--now")
        if self._say(kind, *words):
            self.taken.append(name)

    def _say(self, kind: str, *words: str) -> bool:
        """Run a command; return whether it was successful."""
        done = subprocess.run([*_COMMAND, *words, *self._connect], capture_output=True, check=False)
        self.done[kind if done.returncode == 0 else "failed"] += 1
        return done.returncode == 0


def live_orders(robots: int = 20, seconds: float = 600.0, seed: int = 1) -> list[Row]:
    """Return one row: what the operator did, and what became of it."""
    scenario = day("open", robots, seed)
    docks = [] if scenario.demand is None else [place[:2] for place in scenario.demand.places]
    scenario = replace(scenario, name="live", demand=None)
    faults = parse_faults([f"coordinator-restart@{seconds / 2:.0f}"], [])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "run"
        fleet = LocalFleet(
            scenario, folder, speed=1.0, effort=20, faults=faults, page="127.0.0.1:0"
        )
        operator = Operator(fleet.endpoint, docks, [one.id for one in scenario.robots])
        works = Thread(target=operator.work, args=(seconds, Random(seed)))
        works.start()
        outcome = fleet.run()
        works.join()
        log, verdict = newest_log(folder), judge(folder)
        logs = [*logs_before(read_log(log)), read_log(log)]
        told = [msgspec.convert(summarise(one), Summary) for one in logs]
        states = {one.id: one.state for part in told for one in part.orders}
        codes = {word[0]: _code(*word, str(log)) for word in (("replay", "--check"), ("verify",))}
    open_still = [one for one in operator.taken if states.get(one, "lost") in _OPEN]
    return [
        {
            "robots": robots,
            "seconds": seconds,
            "coordinator's code": outcome.code,
            **{f"commands: {kind}": count for kind, count in sorted(operator.done.items())},
            "orders taken": len(operator.taken),
            **Counter(states.get(one, "lost") for one in operator.taken),
            "not over": len(open_still),
            "freezes": sum(part.freezes for part in told),
            "collisions": verdict.collisions + verdict.collisions_with_obstacles,
            "replay --check": codes["replay"],
            "verify": codes["verify"],
        }
    ]


def _code(*words: str) -> int:
    return subprocess.run([*_COMMAND, *words], capture_output=True, check=False).returncode


if __name__ == "__main__":
    show("orders given to live processes", live_orders(*(int(text) for text in sys.argv[1:])))
