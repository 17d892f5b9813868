"""Runs the examination of a robot on a real link and clock.

Decides: when the examiner is called.  Must not know: what is tried, or how it is judged.
"""

from __future__ import annotations

import csv
import queue
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Final

from coordinator.base.errors import InputError
from coordinator.conformance.examiner import Examiner
from coordinator.conformance.track import Row
from protocol import keys
from protocol.host_clock import host_clock_ns
from protocol.transport import Transport

_PERIOD_S: Final = 0.005


def examine(
    examiner: Examiner,
    fleet: str,
    transport: Transport,
    tell: Callable[[str], None],
    clock: Callable[[], int] = host_clock_ns,
) -> None:
    """Examine a robot until nothing is left to try; `tell` is called with each step in words."""
    events: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()

    def hear(key: str, payload: bytes, _sent_ns: int | None) -> None:
        events.put(partial(examiner.hear, key, payload, clock()))

    def link_changed(key: str, alive: bool) -> None:
        events.put(partial(examiner.hear_alive, key, alive))

    for kind in (keys.hello, keys.report, keys.clock):
        transport.subscribe(kind(fleet, "*"), hear)
    transport.watch_alive(keys.alive(fleet, "*"), link_changed)
    told = ""
    while not examiner.is_over:
        with suppress(queue.Empty):
            events.get(timeout=_PERIOD_S)()
        for key, payload in examiner.tick(clock()):
            transport.put(key, payload)
        if (step := examiner.exam.asks_person or examiner.now) != told:
            told = step
            tell(step)


def read_box(path: Path) -> list[Row]:
    """Return the rows of a black box; raises InputError if there is none."""
    try:
        with path.open(encoding="ascii", newline="") as file:
            rows = csv.DictReader(file)
            return [(float(row["t"]), float(row["x"]), float(row["y"])) for row in rows]
    except OSError as error:
        raise InputError([f"{path}: {error.strerror}"]) from None
    except (KeyError, TypeError, ValueError):
        raise InputError([f"{path}: no black box: it needs columns t, x and y"]) from None
