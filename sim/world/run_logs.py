"""The logs of a run in virtual time: run.mcap, run-2.mcap, ..., in the form of a real run's logs.

They are written at once, without a thread of their own, so that the same run gives the same bytes.

Decides: what a log of a coordinator that was killed looks like, and that a request to end does not
damage one.  Must not know: what is recorded.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from coordinator.base.console import write_file
from coordinator.base.errors import LogError
from coordinator.base.interrupts import held_back
from coordinator.log.head import Head, resumed, scenario_file
from coordinator.log.log_writer import (
    VIRTUAL,
    WRITE_ERRORS,
    Attachment,
    LogWriter,
    write_problem,
)
from coordinator.plan.plan_file import is_plan_name
from coordinator.scenario.model import Scenario

WALL_OFFSET_NS: Final = 1_700_000_000 * 10**9
"""The wall-clock time [ns since 1970] of virtual time 0; virtual time itself has no date."""


class RunLogs:
    """Writes the logs of one run into a folder, one after another.

    While no log is open, nothing is recorded.  With `power_cuts` a coordinator that is killed
    leaves only what it had brought to the disk, as when its computer loses power.  Methods raise
    LogError when the log cannot be written.
    """

    def __init__(
        self, folder: Path, wall_offset_ns: int = WALL_OFFSET_NS, *, power_cuts: bool = False
    ) -> None:
        self.paths: list[Path] = []
        self._power_cuts, self._synced = power_cuts, 0
        self._folder = folder
        self._wall_offset_ns = wall_offset_ns
        self._head: Head = ({}, [])
        self._writer: LogWriter | None = None

    def begin(self, head: Head) -> None:
        """Open the next log; InputError when it cannot be created."""
        path = self._next_path()
        self._head = head
        metadata, files = head
        self._writer = LogWriter(
            path,
            metadata={**metadata, VIRTUAL: "yes"},
            wall_offset_ns=self._wall_offset_ns,
            attachments=files,
        )
        self.paths.append(path)
        self.sync()

    def sync(self) -> None:
        """Bring everything recorded so far to the disk."""
        with self._writing() as writer:
            if writer is not None and self._power_cuts:
                writer.flush()
                self._synced = self.paths[-1].stat().st_size

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Record a message; both times are virtual."""
        stamp = None if sent_ns is None else sent_ns + self._wall_offset_ns
        with self._writing() as writer:
            if writer is not None:
                writer.record(key, payload, now_ns, stamp)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file to the log; the next log begins with the newest plan."""
        if is_plan_name(name):
            metadata, files = self._head
            self._head = metadata, [*files[:1], Attachment(name, media_type, data)]
        with self._writing() as writer:
            if writer is not None:
                writer.attach(Attachment(name, media_type, data))

    def keep(self, log: bytes) -> None:
        """Write an earlier log, unchanged, as the next file."""
        path = self._next_path()
        write_file(path, log)
        self.paths.append(path)

    def cut(self) -> bytes:
        """End the log as a killed coordinator would leave it, and return its bytes."""
        with self._writing() as writer:
            self._writer = None
            if writer is not None:
                writer.flush()
                writer.abandon()
            if self._power_cuts:
                os.truncate(self.paths[-1], self._synced)
            return self.paths[-1].read_bytes()

    def go_on(
        self, before: bytes, boot: int, began_ns: int, scenario: Scenario | None = None
    ) -> None:
        """Open the log of a coordinator that resumes from the log `before`, with its scenario."""
        metadata, files = self._head
        if scenario is not None:
            self._head = metadata, files = metadata, [scenario_file(scenario), *files[1:]]
        first = {**metadata, "boot": str(boot)}, files[:2]
        self.begin(resumed(first, before, began_ns))

    def close(self) -> None:
        """Close the log that is open; LogError, too, when there were too many keys for it."""
        with self._writing() as writer:
            self._writer = None
            if writer is not None:
                writer.finish()
        if writer is not None and writer.dropped:
            raise LogError(f"{self.paths[-1]}: {writer.dropped} messages are on too many keys")

    @contextmanager
    def _writing(self) -> Iterator[LogWriter | None]:
        """Give the open log, if there is one; a request to end waits for the end of the block."""
        try:
            with held_back():
                yield self._writer
        except WRITE_ERRORS as error:
            raise LogError(write_problem(self.paths[-1], error)) from None

    def _next_path(self) -> Path:
        number = len(self.paths) + 1
        return self._folder / ("run.mcap" if number == 1 else f"run-{number}.mcap")
