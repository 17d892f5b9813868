"""What a fuzz target is.

Decides: what counts as an answer to bad input.  Must not know: the readers.
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
"""Bytes of an input, unless a target says otherwise."""


class Target(NamedTuple):
    """`attempt` takes any bytes and raises nothing; whatever it raises is a crash.

    `seeds` returns inputs to begin with, most of them good ones.  `mutate` makes another input of
    one, by a seed; libFuzzer's own ways are used as well.
    """

    attempt: Callable[[bytes], None]
    seeds: Callable[[], Iterable[bytes]]
    longest: int = LONGEST
    mutate: Callable[[bytes, int], bytes] | None = None


def answered(read: Callable[[bytes], None]) -> Callable[[bytes], None]:
    """Return a reader whose one-line answers to bad input count as answers."""

    @wraps(read)
    def attempt(data: bytes) -> None:
        with suppress(InputError, PlanError):
            read(data)

    return attempt


def workshop() -> Path:
    """Return a new folder for files that readers want to open."""
    folder = mkdtemp(prefix="splinefleet-fuzz-")
    atexit.register(rmtree, folder, ignore_errors=True)
    return Path(folder)
