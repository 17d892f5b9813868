"""Zenoh's own log of this process, taken off the standard output, where Zenoh writes it.

Decides: where these lines go.  Must not know: what they say.

The Rust library writes to file descriptor 1 and knows no other way.  From the beginning on that
descriptor is a file that nobody sees; Python's own output goes on to where it went.  The file
takes what is written without ever letting Zenoh wait, and is emptied when it has been read.
"""

from __future__ import annotations

import fcntl
import os
import sys
import tempfile
from typing import Final

_OUTPUT: Final = 1
_MOST: Final = 1 << 20
"""Bytes that are looked at in one reading; what a flood adds beyond them is thrown away."""

_LARGE: Final = 1 << 22


class ZenohLog:
    """The lines that Zenoh writes from here on; once in a process, before its first session.

    `log_filter` says what it writes, in the words of RUST_LOG; lines that hold `dull` are left out.
    """

    def __init__(self, log_filter: str, dull: bytes) -> None:
        import zenoh

        sys.stdout.flush()
        self._kept = os.dup(_OUTPUT)
        self._python = sys.stdout
        self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
        handle = self._file.fileno()
        fcntl.fcntl(handle, fcntl.F_SETFL, fcntl.fcntl(handle, fcntl.F_GETFL) | os.O_APPEND)
        self._dull = dull
        self._read = 0
        self._rest = b""
        os.dup2(handle, _OUTPUT)
        sys.stdout = os.fdopen(os.dup(self._kept), "w", encoding="utf-8", errors="replace")
        zenoh.init_log_from_env_or(log_filter)

    def lines(self) -> list[str]:
        """Return the whole lines that have come since the last time."""
        handle = self._file.fileno()
        content = os.pread(handle, _MOST, self._read)
        self._read += len(content)
        if len(content) == _MOST or self._read > _LARGE:
            os.ftruncate(handle, 0)
            self._read = 0
        *whole, self._rest = (self._rest + content).split(b"\n")
        return [line.decode(errors="replace") for line in whole if self._dull not in line]

    def close(self) -> None:
        """Give the standard output back; what comes from then on is seen."""
        sys.stdout.flush()
        os.dup2(self._kept, _OUTPUT)
        os.close(self._kept)
        sys.stdout.close()
        sys.stdout = self._python
        self._file.close()
