"""A witness that tells when the machine let nobody run: a process that ought to wake often.

This process is watched by a thread as well: the relays that cut robots off run in it, and what
another test holds its interpreter up with (a collection of garbage, code that is compiled) no
other process sees.
"""

import contextlib
import subprocess
import sys
import threading
import time

STALL_S = 0.03
"""Woken so much later than asked [s], a robot of 50 Hz would have missed its motors' watchdog."""

HELD_UP_S = 0.15
"""A relay that is held up for so long [s] cuts its robot off for longer than was asked."""

_PERIOD_S = 0.01

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
        self._over = threading.Event()
        threading.Thread(target=self._read, daemon=True).start()
        threading.Thread(target=self._watch_here, daemon=True).start()

    def any_since(self, moment):
        return any(stall >= moment for stall in self._seen)

    def close(self):
        self._over.set()
        self._process.kill()

    def _watch_here(self):
        woken = time.monotonic()
        while not self._over.wait(_PERIOD_S):
            before, woken = woken, time.monotonic()
            if woken - before - _PERIOD_S > HELD_UP_S:
                self._seen.append(woken)

    def _read(self):
        for line in self._process.stdout:
            self._seen.append(float(line))


@contextlib.contextmanager
def witness():
    """Watch the machine."""
    command = [sys.executable, "-S", "-c", _WITNESS]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        stalls = Stalls(process)
        try:
            yield stalls
        finally:
            stalls.close()


def without_stalls(stalls, tries, work):
    """Return what work(number of the try) gives, once more while the machine stalled meanwhile."""
    for number in range(tries):
        began = time.monotonic()
        done = work(number)
        if not stalls.any_since(began):
            break
    return done
