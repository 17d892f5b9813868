"""The operator's desk under load: commands at a rate, and requests that make no sense.

`python -m benchmarks desk` drives four robots with a coordinator and its desk, all real processes:
on a quiet desk, with 200 commands a second, and with malformed HTTP and JSON.  `python -m
benchmarks.desk MINUTES` sends nonsense for so long.  How late Commands are is taken from the
coordinator's log: the time between two of them, beyond the period.
"""

from __future__ import annotations

import contextlib
import http.client
import itertools
import json
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from benchmarks.flood import ended
from benchmarks.lanes import lanes
from benchmarks.machine import memory_mb
from benchmarks.table import Row
from coordinator.log.log_file import read_log
from coordinator.scenario_files.scenario_reader import scenario_to_json
from protocol import keys
from protocol.timing import COMMAND_PERIOD, MILLISECOND
from sim.processes.local_fleet import free_port

FLEET: Final = "asked"
ROBOTS: Final = 4
RATE: Final = 200
_SECONDS: Final = 20.0
_TALKERS: Final = 100
_PATIENCE_S: Final = 60.0
_LATE: Final = 0.2
"""On a busy machine robots may be late at the end by this share of their drive."""

_COMMAND: Final = (sys.executable, "-m", "splinefleet")
_PATHS: Final = ("", "api/fleet", "api/orders", "api/blocks", "api/freeze", "api/robots/R1/join")
Talk = Callable[[str, int, float, Counter[str]], None]


def desk(seconds: float = _SECONDS) -> list[Row]:
    """Return a row of figures for a quiet desk, one that is asked much, and one asked nonsense."""
    return [
        _beside("quiet", lambda *_: None, seconds),
        _beside(f"{RATE} commands/s", _command, seconds),
        _beside("nonsense", _babble, seconds),
    ]


def _beside(what: str, talk: Talk, seconds: float) -> Row:
    """Drive the fleet for so long while `talk` talks to its desk; return the figures."""
    with TemporaryDirectory() as name, ended() as processes:
        folder, endpoint = Path(name), f"tcp/127.0.0.1:{free_port()}"
        (folder / "lanes.json").write_bytes(scenario_to_json(lanes(ROBOTS, seconds, FLEET)))

        def start(*arguments: str) -> subprocess.Popen[str]:
            processes.append(
                subprocess.Popen([*_COMMAND, *arguments], stdout=subprocess.PIPE, text=True)
            )
            return processes[-1]

        coordinator = start(
            *("coordinator", str(folder / "lanes.json"), f"--listen={endpoint}", "--stay"),
            *(f"--log={folder / 'run.mcap'}", "--page=127.0.0.1:0", "--effort=0", "--json"),
        )
        assert coordinator.stdout is not None
        address = next(json.loads(line)["address"] for line in coordinator.stdout if "http" in line)
        threading.Thread(target=coordinator.stdout.read, daemon=True).start()
        place = address.removeprefix("http://").rstrip("/")
        for number in range(ROBOTS):
            start("agent", f"R{number + 1}", f"--connect={endpoint}", "--quiet")
        _wait_for(lambda: _asked(place, "GET", "api/fleet")[1]["phase"] == "go")
        before, answers = memory_mb(coordinator.pid), Counter[str]()
        until = time.monotonic() + seconds
        talkers = [
            threading.Thread(target=talk, args=(place, number, until, answers))
            for number in range(_TALKERS)
        ]
        began = time.monotonic()
        for one in talkers:
            one.start()
        for one in talkers:
            one.join()
        time.sleep(max(until - time.monotonic(), 0.0))
        took = time.monotonic() - began
        for order in _asked(place, "GET", "api/orders")[1] or []:
            if order["state"] in ("waiting", "under way"):
                _asked(place, "DELETE", f"api/orders/{order['id']}")
        _asked(place, "POST", "api/resume")  # Nonsense may have stopped the fleet.
        asked = time.monotonic()
        status, _ = _asked(place, "POST", "api/end")
        answered = time.monotonic() - asked
        memory = memory_mb(coordinator.pid)
        try:
            patience = _PATIENCE_S + min(_LATE * seconds, _PATIENCE_S)
            _wait_for(lambda: coordinator.poll() is not None, patience)
        except TimeoutError:  # Robots that nonsense has stopped have far to go.
            coordinator.send_signal(signal.SIGINT)
            _wait_for(lambda: coordinator.poll() is not None)
        gaps = _gaps(folder / "run.mcap")
    late = sorted(gap - COMMAND_PERIOD for gap in gaps)
    return {
        "desk": what,
        "asked/s": round(sum(answers.values()) / took),
        "answers": " ".join(f"{name}:{count}" for name, count in sorted(answers.items())),
        "Commands": len(late),
        "late 99 % ms": round(late[int(0.99 * (len(late) - 1))] / MILLISECOND, 1),
        "most ms": round(late[-1] / MILLISECOND, 1),
        "growth MB": round(memory - before, 1),
        "end": status,
        "in ms": round(1000.0 * answered),
        "exit": coordinator.returncode,
    }


