"""The key files of one party of a fleet: authority.pem, certificate.pem, private.pem.

Decides: where these files are, and whether they are usable.  Must not know: how they were made.
The authority's own private key is never among them.
"""

from __future__ import annotations

import datetime
import errno
from pathlib import Path
from typing import Final, NamedTuple

from protocol.badge import Badge, Role, badge_of
from protocol.certificate import Certificate, read_certificate
from protocol.transport import TransportError

AUTHORITY: Final = "authority.pem"
CERTIFICATE: Final = "certificate.pem"
PRIVATE: Final = "private.pem"

WARNING: Final = datetime.timedelta(days=30)
"""How long before a certificate expires its user is warned."""

_OTHERS: Final = 0o077


class KeyFiles(NamedTuple):
    """The three files, the badge in the certificate, and when the certificate expires (UTC)."""

    authority: Path
    certificate: Path
    private: Path
    badge: Badge
    expires: datetime.datetime

    def moved_to(self, folder: Path | None) -> KeyFiles:
        """Return the same files with paths in another folder; None leaves the paths unchanged."""
        if folder is None:
            return self
        return self._replace(
            authority=folder / AUTHORITY,
            certificate=folder / CERTIFICATE,
            private=folder / PRIVATE,
        )

    def warning(self, now: datetime.datetime | None = None) -> str:
        """Return a warning if the files expire within WARNING after `now`, else an empty text."""
        now = now or datetime.datetime.now(datetime.UTC)
        if self.expires - now > WARNING:
            return ""
        days = max(0, (self.expires - now).days)
        return (
            f"{self.certificate} expires in {days} days, on {self.expires:%Y-%m-%d}; "
            f"splinefleet keys {self.badge.role} makes the next one"
        )


def own_place(role: Role, name: str) -> Path:
    """Return the folder of a party's files within the fleet's folder of keys."""
    return Path(role) if role in ("coordinator", "router") else Path(role) / name


def read_key_files(
    folder: Path, role: Role, name: str = "", now: datetime.datetime | None = None
) -> KeyFiles:
    """Find the files of a party in its own folder or in the fleet's, and check them.

    Without a name, a party's own folder may hold the files of any name, and in the fleet's folder
    the name is that of the role.  Raises TransportError with one sentence when the files are
    missing, readable by others, damaged, another party's, not of one authority, or not valid at
    `now` (by default this moment).  Whether they are genuine is left to TLS.
    """
    if not folder.is_dir():
        raise TransportError(f"--keys: there is no folder {folder}")
    own = folder if (folder / CERTIFICATE).exists() else folder / own_place(role, name or role)
    if not own.is_dir():
        makes = f"splinefleet keys {role} {name}".rstrip()
        raise TransportError(f"--keys: there is no folder {own}; {makes} makes it")
    places = [own / AUTHORITY, own / CERTIFICATE, own / PRIVATE]
    authority, certificate, private = (_content(place) for place in places)
    if places[2].stat().st_mode & _OTHERS:
        raise TransportError(f"{places[2]}: others may read it; chmod 600 {places[2]}")
    found = _parsed(places, authority, certificate, private)
    badge = badge_of(found.common_name)
    if badge is None or badge.role != role or name not in ("", badge.name):
        whose = "nobody's here" if badge is None else f"that of {badge.role} {badge.name}"
        raise TransportError(f"{places[1]} is {whose}, not that of {role} {name}".rstrip())
    begin, end = found.begins, found.ends
    now = now or datetime.datetime.now(datetime.UTC)
    if not begin <= now <= end:
        word = f"expired on {end:%Y-%m-%d}" if now > end else f"is not valid before {begin:%c}"
        raise TransportError(f"{places[1]} {word}; splinefleet keys {role} makes the next one")
    return KeyFiles(places[0], places[1], places[2], badge, end)


def key_content(place: Path) -> bytes:
    """Return the content of a key file; raises OSError, also for a pipe, which may never end."""
    if place.is_fifo():
        raise OSError(errno.EINVAL, "is a pipe, not a file", str(place))
    return place.read_bytes()


def _content(place: Path) -> bytes:
    try:
        return key_content(place)
    except OSError as error:
        raise TransportError(f"{place}: {error.strerror}") from None


def _parsed(
    places: list[Path], authority: bytes, certificate: bytes, private: bytes
) -> Certificate:
    """Return the certificate after checking that it matches the authority and the private key."""
    place = places[0]
    try:
        issuer = read_certificate(authority)
        place = places[1]
        found = read_certificate(certificate)
    except ValueError:
        raise TransportError(f"{place} cannot be read; it is not a certificate in PEM") from None
    if not found.belongs_to(private):
        raise TransportError(f"{places[2]} does not belong to {places[1]}")
    if found.issuer != issuer.subject:
        raise TransportError(f"{places[1]} was not signed by {places[0]}")
    return found
