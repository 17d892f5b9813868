"""Compile the planner's kernels: at set-up, which runs this module, or else on first use.

numba compiles in one thread at a time.  So several processes compile parts of the kernels into the
same cache folder at once, and a last process compiles what is left.  This process shows progress.

Decides: which processes compile, and what the user sees meanwhile.  Must not know: what kernels
compute.
"""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from coordinator.base.console import errors, tell
from coordinator.base.interrupts import INTERRUPTED
from coordinator.base.kernel_cache import count_kernels, is_filled, places, writable_place
from coordinator.planning.warm import PARTS, compile_rest, load_kernels

_ROOT: Final = Path(__file__).parents[2]
_WARM: Final = (sys.executable, "-m", "coordinator.planning.warm")
_LOOK_S: Final = 0.5
"""The time between two counts of the compiled kernels [s]."""


@functools.cache
def get_kernels_ready() -> None:
    """Load the kernels; if they have to be compiled first, say so and compile all of them."""
    if not is_filled():
        tell(f"compiling the planner's kernels, {_how_often()}; this takes about a minute")
        if writable_place() is not None and (os.cpu_count() or 1) > 1:
            _compile_in_processes()
        compile_rest()
    load_kernels()


def _how_often() -> str:
    """Return words that say whether the kernels have to be compiled again next time, and why."""
    if writable_place() is not None:
        return "once"
    return f"for this process alone, as {' and '.join(map(str, places()))} cannot be written"


def _compile_in_processes() -> None:
    """Compile all kernels into the cache folder.

    If a process fails, the caller has to compile the kernels that are missing.
    """
    with _progress() as look:
        for commands in ([[*_WARM, part] for part in PARTS], [_WARM]):
            _run(commands, look)


def _run(commands: Sequence[Sequence[str]], look: Callable[[], None]) -> None:
    """Run as many commands at once as there are processors; call `look` until all have ended.

    Those that begin later load what earlier ones have compiled.
    """
    quiet = subprocess.DEVNULL
    running: list[subprocess.Popen[bytes]] = []
    waiting = list(commands)
    try:
        while waiting or running:
            running = [process for process in running if process.poll() is None]
            while waiting and len(running) < (os.cpu_count() or 1):
                command = waiting.pop(0)
                running.append(
                    subprocess.Popen(command, cwd=_ROOT, stdin=quiet, stdout=quiet, stderr=quiet)
                )
            time.sleep(_LOOK_S)
            look()
    finally:
        for process in running:
            process.kill()
            process.wait()


@contextmanager
def _progress() -> Iterator[Callable[[], None]]:
    """Show on a terminal how many kernels are compiled; yield a function that updates the count."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
    )

    columns = (TextColumn("kernels"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=errors, disable=not errors.is_terminal) as bar:
        task = bar.add_task("kernels")

        def look() -> None:
            kept, known = count_kernels()
            bar.update(task, completed=kept, total=known)

        yield look


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        get_kernels_ready()
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
