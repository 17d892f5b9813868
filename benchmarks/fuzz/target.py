"""The interface of a fuzz target.

Decides: what counts as a proper error for bad input.  Must not know: the readers.
"""

from __future__ import annotations

import atexit
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import wraps
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Final, NamedTuple

from coordinator.base.errors import InputError, PlanError

LONGEST: Final = 65_536
"""The greatest length of an input [bytes], unless a target has another."""


class Target(NamedTuple):
    """A reader to be fuzzed: `attempt` takes any bytes; whatever it raises is a crash.

    `seeds` returns the first inputs, most of them valid.  `mutate` makes another input from one and
    a seed; libFuzzer's own mutations are used as well.
    """

    attempt: Callable[[bytes], None]
    seeds: Callable[[], Iterable[bytes]]
    longest: int = LONGEST
    mutate: Callable[[bytes, int], bytes] | None = None


def answered(read: Callable[[bytes], None]) -> Callable[[bytes], None]:
    """Return a reader that ignores the one-line errors for bad input."""

    @wraps(read)
    def attempt(data: bytes) -> None:
        with suppress(InputError, PlanError):
            read(data)

    return attempt


def workshop() -> Path:
    """Return a new folder for readers that need a file."""
    folder = mkdtemp(prefix="splinefleet-fuzz-")
    atexit.register(rmtree, folder, ignore_errors=True)
    return Path(folder)
