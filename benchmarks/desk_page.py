"""The operator's page in a real browser: how soon each command is seen on it.

`python -m benchmarks.desk_page 5 20 100 -o FOLDER` takes fleets of these sizes: up to 20 robots (or
as `--processes` says) are processes, more are simulated in one.  A script orders, cancels,
redirects, kills a robot, admits it, stops the fleet, lets it go on and ends it, at 1440x900 and
390x844, and writes pictures.  Each command is timed from the click to what the coordinator has made
of it on the page, by the page's own clock; an order is seen when it is answered or listed.  A robot
is to be admitted once it is heard and knows the time; it is admitted when it has its next course.
A simulated robot is killed by its script, which is timed in the fleet's seconds, and started again
after a while.

`python -m benchmarks.desk_page watch ADDRESS SECONDS` looks at a page that nobody touches: bytes a
second to it, share of a core that the browser takes, its memory after a collection of garbage.
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
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
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
_WRITTEN_S: Final = 20.0
_COMMAND: Final = (sys.executable, "-m", "splinefleet")
_WATCH: Final = """((button, shown, limit) => {
  const told = () => ["answer", "orders", "phase", "alarms"]
    .map((id) => document.getElementById(id).textContent).join("\\n");
  const orders = () => [...document.querySelectorAll("#orders li:not([hidden]) .id")]
    .map((one) => one.textContent).filter((id) => id.startsWith("order-"));
  const before = orders();
  const seen = () => shown(told(), orders().some((id) => !before.includes(id)));
  window.seen = new Promise((resolve) => document.addEventListener("click", async (event) => {
    window.hit = Boolean(event.target.closest(button));
    if (!window.hit) return;
    const begin = performance.now();
    while (!seen() && performance.now() - begin < limit) {
      await new Promise((next) => setTimeout(next, 10));
    }
    resolve(seen() ? (performance.now() - begin) / 1000 : null);
  }, { once: true, capture: true }));
})"""
_LOST: Final = """(() => {
  const alarms = document.getElementById("alarms");
  new MutationObserver(() => {
    if (alarms.textContent.includes("%s is not heard")) window.lost ??= splinefleet.fleetTime;
  }).observe(alarms, { childList: true, subtree: true });
})()"""
_ANSWER: Final = "document.getElementById('answer').textContent"
_STATES: Final = "splinefleet.at(splinefleet.time)"
_NO_ACTS: Final = ("robots", "screen", "errors", "in the log")
_KILLED_S: Final = 20
"""When [s since GO] a simulated robot is killed."""
_AWAY_S: Final = 10
"""How long [s] it is away."""
_SAID: Final = Counter({"Order": 4, "Cancel": 1, "Tell": 3, "Admit": 1})
"""How many messages the script's commands make at least."""


