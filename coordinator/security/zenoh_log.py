"""Zenoh's own log of this process, redirected from the standard output, where Zenoh writes it.

The Rust library can write its log only to file descriptor 1.  So that descriptor is replaced by a
temporary file, and Python's own output goes to a copy of the former descriptor.  Writing to the
file never blocks Zenoh; the file is emptied when it has been read and is large.

Decides: where these lines go.  Must not know: what they say.
"""

from __future__ import annotations

import fcntl
import os
import sys
import tempfile
from typing import Final

_OUTPUT: Final = 1
_MOST: Final = 1 << 20
"""The most bytes that one call of `lines` reads; if there are more, the rest is discarded."""

_LARGE: Final = 1 << 22


class ZenohLog:
    """The lines that Zenoh writes from now on; create one per process, before the first session.

    `log_filter` selects what Zenoh writes, in the syntax of RUST_LOG.  Lines that contain `dull`
    are left out.
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
        """Return the complete lines that were written since the last call."""
        handle = self._file.fileno()
        content = os.pread(handle, _MOST, self._read)
        self._read += len(content)
        if len(content) == _MOST or self._read > _LARGE:
            os.ftruncate(handle, 0)
            self._read = 0
        *whole, self._rest = (self._rest + content).split(b"\n")
        return [line.decode(errors="replace") for line in whole if self._dull not in line]

    def close(self) -> None:
        """Restore the standard output; lines that Zenoh writes later appear there."""
        sys.stdout.flush()
        os.dup2(self._kept, _OUTPUT)
        os.close(self._kept)
        sys.stdout.close()
        sys.stdout = self._python
        self._file.close()
