"""A file that is locked while one process writes it.

Decides: that no process empties a log that another one is writing.  Must not know: what is written.
"""

from __future__ import annotations

import errno
import os
import stat
import sys
from pathlib import Path
from typing import BinaryIO, Final

_NEW_FILE: Final = 0o666


def open_own(path: Path, *, replace: bool) -> BinaryIO:
    """Open a file for writing from its beginning and lock it until it is closed.

    Without `replace` the file must not exist yet.  Raises OSError if the file cannot be opened, or
    if another writer has locked it; it is then left unchanged.  The lock is advisory.  The system
    releases it when the process ends, however it ends.  Where the system has no locks, the file is
    not locked.
    """
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0)
    descriptor = os.open(path, flags if replace else flags | os.O_EXCL, _NEW_FILE)
    stream = os.fdopen(descriptor, "wb")
    try:
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            _lock(descriptor)
            os.ftruncate(descriptor, 0)
    except BaseException:
        stream.close()
        raise
    return stream


def is_being_written(path: Path) -> bool:
    """Return whether another writer has locked a file; False where the system has no locks."""
    with path.open("rb") as stream:
        try:
            _lock(stream.fileno())
        except OSError as error:
            return error.errno == errno.EBUSY
    return False


def _lock(descriptor: int) -> None:
    """Lock the file; raises OSError if another process has locked it."""
    if sys.platform == "win32":
        return
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):  # otherwise locks are not supported
            raise OSError(errno.EBUSY, "another program is writing it") from None
