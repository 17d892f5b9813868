"""Starting the real programs, and waiting for states with a deadline."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from sim.processes.local_fleet import free_port

ROOT = Path(__file__).resolve().parents[2]
COMMAND = (sys.executable, "-m", "splinefleet")

TWO_ROBOTS = """
name = "two"
tau = 0.6
margin = 0.05
[workspace]
bounds = [0.0, 0.0, 4.0, 4.0]
[[robots]]
id = "R1"
start = [0.6, 2.0]
goal = [3.4, 2.0]
radius = 0.15
max_speed = 0.6
[[robots]]
id = "R2"
start = [2.0, 0.6]
goal = [2.0, 3.4]
radius = 0.15
max_speed = 0.5
"""


def splinefleet(*arguments, timeout=60.0):
    """Run a command to its end and return it, output as text."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def started(*arguments):
    """Start a command of splinefleet as `running` does."""
    return running(*COMMAND, *map(str, arguments))


@contextlib.contextmanager
def running(*command):
    """Start a command in a process group of its own; whatever of it is left is killed."""
    process = subprocess.Popen(
        command,
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()
        process.stderr.close()


def wait_for(state, seconds=20.0):
    """Return what `state()` returns as soon as it is true; fail after the deadline."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        found = state()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError(f"not reached within {seconds} s: {state.__doc__ or state}")


def line_with(process, text, seconds=20.0, stream="stdout"):
    """Read the process's stdout (or stderr) up to a line that holds the text; return that line.

    A process that says nothing of it within the deadline is killed.
    """
    late = threading.Timer(seconds, process.kill)
    late.start()
    try:
        for line in getattr(process, stream):
            if text in line:
                return line
    finally:
        late.cancel()
    raise AssertionError(f"did not say {text!r} within {seconds} s: {process.stderr.read()}")


def free_endpoint():
    """Return a loopback endpoint that nobody listens on."""
    return f"tcp/127.0.0.1:{free_port()}"


def processes_of(folder):
    """Return the ids of processes whose command line names the folder."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            with contextlib.suppress(OSError):
                if str(folder).encode() in (entry / "cmdline").read_bytes():
                    found.append(int(entry.name))
    return found
