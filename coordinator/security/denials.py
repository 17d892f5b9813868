"""Who was refused, and why: read from Zenoh's own log, reported once and then counted.

Zenoh 1.10 states only in its log why a TLS link was refused, and what its access control refused to
whom.  It does not state from where a refused link came.  The access control also looks up
permissions in advance, for its cache, and then writes lines that look like refusals.  They can be
recognized by an earlier line from the same thread, which announces the look-up.

Decides: which lines of that log are refusals, and the words in which they are reported and
recorded.  Must not know: where the lines come from, links.
"""

from __future__ import annotations

import datetime
import re
from collections.abc import Callable, Iterable
from typing import Final

import msgspec

from protocol.badge import badge_of

LOG_FILTER: Final = (
    "error,zenoh_link_tls=warn,zenoh::net::routing::interceptor::access_control=trace"
)
"""The filter of Zenoh's log.

At this level the access control also logs what it allows; there is no level at which it logs
refusals alone."""

DULL: Final = b" is authorized to "

AGAIN_S: Final = 10.0
"""The least time between two reports of the same refusal [s]; each has the number of times."""

MOST: Final = 500
MOST_EACH: Final = 20
"""How many different refusals are counted separately: MOST in all, MOST_EACH for each party.

Further refusals are counted together, so that a flood of invented names or keys is harmless."""

_LONGEST: Final = 120
"""How many characters of a refused key are reported."""

_COLOURS: Final = re.compile(r"\x1b\[[0-9;]*m")
_TLS: Final = re.compile(r"zenoh_link_tls::unicast: (.*?)(?: Hint: .*)?$")
_THREAD: Final = re.compile(r"(ThreadId\(\d+\))")
_AHEAD: Final = re.compile(r"access_control: ACL \((\w+)\): caching permissions for `(.*)`")
_DENIED: Final = re.compile(
    r"access_control: (Using cached result: )?([0-9a-f]+)(?: on .*?CertCommonName\((.*?)\).*)?"
    r" is unauthorized to (.*?) \((ingress|egress)\) on (.*)$"
)

_END: Final = re.compile(r"not valid after (\d+)")

_CAUSES: Final = (
    ("certificate expired", "its key has expired"),
    ("not valid yet", "its key is not valid yet"),
    ("UnknownIssuer", "its key is from another authority"),
    ("BadSignature", "its key is from another authority"),
    ("sent no certificates", "it has no key"),
    ("InvalidContentType", "it speaks plain TCP, not TLS"),
    ("UnknownProtocolVersion", "it speaks plain TCP, not TLS"),
    ("InvalidPurpose", "its key is not for this purpose"),
    ("alert: UnknownCA", "it trusts another authority"),
    ("received fatal alert", "it does not trust the key that it is shown"),
)

_DEEDS: Final = (
    ("Put", "publish on"),
    ("Delete", "delete"),
    ("Subscriber", "subscribe to"),
    ("Queryable", "answer queries on"),
    ("Query", "query"),
    ("Token", "declare itself alive on"),
)

_SOMEBODY: Final = "somebody"
_MANY: Final = "many different things"


class Denial(msgspec.Struct, frozen=True):
    """A refusal: to whom, as far as known, why, and how many times since the last report."""

    who: str
    cause: str
    count: int = 1

    @property
    def text(self) -> str:
        """The refusal as a sentence."""
        again = f" ({self.count} times)" if self.count > 1 else ""
        return f"refused {self.who}: {self.cause}{again}"


class _Ahead:
    """A look-up of permissions in advance: whether one session may do each action on one key.

    The log has at most one line for each action.
    """

    def __init__(self, way: str, key: str) -> None:
        self._about = (way, key)
        self._session = ""
        self._deeds: set[str] = set()

    def holds(self, session: str, deed: str, way: str, key: str) -> bool:
        """Return whether a line belongs to this look-up; one that repeats an action does not."""
        self._session = self._session or session
        if (way, key) != self._about or session != self._session or deed in self._deeds:
            return False
        self._deeds.add(deed)
        return True


