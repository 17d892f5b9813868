"""A log's traffic played again: which messages, under which keys, and when.

Decides: what of a log was traffic, and what key patterns mean.  Must not know: links and clocks;
`play` is given both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from typing import NamedTuple

from coordinator.log.records import Log
from protocol import keys

_RECORDS = "coordinator/"
"""Keys on which a log keeps what the coordinator did; nothing of it ever travelled."""


class Wish(NamedTuple):
    """What to play: times in s from the log's first message, a key pattern, a prefix for keys."""

    since: float = 0.0
    until: float = math.inf
    pattern: str = "**"
    prefix: str = ""


EVERYTHING = Wish()


class Cue(NamedTuple):
    """A message to be put on a key so many seconds after the beginning."""

    due: float
    key: str
    payload: bytes


def cues(log: Log, wish: Wish = EVERYTHING) -> list[Cue]:
    """Return what is to be put, in the order of the log; ValueError when the pattern is none.

    The coordinator's own records and the news of links, which are no messages, are left out.
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
    """Put messages in time; returns how many.

    wait_until(seconds since the beginning) returns when that much time has passed.
    """
    count = 0
    for cue in found:
        wait_until(cue.due / speed)
        put(cue.key, cue.payload)
        count += 1
    return count


def key_filter(pattern: str) -> Callable[[str], bool]:
    """Return whether a key fits a pattern of Zenoh.

    `*` stands for one part of a key, `**` for any number of parts, `$*` for anything within a part.
    Raises ValueError when the pattern is malformed.
    """
    parts = pattern.split("/")
    known = re.compile(r"\*\*?|(?:[^*$#?]|\$\*)+")
    if not all(known.fullmatch(part) for part in parts):
        raise ValueError(f"{pattern!r} is no key pattern; one looks like splinefleet/*/report/**")
    expression = "".join(_expression(part) for part in parts)
    compiled = re.compile(expression, re.DOTALL)
    return lambda key: compiled.fullmatch("/" + key) is not None


def _expression(part: str) -> str:
    """Return the regular expression of a slash and one part of a pattern."""
    if part == "**":
        return "(?:/[^/]+)*"
    if part == "*":
        return "/[^/]+"
    return "/" + "[^/]*".join(re.escape(text) for text in part.split("$*"))


def _travelled(key: str) -> bool:
    """Tell whether a record was a message: something that was put on its key."""
    place = keys.split(key)
    return not key.startswith(_RECORDS) and (place is None or place[1] != "alive")
