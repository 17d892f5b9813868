"""Output of commands: results go to stdout, everything else to stderr.

Decides: where text goes.  Must not know: what the text says.
"""

from __future__ import annotations

import sys
from pathlib import Path

import msgspec
from rich.console import Console

from coordinator.base.errors import InputError
from protocol.host_clock import time_of_day

errors = Console(stderr=True, soft_wrap=True, highlight=False, emoji=False)
answers = Console(soft_wrap=True, highlight=False, emoji=False)


def answer_json(value: object) -> None:
    """Write one JSON object on a separate line to stdout, at once."""
    sys.stdout.write(msgspec.json.encode(value).decode() + "\n")
    sys.stdout.flush()


def tell(text: str, style: str = "") -> None:
    """Write a line for people to stderr."""
    errors.print(text, style=style, markup=False)


def tell_now(text: str, style: str = "") -> None:
    """Write a line for people to stderr, with the time of day: for commands that run for long."""
    tell(f"{time_of_day()} {text}", style)


def write_file(path: Path, content: bytes) -> None:
    """Write a file; raises InputError with one line if the file cannot be written."""
    try:
        path.write_bytes(content)
    except OSError as error:
        raise InputError([f"{path}: {error.strerror}"]) from None
