"""The register of a fleet's certificates: which were issued, when they expire, which are revoked.

A generation number is never used twice for a name, so a revoked certificate stays refused when its
name gets a new one.

Decides: which certificates are valid.  Must not know: files, how certificates are made.
"""

from __future__ import annotations

import datetime
from collections.abc import Iterable
from typing import Final

import msgspec

from coordinator.base.errors import InputError
from protocol.badge import Badge, Role, badge_of

FORMAT: Final = "splinefleet.keys/1"


class Issued(msgspec.Struct, frozen=True):
    """One certificate; times are UTC, the serial number in hexadecimal digits.

    `may_join`: whether its robot, which is in no scenario, may join a fleet that drives.
    """

    role: Role
    name: str
    generation: int
    serial: str
    expires: datetime.datetime
    revoked: datetime.datetime | None = None
    may_join: bool = False

    @property
    def badge(self) -> Badge:
        """The party that the certificate identifies."""
        return Badge(self.role, self.name, self.generation)

    def state(self, now: datetime.datetime) -> str:
        """Return valid, expired or revoked."""
        if self.revoked is not None:
            return "revoked"
        return "valid" if now <= self.expires else "expired"


class Register(msgspec.Struct, frozen=True):
    """All certificates of a fleet's authority, in the order in which they were made."""

    format: str
    issued: tuple[Issued, ...]

    def next_generation(self, role: Role, name: str) -> int:
        """Return the number of the next certificate of this role and name."""
        return 1 + max((one.generation for one in self._of(role, name)), default=0)

    def added(self, one: Issued) -> Register:
        """Return the register with one more certificate; raise ValueError if it is a duplicate."""
        if any(other.badge == one.badge for other in self.issued):
            raise ValueError(f"{one.badge.common_name} is in the register already")
        return msgspec.structs.replace(self, issued=(*self.issued, one))

    def revoked(
        self, role: Role, name: str, now: datetime.datetime, generation: int | None = None
    ) -> tuple[Register, list[Issued]]:
        """Revoke a name's certificates, or one generation; return the register and those revoked.

        Certificates that were revoked before keep their time of revocation and are not returned.
        """
        hit = [
            one
            for one in self._of(role, name)
            if one.revoked is None and generation in (None, one.generation)
        ]
        issued = tuple(
            msgspec.structs.replace(one, revoked=now) if one in hit else one for one in self.issued
        )
        return msgspec.structs.replace(self, issued=issued), hit

    def valid(self, now: datetime.datetime) -> list[Badge]:
        """Return the parties whose certificates are valid now."""
        return [one.badge for one in self.issued if one.state(now) == "valid"]

    def joiners(self, now: datetime.datetime) -> list[str]:
        """Return the robots whose valid certificates let them join a fleet that drives."""
        found = (one.name for one in self.issued if one.may_join and one.state(now) == "valid")
        return list(dict.fromkeys(found))

    def keyless(self, robots: Iterable[str], now: datetime.datetime) -> list[str]:
        """Return a warning for each robot without a certificate that is valid now."""
        known = {badge.name for badge in self.valid(now) if badge.role == "robot"}
        return [
            f"{robot}: has no valid key, cannot connect; splinefleet keys robot {robot} makes one"
            for robot in robots
            if robot not in known
        ]

    def names(self, role: Role) -> set[str]:
        """Return all names in a role that ever had a certificate."""
        return {one.name for one in self.issued if one.role == role}

    def expired_at(self, end: datetime.datetime) -> Issued | None:
        """Return the certificate that expires in this second; None if there is not exactly one."""
        found = [one for one in self.issued if abs((one.expires - end).total_seconds()) < 1.0]
        return found[0] if len(found) == 1 else None

    def _of(self, role: Role, name: str) -> list[Issued]:
        return [one for one in self.issued if (one.role, one.name) == (role, name)]


def register_to_json(register: Register) -> bytes:
    """Return the register as the indented JSON of its file."""
    return msgspec.json.format(msgspec.json.encode(register), indent=1) + b"\n"


def register_of(content: bytes, where: str) -> Register:
    """Decode a register; raise InputError if the content is not a valid register."""
    try:
        register = msgspec.json.decode(content, type=Register)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise InputError([f"{where}: is not a register of keys: {error}"]) from None
    if register.format != FORMAT:
        raise InputError([f"{where}: the format {register.format[:40]!r} is not {FORMAT!r}"])
    if any(one.expires.tzinfo is None for one in register.issued):
        raise InputError([f"{where}: an `expires` has no time zone; it must end in Z, for UTC"])
    known: set[Badge] = set()
    for badge in (one.badge for one in register.issued):
        if badge_of(badge.common_name) != badge:
            raise InputError([f"{where}: {badge.common_name[:60]!r} is not the name of a key"])
        if badge in known:
            raise InputError([f"{where}: {badge.who} is in it twice"])
        known.add(badge)
    return register
