"""Play a log's traffic again: which messages, under which keys, and when.

Decides: which records of a log were traffic, and what key patterns mean.  Must not know: links and
clocks, which `play` gets as functions.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from typing import NamedTuple

from coordinator.log.records import Log
from protocol import keys

_RECORDS = "coordinator/"
"""The prefix of the coordinator's own records, which were never sent."""


class Wish(NamedTuple):
    """What to play: times [s] from the log's first message, a key pattern, a prefix for keys."""

    since: float = 0.0
    until: float = math.inf
    pattern: str = "**"
    prefix: str = ""


EVERYTHING = Wish()


class Cue(NamedTuple):
    """A message to put on a key `due` seconds after the beginning."""

    due: float
    key: str
    payload: bytes


def cues(log: Log, wish: Wish = EVERYTHING) -> list[Cue]:
    """Return the messages to put, in the order of the log.

    The coordinator's own records and news of links are left out, because they were not messages.
    Raises ValueError if the pattern is malformed.
    """
    fits = key_filter(wish.pattern)
    prefix = f"{wish.prefix}/" if wish.prefix else ""
    begin_ns = log.records[0].log_ns if log.records else 0
    found = []
    for record in log.records:
        seconds = (record.log_ns - begin_ns) / 1e9
        if not wish.since <= seconds <= wish.until or not fits(record.key):
            continue
        if _travelled(record.key):
            found.append(Cue(seconds - wish.since, prefix + record.key, record.payload))
    return found


def play(
    found: Iterable[Cue],
    put: Callable[[str, bytes], None],
    wait_until: Callable[[float], None],
    speed: float = 1.0,
) -> int:
    """Put each message when it is due; return their number.

    `wait_until` gets a time in seconds since the beginning, and returns when it has passed.
    """
    count = 0
    for cue in found:
        wait_until(cue.due / speed)
        put(cue.key, cue.payload)
        count += 1
    return count


def key_filter(pattern: str) -> Callable[[str], bool]:
    """Return a function that returns whether a key matches a key pattern of Zenoh.

    `*` matches one part of a key, `**` any number of parts, `$*` anything within a part.
    Raises ValueError when the pattern is malformed.
    """
    parts = pattern.split("/")
    known = re.compile(r"\*\*?|(?:[^*$#?]|\$\*)+")
    if not all(known.fullmatch(part) for part in parts):
        raise ValueError(f"{pattern!r} is not a key pattern, such as splinefleet/*/report/**")
    expression = "".join(_expression(part) for part in parts)
    compiled = re.compile(expression, re.DOTALL)
    return lambda key: compiled.fullmatch("/" + key) is not None


def _expression(part: str) -> str:
    """Return the regular expression for a slash and one part of a pattern."""
    if part == "**":
        return "(?:/[^/]+)*"
    if part == "*":
        return "/[^/]+"
    return "/" + "[^/]*".join(re.escape(text) for text in part.split("$*"))


def _travelled(key: str) -> bool:
    """Return whether a record was a message, that is, was put on its key."""
    place = keys.split(key)
    return not key.startswith(_RECORDS) and (place is None or place[1] != "alive")
