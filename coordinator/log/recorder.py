"""Write all messages into a log file while a fleet runs.

A separate thread writes the file, so that no caller waits for the disk unless it asks to.  The file
is flushed so often that a killed coordinator loses at most its last 100 ms.

Decides: when a log reaches the file.  Must not know: how it is laid out (log_writer.py), what the
messages mean.
"""

from __future__ import annotations

import sys
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

from coordinator.base.errors import InputError, LogError
from coordinator.fleet.log_records import is_checkpoint_key
from coordinator.log.log_file import RESUMED
from coordinator.log.log_folder import next_file
from coordinator.log.log_writer import WRITE_ERRORS, Attachment, LogWriter, write_problem
from coordinator.plan.plan_file import is_plan_name

FLUSH_PERIOD_S: Final = 0.08
"""Time between two flushes [s].

At most 100 ms may be lost; the remaining 20 ms are for the write itself."""

MOST_WAITING: Final = 32 * 2**20
"""How many bytes may wait for the disk; further messages are dropped, counted and reported."""

_ENTRY_BYTES: Final = 300


class _Entry(NamedTuple):
    key: str
    payload: bytes
    now_ns: int
    sent_ns: int | None

    @property
    def size(self) -> int:
        """The approximate size in memory [bytes]."""
        return len(self.payload) + _ENTRY_BYTES


class Recorder:
    """An open log.  Every method may be called from any thread; only `sync` and `close` wait.

    `metadata` is written unchanged, with an entry added for `wall_offset_ns`: wall clock minus
    coordinator's clock [ns].  Metadata and attachments are in the file when the constructor
    returns.  Raises InputError if the file cannot be created or written, if another recorder is
    writing it, or if `replace` is false and the file exists.

    If `path` is a folder, the log is its next file, and a further one begins with the first
    checkpoint after `most_bytes`: with the same metadata, `attachments`, and the newest plan in
    place of the one among them.
    """

    def __init__(
        self,
        path: Path,
        *,
        metadata: Mapping[str, str],
        wall_offset_ns: int,
        attachments: Iterable[Attachment] = (),
        replace: bool = True,
        most_bytes: int = 64 * 2**20,
    ) -> None:
        self.path = path
        self._most_bytes = most_bytes if path.is_dir() else sys.maxsize
        self._metadata, self._wall_offset_ns = metadata, wall_offset_ns
        self._head = {one.name: one for one in attachments}
        self._earlier_dropped = 0
        self.error: str | None = None
        """What went wrong while writing; from then on nothing more is recorded."""
        self._gate = threading.Lock()
        self._held = 0
        self._unheld = 0
        self._waiting: deque[_Entry | Attachment | threading.Event] = deque()
        self._unwritten: list[threading.Event] = []
        self._hurry = threading.Event()
        self._closing = threading.Event()
        self._writer = self._open(next_file(path) if path.is_dir() else path, replace=replace)
        self._head.pop(RESUMED, None)
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def dropped(self) -> int:
        """How many messages were not recorded: too many waited, or there were too many keys."""
        return self._unheld + self._earlier_dropped + self._writer.dropped

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Record a message that passed at `now_ns` on the coordinator's clock.

        `sent_ns` is the sender's time stamp [ns since 1970].  A call after `close` or an error has
        no effect.
        """
        if self.error is None and not self._closing.is_set():
            entry = _Entry(key, payload, now_ns, sent_ns)
            with self._gate:
                if self._held + entry.size > MOST_WAITING:
                    self._unheld += 1
                    return
                self._held += entry.size
                self._waiting.append(entry)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file to the log; it is written within the flush period."""
        if self.error is None and not self._closing.is_set():
            self._waiting.append(Attachment(name, media_type, data))

    def hurry(self) -> None:
        """Have everything recorded so far written at once; do not wait for it."""
        self._hurry.set()

    def sync(self) -> bool:
        """Wait, for at most 1 s, until the operating system has everything recorded so far.

        It outlasts the death of this program then.  The disk has it as soon as it can, so that it
        outlasts a power cut, too; nobody waits for that.

        Whatever a robot may act on for long must be in the log before it is sent to the robot.
        Return False if the log cannot be written any more.
        """
        if self.error is None and not self._closing.is_set():
            written = threading.Event()
            self._waiting.append(written)
            self._hurry.set()
            if self.error is None:  # else the writing thread may have ended and never set it
                written.wait(1.0)
        return self.error is None

    def close(self) -> None:
        """Write what is waiting and close the file; further calls do nothing.

        Raises LogError, once, if anything since the opening could not be written or was dropped.
        """
        first = not self._closing.is_set()
        self._closing.set()
        self._hurry.set()
        self._thread.join()
        if first and self.error is not None:
            raise LogError(self.error)
        if first and self.dropped:
            what = "too many at once, or on too many keys"
            raise LogError(f"{self.path}: {self.dropped} messages are not in it: {what}")

    def __enter__(self) -> Recorder:
        """Return the recorder itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the recorder."""
        self.close()

    def _run(self) -> None:
        """Write what is waiting, every FLUSH_PERIOD_S, until the recorder is closed."""
        try:
            while not self._closing.is_set():
                self._hurry.wait(FLUSH_PERIOD_S)
                self._hurry.clear()
                self._write_waiting()
            self._write_waiting()
            self._writer.finish()
        except BaseException as error:
            self.error = write_problem(self.path, error)
            self._give_up_waiting()
            self._writer.abandon()
            if not isinstance(error, WRITE_ERRORS):
                raise

    def _open(self, path: Path, *, replace: bool) -> LogWriter:
        return LogWriter(
            path,
            metadata=self._metadata,
            wall_offset_ns=self._wall_offset_ns,
            attachments=self._head.values(),
            replace=replace,
        )

    def _attach(self, file: Attachment) -> None:
        if is_plan_name(file.name):
            self._head = {n: one for n, one in self._head.items() if not is_plan_name(n)}
            self._head[file.name] = file
        self._writer.attach(file)

    def _begin_next(self) -> None:
        """Go on in the next file of the folder; raise ValueError if it cannot be created."""
        try:
            following = self._open(next_file(self.path), replace=False)
        except InputError as error:
            raise ValueError(str(error)) from None
        self._earlier_dropped += self._writer.dropped
        before, self._writer = self._writer, following
        before.finish()

    def _give_up_waiting(self) -> None:
        """Drop what is waiting and release the callers of `sync`."""
        for event in self._unwritten:
            event.set()
        while self._waiting:
            item = self._waiting.popleft()
            if isinstance(item, threading.Event):
                item.set()

    def _write_waiting(self) -> None:
        if not self._waiting:
            return
        while self._waiting:
            item = self._waiting.popleft()
            if isinstance(item, Attachment):
                self._attach(item)
            elif isinstance(item, threading.Event):
                self._unwritten.append(item)
            else:
                if is_checkpoint_key(item.key) and self._writer.size >= self._most_bytes:
                    self._begin_next()
                self._writer.record(*item)
                with self._gate:
                    self._held -= item.size
        self._writer.flush()
        is_awaited = bool(self._unwritten)
        for event in self._unwritten:
            event.set()
        self._unwritten.clear()
        if is_awaited:
            self._writer.sync()
