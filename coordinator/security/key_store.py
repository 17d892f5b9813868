"""A fleet's folder of keys: the authority, the register, and the files of every party.

The coordinator needs all of the folder except `authority/`; a robot needs only its own subfolder.

Decides: where the files are and their modes: 0700 for folders and 0600 for private keys, from the
moment when they are created.
"""

from __future__ import annotations

import datetime
import fcntl
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final, get_args

from coordinator.base.errors import InputError
from coordinator.security.certificate_register import (
    FORMAT,
    Issued,
    Register,
    register_of,
    register_to_json,
)
from protocol.badge import Badge, Role, badge_of
from protocol.certificate import read_certificate
from protocol.key_files import AUTHORITY, CERTIFICATE, PRIVATE, key_content, own_place

if TYPE_CHECKING:
    from coordinator.security.certificate_authority import Pair

REGISTER: Final = "register.json"
_OTHERS_WRITE: Final = 0o022
_AUTHORITY_PLACE: Final = "authority"
_OF_A_FLEET: Final = (REGISTER, _AUTHORITY_PLACE, *get_args(Role))
"""Entries that show that a folder has keys, which a new authority would make useless."""


class KeyStore:
    """The folder that `keys init` makes; every method raises InputError with one line of text."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def begin(self, now: datetime.datetime) -> None:
        """Create the folder with a new authority and an empty register."""
        from coordinator.security.certificate_authority import new_authority

        self._check_folder()
        if self._is_ones_own():
            raise InputError([f"{self.folder} has the keys of a single party; name another folder"])
        if any((self.folder / place).exists() for place in _OF_A_FLEET):
            raise InputError([f"{self.folder} has an authority already; name another folder"])
        with _told():
            _make_folder(self.folder)
            self._write_pair(Path(_AUTHORITY_PLACE), new_authority(now))
            self._write_register(Register(FORMAT, ()))

    def register(self) -> Register:
        """Return the register as it is now."""
        place = self.folder / REGISTER
        self._check_folder()
        if not place.exists():
            lost = any((self.folder / part).exists() for part in _OF_A_FLEET)
            words = "restore it from a copy"
            if not lost:
                words = f"splinefleet keys init {self.folder} makes one"
            if self._is_ones_own():
                words = "it has the keys of a single party; name the fleet's folder"
            raise InputError([f"{self.folder}: has no {REGISTER}; {words}"])
        with _told():
            return register_of(key_content(place), str(place))

    def warning(self) -> str:
        """Return a warning if others may write or replace the register, else an empty text."""
        for place in (self.folder, self.folder / REGISTER):
            with _told():
                others = place.stat().st_mode & _OTHERS_WRITE
            if others:
                what = "other users may write it and undo a revocation"
                return f"{place}: {what}; chmod go-w {place}"
        return ""

    def issue(
        self,
        role: Role,
        names: Iterable[str],
        now: datetime.datetime,
        days: int,
        hosts: Iterable[str] = (),
        *,
        may_join: bool = False,
    ) -> list[Issued]:
        """Issue the next certificate of each name and write it to its folder; return all issued.

        may_join: whether these robots, which are in no scenario, may join a fleet that drives.
        """
        from coordinator.security.certificate_authority import new_certificate

        made = []
        with self._alone():
            authority = self._authority()
            for name in names:
                register = self.register()
                number = max(register.next_generation(role, name), 1 + self._latest(role, name))
                badge = Badge(role, name, number)
                pair = new_certificate(authority, badge, now, days, hosts)
                one = Issued(*badge, pair.serial, pair.expires, may_join=may_join)
                self._write_register(register.added(one))
                self._write_pair(own_place(role, name), pair)
                _write(self.folder / own_place(role, name) / AUTHORITY, authority.certificate)
                made.append(one)
        return made

    def revoke(
        self, role: Role, name: str, now: datetime.datetime, generation: int | None = None
    ) -> list[Issued]:
        """Revoke a name's certificates, or one generation; return those that were not revoked."""
        with self._alone():
            register, hit = self.register().revoked(role, name, now, generation)
            if hit:
                self._write_register(register)
        return hit

    def _check_folder(self) -> None:
        """Raise InputError if the folder's path is a file."""
        if self.folder.exists() and not self.folder.is_dir():
            raise InputError([f"{self.folder} is not a folder"])

    def _is_ones_own(self) -> bool:
        """Return whether this is the folder of a single party, not of a fleet."""
        return (self.folder / CERTIFICATE).exists()

    def _latest(self, role: Role, name: str) -> int:
        """Return the generation of the key in its folder; 0 if there is none.

        If the register was restored from an older copy, it may lack this generation.
        """
        try:
            content = key_content(self.folder / own_place(role, name) / CERTIFICATE)
            badge = badge_of(read_certificate(content).common_name)
        except (OSError, ValueError):
            return 0
        return 0 if badge is None or badge[:2] != (role, name) else badge.generation

    def _authority(self) -> Pair:
        place = self.folder / _AUTHORITY_PLACE
        if not (place / PRIVATE).exists():
            raise InputError(
                [f"{place / PRIVATE}: is missing; certificates cannot be made without it"]
            )
        from coordinator.security.certificate_authority import Pair

        with _told():
            return Pair(key_content(place / CERTIFICATE), key_content(place / PRIVATE))

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Lock the folder, so that no other command changes the register meanwhile."""
        self.register()
        with _told():
            handle = os.open(self.folder, os.O_RDONLY)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX)
                yield
            finally:
                os.close(handle)

    def _write_pair(self, place: Path, pair: Pair) -> None:
        folder = self.folder
        for part in place.parts:
            folder = folder / part
            _make_folder(folder)
        _write(folder / PRIVATE, pair.private)
        _write(folder / CERTIFICATE, pair.certificate)

    def _write_register(self, register: Register) -> None:
        _write(self.folder / REGISTER, register_to_json(register))


@contextmanager
def _told() -> Iterator[None]:
    """Turn an error of the system or of damaged files into an InputError of one line."""
    try:
        yield
    except OSError as error:
        raise InputError([f"{error.filename}: {error.strerror}"]) from None
    except ValueError as error:
        raise InputError([f"the authority's files are damaged: {error}"]) from None


def _make_folder(folder: Path) -> None:
    """Create a folder with mode 0700.

    An existing folder keeps its mode, because it may have other contents.
    """
    folder.mkdir(mode=0o700, exist_ok=True)


def _write(path: Path, content: bytes) -> None:
    """Write a file with mode 0600 atomically: it has either its new or its former content."""
    part = path.with_name(f".{path.name}.{os.getpid()}")
    handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "wb") as stream:
        stream.write(content)
    part.replace(path)
