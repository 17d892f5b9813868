"""Which keys count as alive on the in-memory network, and which watchers know of them.

Decides: what each watcher sees at a moment.  Must not know: messages, and when watchers look:
memory_transport.py knows the time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from protocol.keys import fits
from protocol.transport import AliveHandler

CUT_NOTICE_NS: Final = 10_000_000_000
"""A session that is cut off counts as alive for this long: its connection is silent but open."""


@dataclass(eq=False)
class _Token:
    """A key that a session has declared alive, and from when to when others can know it."""

    key: str
    owner: str
    seen_ns: int
    gone_ns: float = math.inf


@dataclass(eq=False)
class _Watch:
    """A session's handler, and the tokens that it knows of."""

    watcher: str
    expression: list[str]
    handler: AliveHandler
    from_ns: int
    known: list[_Token] = field(default_factory=list)
    ended: bool = False


class Liveliness:
    """The tokens of all sessions and their watchers; times are virtual, in ns."""

    def __init__(self) -> None:
        self._tokens: list[_Token] = []
        self._watches: list[_Watch] = []

    @property
    def is_used(self) -> bool:
        """Return whether any key was declared or watched, so that `look` has something to do."""
        return bool(self._tokens or self._watches)

    def declare(self, owner: str, key: str, seen_ns: int) -> None:
        """Make a key count as alive from seen_ns on."""
        self._tokens.append(_Token(key, owner, seen_ns))

    def watch(self, watcher: str, expression: str, handler: AliveHandler, from_ns: int) -> None:
        """Let `look` call the handler for changes; calls of `look` before from_ns ignore it."""
        self._watches.append(_Watch(watcher, expression.split("/"), handler, from_ns))

    def forget(self, name: str, gone_ns: int) -> None:
        """End a session's watches now, and its declared keys at gone_ns."""
        for token in self._tokens:
            if token.owner == name:
                token.gone_ns = min(token.gone_ns, gone_ns)
        for watch in self._watches:
            watch.ended |= watch.watcher == name
        self._watches = [watch for watch in self._watches if not watch.ended]

    def look(self, now_ns: int, cuts_ns: Mapping[str, int]) -> None:
        """Call the watchers' handlers for all changes since the last look.

        cuts_ns: for each session that is cut off, the time of the cut.
        """
        self._tokens = [token for token in self._tokens if now_ns < token.gone_ns]
        for watch in tuple(self._watches):
            if watch.from_ns <= now_ns:
                self._update(watch, now_ns, cuts_ns)

    def _update(self, watch: _Watch, now_ns: int, cuts_ns: Mapping[str, int]) -> None:
        before = {token.key for token in watch.known}
        candidates = dict.fromkeys(watch.known + self._tokens)
        watch.known = [token for token in candidates if _sees(watch, token, now_ns, cuts_ns)]
        after = {token.key for token in watch.known}
        for key in sorted(before ^ after):
            if not watch.ended:
                watch.handler(key, key in after)


def _sees(watch: _Watch, token: _Token, now_ns: int, cuts_ns: Mapping[str, int]) -> bool:
    """Return whether a token is alive for a watcher; a watcher learns nothing new through a cut."""
    if token.owner == watch.watcher or not fits(watch.expression, token.key.split("/")):
        return False
    since_ns = [cuts_ns[name] for name in (token.owner, watch.watcher) if name in cuts_ns]
    if since_ns:
        return token in watch.known and now_ns < min(since_ns) + CUT_NOTICE_NS
    return token.seen_ns <= now_ns < token.gone_ns
