"""A witness that tells when the machine let nobody run: a process that ought to wake often."""

import contextlib
import subprocess
import sys
import threading
import time

STALL_S = 0.03
"""Woken so much later than asked [s], a robot of 50 Hz would have missed its motors' watchdog."""

_WITNESS = f"""
import time
woken = time.monotonic()
while True:
    time.sleep(0.01)
    late = time.monotonic() - woken - 0.01
    woken += late + 0.01
    if late > {STALL_S}:
        print(woken, flush=True)
"""


class Stalls:
    """The moments, of the monotonic clock [s], at which the machine had stalled."""

    def __init__(self, process):
        self._seen = []
        self._process = process
        threading.Thread(target=self._read, daemon=True).start()

    def any_since(self, moment):
        return any(stall >= moment for stall in self._seen)

    def _read(self):
        for line in self._process.stdout:
            self._seen.append(float(line))


@contextlib.contextmanager
def witness():
    """Watch the machine."""
    command = [sys.executable, "-S", "-c", _WITNESS]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield Stalls(process)
        finally:
            process.kill()


def without_stalls(stalls, tries, work):
    """Return what work(number of the try) gives, once more while the machine stalled meanwhile."""
    for number in range(tries):
        began = time.monotonic()
        done = work(number)
        if not stalls.any_since(began):
            break
    return done