def _command(place: str, number: int, until: float, answers: Counter[str]) -> None:
    """Give and take back orders, at this talker's share of the rate."""
    for turn in itertools.count():
        due = time.monotonic() + _TALKERS / RATE
        if due > until:
            return
        name = f"o-{number}-{turn // 2}"
        if turn % 2:
            status, _ = _asked(place, "DELETE", f"api/orders/{name}")
        else:
            goal = {"goal": [1.0 + 0.1 * number, 1.0], "id": name, "release": 3600.0}
            status, _ = _asked(place, "POST", "api/orders", json.dumps(goal).encode())
        answers[str(status)] += 1
        time.sleep(max(due - time.monotonic(), 0.0))


def _babble(place: str, number: int, until: float, answers: Counter[str]) -> None:
    """Send bytes that are no request, and requests whose parts make no sense."""
    dice = random.Random(number)
    while time.monotonic() < until:
        if dice.random() < 0.5:
            answers[_raw(place, _bytes(dice))] += 1
        else:
            path = dice.choice(_PATHS) + dice.choice(("", "/", "/%ff", "/" + "x" * 300, "?a=%00"))
            method = dice.choice(("GET", "POST", "DELETE", "PUT", "OPTIONS"))
            status, _ = _asked(place, method, path, _body(dice))
            answers[str(status)] += 1


def _body(dice: random.Random) -> bytes:
    sound: dict[str, object] = {"goal": [1.0, 1.0], "robot": "R1", "at": [1, 1, 0]}
    sound["polygon"] = [[0, 0], [1, 0], [1, 1]]
    odd: tuple[object, ...] = (None, -1, 1e308, "x" * 500, [], {}, [[[]]], True, "NaN")
    match dice.randrange(5):
        case 0:
            return dice.randbytes(dice.randrange(2_000))
        case 1:
            return b"[" * dice.randrange(50_000)
        case 2:
            return json.dumps({dice.choice([*sound, "\x00", "now"]): dice.choice(odd)}).encode()
        case 3:
            return json.dumps(sound | {dice.choice([*sound]): dice.choice(odd)}).encode()
    return json.dumps(sound).encode()[: dice.randrange(60)]


def _bytes(dice: random.Random) -> bytes:
    head = dice.choice((b"GET / HTTP/1.1\r\n", b"POST /api/orders HTTP/1.1\r\n", b"", b"GET "))
    more = dice.choice((b"", b"Host: x\r\n", b"Content-Length: 99999999\r\n\r\n", b"\r\n\r\n"))
    return head + more + dice.randbytes(dice.randrange(1_000))


def _raw(place: str, data: bytes) -> str:
    """Send bytes; return the status of the answer, or what else came of it."""
    host, port = place.split(":")
    try:
        with socket.create_connection((host, int(port)), 2.0) as link:
            link.sendall(data)
            link.shutdown(socket.SHUT_WR)
            answer = link.recv(20).split()
    except OSError:
        return "closed"
    return answer[1].decode() if len(answer) > 1 else "closed"


def _asked(place: str, method: str, path: str, body: bytes = b"") -> tuple[int, Any]:
    """Ask the desk; return the status and the answer, 0 if there was none."""
    link = http.client.HTTPConnection(place, timeout=30.0)
    try:
        link.request(method, f"/{path}", body or None, {"Content-Type": "application/json"})
        answer = link.getresponse()
        data = answer.read()
        is_json = "json" in (answer.getheader("Content-Type") or "")
        return answer.status, json.loads(data) if is_json else {}
    except (OSError, http.client.HTTPException):
        return 0, {}
    finally:
        link.close()


def _gaps(log: Path) -> list[int]:
    """Return the times [ns] between two Commands, but for the last ones of the end."""
    times = [one.log_ns for one in read_log(log).records if one.key == keys.command(FLEET)]
    return [after - before for before, after in pairwise(times)][:-2]


def _wait_for(state: Callable[[], bool], patience: float = _PATIENCE_S) -> None:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        with contextlib.suppress(KeyError):
            if state():
                return
        time.sleep(0.05)
    raise TimeoutError


if __name__ == "__main__":
    from benchmarks.table import show

    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
    show("nonsense", [_beside("nonsense", _babble, 60.0 * minutes)])
