"""The operator's page in a real browser: how soon each command is seen on it.

`python -m benchmarks.desk_page 5 20 100 -o FOLDER` takes fleets of these sizes: up to 20 robots (or
as `--processes` says) are processes, more are simulated in one.  A script orders, cancels,
redirects, kills a robot, admits it, stops the fleet, lets it go on and ends it, at 1440x900 and
390x844, and writes pictures.  Each command is timed from the click to its effect on the page, by
the page's own clock; an order is seen when it is answered or listed.  A simulated robot is killed
by its script, which is timed in the fleet's seconds, and does not come back.

`python -m benchmarks.desk_page watch ADDRESS SECONDS` looks at a page that nobody touches: bytes a
second to it, share of a core that the browser takes, its memory.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from benchmarks.table import Row, show
from coordinator.log.log_file import read_log
from coordinator.scenario_files.scenario_reader import scenario_to_json
from protocol import keys
from protocol.codec import decode
from protocol.messages import Admit, Cancel, Order, Tell
from sim.floors.generator import generate
from sim.processes.local_fleet import free_port
from tests.system.browser import Tab, browser

SIZES: Final = {"desktop": (1440, 900), "phone": (390, 844)}
Process = subprocess.Popen[str]
MOST_PROCESSES: Final = 20
_PATIENCE_S: Final = 400.0
_COMMAND: Final = (sys.executable, "-m", "splinefleet")
_WATCH: Final = """(async (act, shown, limit) => {
  const told = () => ["answer", "orders", "phase", "alarms"]
    .map((id) => document.getElementById(id).textContent).join("\\n");
  const orders = () => [...document.querySelectorAll("#orders li:not([hidden]) .id")]
    .map((one) => one.textContent).filter((id) => id.startsWith("order-"));
  const begin = performance.now(), before = orders();
  const seen = () => shown(told(), orders().some((id) => !before.includes(id)));
  act();
  while (!seen() && performance.now() - begin < limit) {
    await new Promise((next) => setTimeout(next, 10));
  }
  return seen() ? (performance.now() - begin) / 1000 : null;
})"""
_LOST: Final = """(() => {
  const alarms = document.getElementById("alarms");
  new MutationObserver(() => {
    if (alarms.textContent.includes("%s is not heard")) window.lost ??= splinefleet.time;
  }).observe(alarms, { childList: true, subtree: true });
})()"""
_KILLED_S: Final = 20
"""When [s since GO] a simulated robot is killed."""


class Fleet:
    """A running fleet with its desk; `agents` are its robots' processes, if they have any."""

    def __init__(
        self,
        address: str,
        log: Path,
        agents: dict[str, Process],
        start: Callable[[str], Process] | None = None,
    ) -> None:
        self.address, self.log, self.agents, self.start = address, log, agents, start


