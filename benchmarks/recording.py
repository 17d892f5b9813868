"""Recording many messages from Zenoh: how many are lost, CPU time and memory.

`python -m benchmarks recording` records for 10 s, `python -m benchmarks.recording SECONDS` for
SECONDS.  The messages come from a process of their own, which waits when the link is full.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import zenoh
from mcap.reader import make_reader

from benchmarks.machine import memory_mb
from benchmarks.table import ROOT, Row, show
from coordinator.log.listening import Listener, Recording
from coordinator.log.recorder import Recorder
from protocol import keys
from protocol.codec import encode
from protocol.messages import Report
from protocol.phases import MOVING
from protocol.zenoh_transport import ZenohTransport, use_few_threads
from sim.processes.local_fleet import free_port

FLEET: Final = "benchmark"
ROBOTS: Final = 100
FLOOD: Final = 20_000
TRAFFIC: Final = 620
"""Messages that 100 robots and their coordinator send in a second: 5 Reports each, a question about
the time and its answer every other second, 10 Commands."""

_BATCH_S: Final = 0.001
_TICK_S: Final = 0.01
_LOOK_S: Final = 0.25
_PATIENCE_S: Final = 30.0


def recording(seconds: float = 10.0) -> list[Row]:
    """Record a flood, then the traffic of 100 robots; return CPU and memory of the recorder.

    CPU is the share of one core over all its threads; "ours" is that of the threads of Python, the
    rest is Zenoh's.  The growth of memory is measured after a quarter of the time.  The flood comes
    to the recorder directly; the robots' traffic goes through another process, as beside a
    coordinator.
    """
    use_few_threads()
    return [_recorded(FLOOD, seconds), _recorded(TRAFFIC, seconds, beside=True)]


def writing(seconds: float = 10.0) -> list[Row]:
    """Let the recorder alone write the traffic of 100 robots, as it does beside the fleet core.

    CPU is the share of one core, including the making of the messages.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        with Recorder(path, metadata={"fleet": FLEET}, wall_offset_ns=0) as recorder:
            began, spent, done = time.monotonic(), time.process_time(), 0
            while (passed := time.monotonic() - began) < seconds:
                for number in range(done, round(passed * TRAFFIC)):
                    payload = encode(Report(1, number, 1, MOVING))
                    recorder.record(keys.report(FLEET, f"R{number % ROBOTS}"), payload, number)
                    done = number + 1
                time.sleep(_TICK_S)
            spent = time.process_time() - spent
    return [{"messages/s": round(done / passed), "CPU %": 100.0 * spent / passed}]


def _recorded(rate: int, seconds: float, *, beside: bool = False) -> Row:
    """Record `rate` messages a second; return how many were lost, CPU and memory."""
    endpoint, sent = f"tcp/127.0.0.1:{free_port()}", round(rate * seconds)
    with ExitStack() as stack:
        path = Path(stack.enter_context(TemporaryDirectory())) / "run.mcap"
        recording = Recording(path)
        if beside:
            stack.enter_context(_router(endpoint))
        opened = (
            ZenohTransport.connect(endpoint, 20.0) if beside else ZenohTransport.listen(endpoint)
        )
        with opened as transport:
            recording.begin(transport, FLEET)
            assert recording.listener is not None
            measured = _listen(recording.listener, endpoint, rate, sent)
        recording.close()
        with path.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        kept = summary.statistics.message_count
        size = path.stat().st_size
    return {**measured, "lost": sent - kept, "bytes a message": size / max(kept, 1)}


@contextmanager
def _router(endpoint: str) -> Iterator[None]:
    """Run another process that routes, as a coordinator does, while the block runs."""
    process = subprocess.Popen([sys.executable, "-m", "benchmarks.recording", endpoint], cwd=ROOT)
    try:
        yield
    finally:
        process.kill()
        process.wait()


def _listen(listener: Listener, endpoint: str, rate: int, sent: int) -> Row:
    """Let another process send; measure this one meanwhile."""
    sizes: list[float] = []
    publisher = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.recording", endpoint, str(rate), str(sent)], cwd=ROOT
    )
    try:
        _wait_for(lambda: listener.messages > 0)
        began, spent, ours = time.monotonic(), time.process_time(), _python_s()
        while listener.messages < sent and publisher.poll() is None:
            sizes.append(memory_mb(os.getpid()))
            time.sleep(_LOOK_S)
        passed, spent = time.monotonic() - began, time.process_time() - spent
        ours = _python_s() - ours
        publisher.wait(_PATIENCE_S)
        _wait_for(lambda: listener.messages >= sent, at_most=2.0)
    finally:
        publisher.kill()
        publisher.wait()
    settled = sizes[len(sizes) // 4 :]
    return {
        "messages/s": round(listener.messages / passed),
        "seconds": passed,
        "sent": sent,
        "heard": listener.messages,
        "CPU %": 100.0 * spent / passed,
        "ours %": 100.0 * ours / passed,
        "memory MB": settled[0],
        "growth MB": max(settled) - settled[0],
    }


def publish(endpoint: str, rate: int, count: int) -> None:
    """Put `count` messages at a rate, in the names of 100 robots in turn, without drops."""
    config = zenoh.Config()
    for name, value in (
        ("mode", "client"),
        ("connect/endpoints", [endpoint]),
        ("scouting/multicast/enabled", False),
        ("transport/shared_memory/enabled", False),
    ):
        config.insert_json5(name, json.dumps(value))
    with zenoh.open(config) as session:
        publishers = [
            session.declare_publisher(
                keys.report(FLEET, f"R{i}"),
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
            for i in range(ROBOTS)
        ]
        began, done = time.monotonic(), 0
        while done < count:
            due = min(round((time.monotonic() - began) * rate), count)
            for number in range(done, due):
                publishers[number % ROBOTS].put(encode(Report(1, number, 1, MOVING)))
            done = max(done, due)
            time.sleep(_BATCH_S)


def _wait_for(state: Callable[[], bool], at_most: float = _PATIENCE_S) -> None:
    deadline = time.monotonic() + at_most
    while not state() and time.monotonic() < deadline:
        time.sleep(0.01)


def _python_s() -> float:
    """Return the CPU time [s] of the threads of this process that run Python."""
    ticks = 0
    for task in Path("/proc/self/task").iterdir():
        name, _, rest = (task / "stat").read_text().partition("(")[2].rpartition(")")
        if name.startswith("python"):
            ticks += sum(int(number) for number in rest.split()[11:13])
    return ticks / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Measure and print; given an endpoint, route there; given also a rate and a count, send."""
    if len(sys.argv) == 4:
        publish(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    elif sys.argv[1:] and sys.argv[1].startswith("tcp/"):
        with ZenohTransport.listen(sys.argv[1]):
            threading.Event().wait()
    else:
        seconds = [float(text) for text in sys.argv[1:]]
        show("recording what arrives over Zenoh", recording(*seconds))
        show("the recorder alone", writing(*seconds))


if __name__ == "__main__":
    main()