class Denials:
    """The refusals until now.

    `named` returns the common name of a session; `ended` returns the party whose certificate
    expired at a given time.
    """

    def __init__(
        self,
        named: Callable[[str], str],
        ended: Callable[[datetime.datetime], str],
    ) -> None:
        self._named = named
        self._ended = ended
        self._ahead: dict[str, _Ahead] = {}
        self._counts: dict[tuple[str, str], int] = {}
        self._told_s: dict[tuple[str, str], float] = {}

    def read(self, lines: Iterable[str], now_s: float) -> list[Denial]:
        """Read lines of Zenoh's log; return the refusals to report now."""
        found = [pair for line in lines if (pair := self._denial(_COLOURS.sub("", line)))]
        return self.note(found, now_s)

    def note(self, found: Iterable[tuple[str, str]], now_s: float) -> list[Denial]:
        """Count refusals, given as (who, cause); return those to report now."""
        for pair in found:
            if pair not in self._counts:
                pair = self._told_apart(*pair)
            self._counts[pair] = self._counts.get(pair, 0) + 1
        due = []
        for pair, count in list(self._counts.items()):
            told = self._told_s.get(pair)
            if told is not None and now_s - told < AGAIN_S:
                continue
            if count:
                due.append(Denial(*pair, count=count))
                self._told_s[pair] = now_s
                self._counts[pair] = 0
            else:
                del self._counts[pair], self._told_s[pair]
        return due

    def _told_apart(self, who: str, cause: str) -> tuple[str, str]:
        """Return a new refusal, or the group in which it is counted if there are too many."""
        if sum(one == who for one, _ in self._counts) >= MOST_EACH:
            return who, _MANY
        return (_SOMEBODY, _MANY) if len(self._counts) >= MOST else (who, cause)

    def _denial(self, line: str) -> tuple[str, str] | None:
        if (tls := _TLS.search(line)) is not None:
            return self._of_link(tls[1])
        thread = _THREAD.search(line)
        if thread is None:
            return None
        if (ahead := _AHEAD.search(line)) is not None:
            self._ahead[thread[1]] = _Ahead(ahead[1], ahead[2])
            return None
        denied = _DENIED.search(line)
        if denied is None:
            return None
        cached, session, name, deed, way, key = denied.groups()
        known = self._ahead.get(thread[1])
        if not cached and known is not None and known.holds(session, deed, way, key):
            return None
        if way == "egress":
            return None
        words = next((text for part, text in _DEEDS if part in deed), f"do ({deed})")
        return in_words(name or self._named(session)), f"it may not {words} {_shortened(key)}"

    def _of_link(self, reason: str) -> tuple[str, str]:
        cause = next(
            (text for part, text in _CAUSES if part in reason), f"no TLS link: {_printable(reason)}"
        )
        end = _END.search(reason)
        who = ""
        if end is not None:
            who = self._ended(datetime.datetime.fromtimestamp(int(end[1]), datetime.UTC))
        return who or _SOMEBODY, cause


def _shortened(key: str) -> str:
    said = _printable(key[:_LONGEST])
    return said if len(key) <= _LONGEST else f"{said}... ({len(key)} characters)"


def _printable(text: str) -> str:
    """Return an untrusted text with its unprintable characters escaped."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def in_words(common_name: str) -> str:
    """Return the party with a common name, in words."""
    badge = badge_of(common_name)
    return badge.who if badge is not None else repr(common_name) if common_name else _SOMEBODY


def denial_key(fleet: str) -> str:
    """Return the key of a fleet's records of refusals; nothing is ever sent on it."""
    return f"coordinator/{fleet}/denied"


def is_denial_key(key: str) -> bool:
    """Return whether this is a key of records of refusals."""
    first, _, rest = key.partition("/")
    return first == "coordinator" and rest.endswith("/denied")


def denial_record(refusal: Denial) -> bytes:
    """Encode a refusal as JSON."""
    return msgspec.json.encode(refusal)


def denial_of(payload: bytes) -> Denial | None:
    """Decode a refusal; return None if the bytes do not encode one."""
    try:
        return msgspec.json.decode(payload, type=Denial)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