@contextmanager
def fleet_of(count: int, folder: Path, most_processes: int) -> Iterator[Fleet]:
    """Start a fleet of so many robots on an open floor, and end what is left of it."""
    scenario = generate("open", count, 1)
    file, endpoint = folder / "hall.json", f"tcp/127.0.0.1:{free_port()}"
    file.write_bytes(scenario_to_json(scenario))
    with ExitStack() as stack:

        def start(*arguments: str) -> Process:
            process = subprocess.Popen(
                [*_COMMAND, *arguments],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        page = ("--page", "127.0.0.1:0")
        if count > most_processes:
            log = folder / "run" / "run.mcap"
            fault = f"kill:{scenario.robots[-1].id}@{_KILLED_S}"
            options = ("--box-rate", "1", "--out", str(log.parent), "--fault", fault)
            yield Fleet(_address(start("simulate", str(file), *page, *options)), log, {})
            return
        log = folder / "run.mcap"
        options = ("--listen", endpoint, "--log", str(log), "--stay", "--json")
        address = _address(start("coordinator", str(file), *page, *options))

        def agent(name: str) -> Process:
            return start("agent", name, "--connect", endpoint, "--quiet")

        agents = {robot.id: agent(robot.id) for robot in scenario.robots}
        yield Fleet(address, log, agents, agent)


def _address(process: Process) -> str:
    """Return the address of the page that a process serves; its other output is thrown away."""
    assert process.stdout is not None
    said = []
    for line in process.stdout:
        if found := re.search(r"http://[0-9.:]+/", line):
            threading.Thread(target=process.stdout.read, daemon=True).start()
            return found[0]
        said.append(line)
    raise RuntimeError("no page is served: " + "".join(said[-3:]))


def commanded(count: int, folder: Path, most_processes: int = MOST_PROCESSES) -> Iterator[Row]:
    """Yield how soon [s] each command is seen on the page of so many robots."""
    for size, (width, height) in SIZES.items():
        with TemporaryDirectory() as name, fleet_of(count, Path(name), most_processes) as fleet:
            with browser(Path(name) / "profile") as tab:
                tab.screen(width, height)
                tab.open(fleet.address)
                tab.run(_LOST % f"R{count}")
                tab.wait("/\\d+ arrived/.test(document.body.innerText)", _PATIENCE_S)
                told = _script(tab, fleet, folder / f"{count}-{size}")
                errors = len(tab.errors)
            yield {"robots": count, "screen": size, **told, "errors": errors, **_logged(fleet.log)}


def _script(tab: Tab, fleet: Fleet, pictures: Path) -> Row:
    seen: Row = {}

    def act(what: str, script: str, shown: str, limit: float = 20.0) -> None:
        asked = f"{_WATCH}(() => {{ {script} }}, (text, listed) => {shown}, {1000 * limit})"
        took = tab.run(asked)
        seen[what] = "never" if took is None else round(took, 2)
        tab.picture(pictures.with_name(f"{pictures.name}-{what}.png"))

    robots = tab.run("Object.keys(splinefleet.at(splinefleet.time))")
    for number, name in enumerate(robots[:3], start=1):
        tab.run(f"splinefleet.choose({number - 1})")
        _choose_place(tab, 0.2 * number + 0.1)
        tab.picture(pictures.with_name(f"{pictures.name}-before-{number}.png"))
        act(f"order {number}", _press("order-send"), _ordered(name))
    first, second = robots[0], robots[1]
    act(
        "cancel",
        "document.querySelector('.cancel:not([hidden])').click()",
        "/is cancelled|cancelled/.test(text)",
    )
    tab.run("document.getElementById('order-now').checked = true")
    tab.run("splinefleet.choose(1)")
    _click_floor(tab, 0.6)
    act("redirect", _press("order-send"), _ordered(second))
    act("STOP", _press("stop"), "/told to stop/.test(text)")
    act("go on", _press("go-on"), "/, go/.test(text)")
    if fleet.start is not None:
        fleet.agents[first].send_signal(signal.SIGKILL)
        lost = f"document.body.innerText.includes('{first} is not heard')"
        began = time.monotonic()
        tab.wait(lost, 30.0)
        seen["killed"] = round(time.monotonic() - began, 2)
        tab.picture(pictures.with_name(f"{pictures.name}-killed.png"))
        fleet.agents[first] = fleet.start(first)
        time.sleep(3.0)
        tab.run(f"document.getElementById('order-robot').value = '{first}'")
        answered = f"document.getElementById('answer').textContent.includes('{first} ')"
        act("admit", _press("admit"), answered, 30.0)
    else:
        tab.wait("window.lost !== undefined", _PATIENCE_S)
        seen["killed"] = round(tab.run("window.lost") - _KILLED_S, 2)
        seen["admit"] = "-"
        tab.picture(pictures.with_name(f"{pictures.name}-killed.png"))
    act(
        "end",
        "window.confirm = () => true; " + _press("end-mission"),
        "/the fleet ends/.test(text)",
    )
    return seen


def _ordered(robot: str) -> str:
    """Return when an order for a robot is seen."""
    return f"listed || /{robot}, (under way|waiting)/.test(text)"


def _press(name: str) -> str:
    return f"document.getElementById('{name}').click();"


def _choose_place(tab: Tab, share: float) -> None:
    """Click the floor near a place until the page says when the robot would be there."""
    outlook = "document.getElementById('outlook').textContent"
    for shift in range(10):
        tab.run(f"{outlook} = ''")
        _click_floor(tab, share + 0.02 * shift)
        tab.wait(f"{outlook} !== ''", _PATIENCE_S)
        if tab.run(f"{outlook}.includes('would be there')"):
            return


def _click_floor(tab: Tab, share: float) -> None:
    """Click the floor, at this share of its width and height."""
    tab.run("document.getElementById('floor').scrollIntoView()")
    box = json.loads(
        tab.run(
            "JSON.stringify((({left, top, width, height}) => [left, top, width, height])"
            "(document.getElementById('floor').getBoundingClientRect()))"
        )
    )
    x, y = box[0] + share * box[2], box[1] + share * box[3]
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        tab.point(x, y, kind)


def _logged(log: Path) -> Row:
    """Return how many of the operators' messages a log holds."""
    found: dict[str, int] = {}
    for record in read_log(log).records:
        place = keys.split(record.key)
        message = None if place is None else decode(place[1], record.payload)
        if isinstance(message, Order | Cancel | Tell | Admit) and message.by:
            found[type(message).__name__] = found.get(type(message).__name__, 0) + 1
    return {"in the log": " ".join(f"{name}:{count}" for name, count in sorted(found.items()))}


def watched(address: str, seconds: float) -> Iterator[Row]:
    """Yield what an untouched page costs, four times in so many seconds."""
    heard = [0]

    class Counting(Tab):
        def _note(self, event: dict[str, Any]) -> None:
            if event.get("method") == "Network.dataReceived":
                heard[0] += event["params"]["dataLength"]
            super()._note(event)

    with TemporaryDirectory() as name, browser(Path(name), Counting) as tab:
        tab.screen(*SIZES["desktop"])
        tab.open(address)
        time.sleep(5.0)
        for _ in range(4):
            tab.run("1")
            began, cpu, before = time.monotonic(), _cpu(name), heard[0]
            while time.monotonic() - began < seconds / 4:
                time.sleep(5.0)
                tab.run("1")
            took = time.monotonic() - began
            yield {
                "s": round(took),
                "kB/s": round((heard[0] - before) / took / 1000, 1),
                "% of a core": round(100 * (_cpu(name) - cpu) / took, 1),
                "heap MB": round(tab.run("performance.memory.usedJSHeapSize") / 1e6, 1),
                "at [s]": round(tab.run("splinefleet.time"), 1),
            }


def _cpu(folder: str) -> float:
    """Return the processor time [s] of the browser that keeps its things in a folder."""
    ticks = 0
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and folder.encode() in (entry / "cmdline").read_bytes():
                parts = (entry / "stat").read_text().rpartition(")")[2].split()
                ticks += int(parts[11]) + int(parts[12])
        except OSError:
            continue
    return ticks / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    if sys.argv[1:2] == ["watch"]:
        show("an untouched page", list(watched(sys.argv[2], float(sys.argv[3]))))
    else:
        options = argparse.ArgumentParser()
        options.add_argument("robots", nargs="+", type=int)
        options.add_argument("-o", type=Path, default=Path("pictures"))
        options.add_argument("--processes", type=int, default=MOST_PROCESSES)
        asked = options.parse_args()
        asked.o.mkdir(parents=True, exist_ok=True)
        rows = [row for count in asked.robots for row in commanded(count, asked.o, asked.processes)]
        show("from the click to what is seen [s]", rows)