class Fleet:
    """A running fleet with its desk; `agents` are its robots' processes, if they have any."""

    def __init__(
        self,
        address: str,
        log: Path,
        agents: dict[str, Process],
        start: Callable[..., Process] | None = None,
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
            fault = f"restart:{scenario.robots[-1].id}@{_KILLED_S}:{_AWAY_S}"
            options = ("--box-rate", "1", "--out", str(log.parent), "--fault", fault)
            yield Fleet(_address(start("simulate", str(file), *page, *options)), log, {})
            return
        log = folder / "run.mcap"
        options = ("--listen", endpoint, "--log", str(log), "--stay", "--json")
        address = _address(start("coordinator", str(file), *page, *options))

        def agent(name: str, *place: str) -> Process:
            return start("agent", name, "--connect", endpoint, "--quiet", *place)

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

    def act(what: str, button: str, shown: str, limit: float = 20.0) -> None:
        box = f"[...document.querySelectorAll('{button}')].at(-1)"
        tab.wait(box)
        for _ in range(3):  # An alarm that comes at the same moment moves the button.
            tab.run(f"{_WATCH}('{button}', (text, listed) => {shown}, {1000 * limit})")
            _click(tab, box)
            if tab.run("window.hit"):
                break
        took = tab.run("window.seen")
        seen[what] = "never" if took is None else round(took, 2)
        tab.picture(pictures.with_name(f"{pictures.name}-{what}.png"))

    robots = tab.run(f"Object.keys({_STATES})")
    for number, name in enumerate(robots[:3], start=1):
        _choose_place(tab, name, 0.2 * number + 0.1)
        tab.picture(pictures.with_name(f"{pictures.name}-before-{number}.png"))
        act(f"order {number}", "#order-send", _ordered(name))
    first, second = robots[0], robots[1]
    _choose_place(tab, robots[2], 0.1)  # The orders before may be done on a small floor.
    _click(tab, "document.querySelector('#order-send')")
    act("cancel", "#orders li:not([hidden]) .cancel:not([hidden])", "/cancelled/.test(text)")
    _choose_place(tab, second, 0.6, at_once=True)
    act("redirect", "#order-send", _ordered(second))
    act("STOP", "#stop", "/told to stop/.test(text)")
    act("go on", "#go-on:not([hidden])", "/, go/.test(text)")
    dead = first if fleet.start is not None else robots[-1]
    lost = f"document.body.innerText.includes('{dead} is not heard')"
    if fleet.start is not None:
        fleet.agents[dead].send_signal(signal.SIGKILL)
        began = time.monotonic()
        tab.wait(lost, 30.0)
        seen["killed"] = round(time.monotonic() - began, 2)
    else:
        tab.wait("window.lost !== undefined", _PATIENCE_S)
        seen["killed"] = round(tab.run("window.lost") - _KILLED_S, 2)
    tab.picture(pictures.with_name(f"{pictures.name}-killed.png"))
    if fleet.start is not None:
        place = f"(({{ x, y, heading }}) => [x, y, heading])({_STATES}.{dead})"
        fleet.agents[dead] = fleet.start(dead, "--at", *map(str, tab.run(place)))
    _wait_for_robot(fleet, dead)
    tab.wait(f"!{lost}")  # The page is laid out anew when one alarm is over and the next one comes.
    tab.wait(f"document.body.innerText.includes('{dead} is back')", _PATIENCE_S)
    tab.settle()
    tab.run(f"document.getElementById('order-robot').value = '{dead}'")
    tab.run("document.getElementById('order-robot').dispatchEvent(new Event('change'))")
    act("admit", "[data-act=admit]:not([disabled])", f"/{dead} goes|, GO$/.test({_ANSWER})", 30.0)
    tab.run("window.confirm = () => true")
    act("end", "#end-mission", "/the fleet ends/.test(text)")
    return seen


def _wait_for_robot(fleet: Fleet, name: str) -> None:
    """Wait until a robot that was started again is heard and knows the time."""
    end = time.monotonic() + _PATIENCE_S
    while time.monotonic() < end:
        with urllib.request.urlopen(f"{fleet.address}api/fleet") as answer:
            robots = {one["id"]: one for one in json.load(answer)["robots"]}
        if robots[name]["is_heard"] and not robots[name]["fault"]:
            return
        time.sleep(0.1)
    raise TimeoutError(name)


def _ordered(robot: str) -> str:
    """Return when an order for a robot is seen."""
    return f"listed || /{robot}, (under way|waiting)/.test(text)"


def _click(tab: Tab, box: str, across: float = 0.5, down: float = 0.5) -> None:
    """Click an element, at this share of its width and height."""
    tab.run(f"{box}.scrollIntoView({{ block: 'center' }})")
    left, top, width, height = tab.run(
        "(({left, top, width, height}) => [left, top, width, height])"
        f"({box}.getBoundingClientRect())"
    )
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        tab.point(left + across * width, top + down * height, kind)


def _choose_place(tab: Tab, robot: str, share: float, *, at_once: bool = False) -> None:
    """Click the floor near a place until the page says when a robot would be there."""
    outlook = "document.getElementById('outlook').textContent"
    for shift in range(10):
        place = share + 0.02 * shift
        if tab.run("document.getElementById('order-robot').value") != robot:
            tab.run(f"splinefleet.choose(Object.keys(splinefleet.at(0)).indexOf('{robot}'))")
        tab.run(f"document.getElementById('order-now').checked = {str(at_once).lower()}")
        tab.run("document.getElementById('outlook').textContent = ''")
        _click(tab, "document.getElementById('floor')", place, place)
        if tab.run("document.getElementById('order-place').value === ''"):
            continue  # There is a robot, which was chosen.
        tab.wait(f"{outlook} !== ''", _PATIENCE_S)
        if tab.run(f"{outlook}.includes('would be there')"):
            return
    raise RuntimeError(f"there is no place for {robot}")


def _logged(log: Path) -> Row:
    """Return how many of the operators' messages a log holds; waits until it has all of them."""
    end = time.monotonic() + _WRITTEN_S
    while _SAID - (found := _said(log)) and time.monotonic() < end:
        time.sleep(1.0)
    return {"in the log": " ".join(f"{name}:{count}" for name, count in sorted(found.items()))}


def _said(log: Path) -> Counter[str]:
    found: Counter[str] = Counter()
    for record in read_log(log).records:
        place = keys.split(record.key)
        message = None if place is None else decode(place[1], record.payload)
        if isinstance(message, Order | Cancel | Tell | Admit) and message.by:
            found[type(message).__name__] += 1
    return found


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
            tab.call("HeapProfiler.collectGarbage")
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


def _summary(rows: list[Row], what: str) -> Row:
    """Return the median and the greatest time [s] of an action, and how often it was not seen."""
    times = [row[what] for row in rows if isinstance(row[what], float)]
    never = sum(row[what] == "never" for row in rows)
    told = {"median": median(times), "most": max(times)} if times else {}
    return {"action": what, **told, "never": never}


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
        rows = []
        for count in asked.robots:
            for row in commanded(count, asked.o, asked.processes):
                show("from the click to what is seen [s]", [row])
                rows.append(row)
        acts = [name for name in rows[0] if name not in _NO_ACTS]
        show("all of these", [_summary(rows, act) for act in acts])
