"""A file that one writer has to itself while it writes.

Decides: that nobody else's open log is ever emptied.  Must not know: what is written.
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
    """Open a file to write it from its beginning; it is ours until it is closed.

    Without `replace` it must not be there yet.  Raises OSError when it cannot be opened, and
    when another writer has it; then it stays as it is.  The lock is advisory and the system's: it
    goes with the process, however that ends.  Where there are no locks, there is none.
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


def _lock(descriptor: int) -> None:
    """Take the file's lock; OSError when another has it."""
    if sys.platform == "win32":
        return
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):  # else there are no locks here
            raise OSError(errno.EBUSY, "another program is writing it") from None
