"""The coordinator's gate: which parties of a scenario's fleet may connect, and which were refused.

Without keys there is no gate: anybody who reaches the endpoint is heard.  protocol/access.py
decides what each party may do; protocol/zenoh_transport.py decides how the link checks
certificates.

Decides: which certificates are valid for this run.
"""

from __future__ import annotations

import datetime
import time
from collections.abc import Iterable
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final

from coordinator.security.certificate_register import Register
from coordinator.security.denials import DULL, LOG_FILTER, Denial, Denials, in_words
from coordinator.security.key_store import KeyStore
from coordinator.security.zenoh_log import ZenohLog
from protocol.access import access_control, player_rights, rights_of
from protocol.badge import Badge, badge_of
from protocol.key_files import KeyFiles, read_key_files
from protocol.zenoh_transport import ZenohTransport

_REMEMBERED: Final = 1_000
"""How many sessions' common names are remembered: a refusal is read when its session may be
gone."""


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)


def player_access(folder: Path) -> dict[str, Any]:
    """Return the access control for playing a log: observers may listen, and nobody else."""
    badges = KeyStore(folder).register().valid(_now())
    pairs = ((badge, player_rights(badge)) for badge in badges)
    return access_control((badge, right) for badge, right in pairs if right is not None)


class Gate:
    """The gate of one fleet; raises InputError or TransportError if the keys are not usable.

    `robots`: those of the scenario; robots whose keys let them join may connect too.
    """

    def __init__(self, folder: Path, fleet: str, robots: Iterable[str]) -> None:
        now = _now()
        self._register: Register = KeyStore(folder).register()
        self.files: KeyFiles = read_key_files(folder, "coordinator")
        own = tuple(robots)
        self._robots = tuple(dict.fromkeys((*own, *self._register.joiners(now))))
        badges = self._register.valid(now)
        pairs = ((badge, rights_of(fleet, self._robots, badge)) for badge in badges)
        allowed = [(badge, right) for badge, right in pairs if right is not None]
        self._access = access_control(allowed)
        self._allowed = {badge.common_name for badge, _ in allowed}
        self._names: dict[str, str] = {}
        self._links: SimpleQueue[tuple[str, str, str, bool]] = SimpleQueue()
        self._denials = Denials(self._name_of, self._ended)
        self._log: ZenohLog | None = None
        self.warnings = [*filter(None, (self.files.warning(), KeyStore(folder).warning()))]
        self.warnings += self._register.keyless(own, now)

    def listen(self, endpoint: str) -> ZenohTransport:
        """Open the coordinator's session; rights do not change as long as it is open."""
        self._log = ZenohLog(LOG_FILTER, DULL)
        transport = ZenohTransport.listen(endpoint, self.files, self._access)
        transport.watch_links(lambda *news: self._links.put(news))
        return transport

    def news(self) -> list[Denial]:
        """Return the refusals to report since the last call."""
        found = []
        while True:
            try:
                session, name, address, is_up = self._links.get_nowait()
            except Empty:
                break
            if is_up:
                self._names[session] = name
                if len(self._names) > _REMEMBERED:
                    del self._names[next(iter(self._names))]
            if is_up and name not in self._allowed:
                who = f"{in_words(name)}, from {address.rpartition(':')[0]}"
                found.append((who, self._why(badge_of(name))))
        lines = [] if self._log is None else self._log.lines()
        now_s = time.monotonic()
        return self._denials.note(found, now_s) + self._denials.read(lines, now_s)

    def close(self) -> None:
        """Stop reading refusals; call this after the session is closed."""
        if self._log is not None:
            self._log.close()

    def _name_of(self, session: str) -> str:
        return self._names.get(session, "")

    def _ended(self, end: datetime.datetime) -> str:
        one = self._register.expired_at(end)
        return "" if one is None else one.badge.who

    def _why(self, badge: Badge | None) -> str:
        """Return why a certificate that the authority signed has no rights here."""
        for one in self._register.issued:
            if badge == one.badge:
                if one.revoked is not None:
                    return "its key was revoked"
                return "it has no part in this fleet and may not join it"
        return "its key is not in the register"
