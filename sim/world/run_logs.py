"""The logs of a run in virtual time: run.mcap, run-2.mcap, ..., in the form of a real run's logs.

Decides: what a log of a coordinator that was killed looks like.  Must not know: what is recorded.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from coordinator.base.console import write_file
from coordinator.log.head import Head, resumed
from coordinator.log.recorder import Recorder

WALL_OFFSET_NS: Final = 1_700_000_000 * 10**9
"""The wall-clock time [ns since 1970] of virtual time 0; virtual time itself has no date."""


class RunLogs:
    """Writes the logs of one run into a folder, one after another."""

    def __init__(self, folder: Path, wall_offset_ns: int = WALL_OFFSET_NS) -> None:
        self.paths: list[Path] = []
        self._folder = folder
        self._wall_offset_ns = wall_offset_ns
        self._head: Head = ({}, [])

    def begin(self, head: Head) -> None:
        """Open the next log; InputError when it cannot be created."""
        path = self._next_path()
        self._head = head
        metadata, files = head
        self._recorder = Recorder(
            path, metadata=metadata, wall_offset_ns=self._wall_offset_ns, attachments=files
        )
        self.paths.append(path)

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Record a message; both times are virtual."""
        stamp = None if sent_ns is None else sent_ns + self._wall_offset_ns
        self._recorder.record(key, payload, now_ns, stamp)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file to the log."""
        self._recorder.attach(name, media_type, data)

    def keep(self, log: bytes) -> None:
        """Write an earlier log, unchanged, as the next file."""
        path = self._next_path()
        write_file(path, log)
        self.paths.append(path)

    def cut(self) -> bytes:
        """End the log as a killed coordinator would leave it, and return its bytes."""
        path = self.paths[-1]
        self._recorder.sync()
        data = path.read_bytes()
        self._recorder.close()
        path.write_bytes(data)
        return data

    def go_on(self, before: bytes, boot: int, began_ns: int) -> None:
        """Open the log of a coordinator that resumes from the log `before`."""
        metadata, files = resumed(self._head, before, began_ns)
        self.begin(({**metadata, "boot": str(boot)}, files))

    def _next_path(self) -> Path:
        number = len(self.paths) + 1
        return self._folder / ("run.mcap" if number == 1 else f"run-{number}.mcap")

    def close(self) -> None:
        """Close the log; LogError when any part of it could not be written."""
        self._recorder.close()
