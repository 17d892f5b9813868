"""Write all messages into an MCAP file, as their raw bytes.

A separate thread writes the file, so that no caller waits for the disk unless it asks to.  The file
is flushed so often that a killed coordinator loses at most its last 100 ms.

Layout: the metadata record "splinefleet", attachments, then chunks (zstd, with CRCs).  Each key has
a channel, and a plain second one for payloads that are not valid messages for the key
(channels.py).  log_time is the coordinator's clock plus `wall_offset_ns`; publish_time is the
sender's time stamp if there is one, else log_time.  The order of the records is the order of the
calls.

Decides: how a log is laid out, and when it reaches the file.  Must not know: what the messages
mean.
"""

from __future__ import annotations

import struct
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Final, NamedTuple

from mcap.exceptions import McapError
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from coordinator.base.errors import InputError, LogError
from coordinator.base.own_file import open_own
from coordinator.log.channels import PLAIN, Description, describe

METADATA_NAME: Final = "splinefleet"
WALL_OFFSET: Final = "wall_offset_ns"
"""The metadata entry to subtract from log times to get the coordinator's clock."""

FLUSH_PERIOD_S: Final = 0.08
"""Time between two flushes [s].

At most 100 ms may be lost; the remaining 20 ms are for the write itself."""

MOST_WAITING: Final = 32 * 2**20
"""How many bytes may wait for the disk; further messages are dropped, counted and reported."""

MOST_CHANNELS: Final = 60_000
"""How many channels a log may have: enough for the keys of the largest fleet.

The format allows 65,535.  Messages on further keys, which someone must have invented, are dropped
and counted, too."""

_ENTRY_BYTES: Final = 300

CHUNK_BYTES: Final = 128 * 1024
"""The size of a chunk; compressing a larger one would block the interpreter for too long."""

_LAST_STAMP: Final = 2**64 - 1
_WRITE_ERRORS: Final = (OSError, ValueError, struct.error, McapError, ZstdError)


class Attachment(NamedTuple):
    """A file inside the log, such as scenario.json."""

    name: str
    media_type: str
    data: bytes


class _Entry(NamedTuple):
    key: str
    payload: bytes
    log_time: int
    publish_time: int

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
    """

    def __init__(
        self,
        path: Path,
        *,
        metadata: Mapping[str, str],
        wall_offset_ns: int,
        attachments: Iterable[Attachment] = (),
        replace: bool = True,
    ) -> None:
        self.path = path
        self.error: str | None = None
        """What went wrong while writing; from then on nothing more is recorded."""
        self.dropped = 0
        """How many messages were not recorded: too many waited, or there were too many keys."""
        self._wall_offset_ns = wall_offset_ns
        self._gate = threading.Lock()
        self._held = 0
        self._waiting: deque[_Entry | Attachment | threading.Event] = deque()
        self._unwritten: list[threading.Event] = []
        self._hurry = threading.Event()
        self._closing = threading.Event()
        self._schemas: dict[str, int] = {"": 0}
        self._descriptions: dict[str, Description] = {}
        self._channels: dict[tuple[str, bool], int] = {}
        self._sequences: dict[str, int] = {}
        try:
            self._stream = open_own(path, replace=replace)
            self._begin({**metadata, WALL_OFFSET: str(wall_offset_ns)}, attachments)
        except OSError as error:
            raise InputError([_sentence(path, error)]) from None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def record(self, key: str, payload: bytes, now_ns: int, sent_ns: int | None = None) -> None:
        """Record a message that passed at `now_ns` on the coordinator's clock.

        `sent_ns` is the sender's time stamp [ns since 1970].  A call after `close` or an error has
        no effect.
        """
        if self.error is None and not self._closing.is_set():
            log_time = _stamp(now_ns + self._wall_offset_ns)
            publish_time = log_time if sent_ns is None else _stamp(sent_ns)
            entry = _Entry(key, payload, log_time, publish_time)
            with self._gate:
                if self._held + entry.size > MOST_WAITING:
                    self.dropped += 1
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

    def _begin(self, metadata: dict[str, str], attachments: Iterable[Attachment]) -> None:
        try:
            self._writer = begin_file(self._stream)
            self._writer.add_metadata(METADATA_NAME, metadata)
            for attachment in attachments:
                self._add_attachment(attachment)
            self._writer.flush()  # type: ignore[no-untyped-call]
        except BaseException:
            with suppress(OSError):
                self._stream.close()
            raise

    def _run(self) -> None:
        """Write what is waiting, every FLUSH_PERIOD_S, until the recorder is closed."""
        try:
            while not self._closing.is_set():
                self._hurry.wait(FLUSH_PERIOD_S)
                self._hurry.clear()
                self._write_waiting()
            self._write_waiting()
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.close()
        except BaseException as error:
            self.error = _sentence(self.path, error)
            self._give_up_waiting()
            with suppress(OSError):
                self._stream.close()
            if not isinstance(error, _WRITE_ERRORS):
                raise

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
                self._add_attachment(item)
            elif isinstance(item, threading.Event):
                self._unwritten.append(item)
            else:
                self._add_message(item)
                with self._gate:
                    self._held -= item.size
        self._writer.flush()  # type: ignore[no-untyped-call]
        for event in self._unwritten:
            event.set()
        self._unwritten.clear()

    def _add_attachment(self, attachment: Attachment) -> None:
        name, media_type, data = attachment
        self._writer.add_attachment(0, 0, name, media_type, data)

    def _add_message(self, entry: _Entry) -> None:
        described = self._descriptions.get(entry.key) or describe(entry.key)
        if len(self._descriptions) < MOST_CHANNELS:
            self._descriptions[entry.key] = described
        place = (entry.key, described.fits(entry.payload))
        channel = self._channels.get(place)
        if channel is None and len(self._channels) >= MOST_CHANNELS:
            self.dropped += 1
            return
        if channel is None:
            channel = self._register(entry.key, described if place[1] else PLAIN)
            self._channels[place] = channel
        sequence = self._sequences.get(entry.key, 0)
        self._sequences[entry.key] = (sequence + 1) % 2**32
        self._writer.add_message(
            channel, entry.log_time, entry.payload, entry.publish_time, sequence
        )

    def _register(self, key: str, described: Description) -> int:
        """Register a channel, with the schema of its payloads if there is one."""
        if described.name not in self._schemas:
            self._schemas[described.name] = self._writer.register_schema(
                described.name, "jsonschema", described.schema
            )
        schema = self._schemas[described.name]
        return self._writer.register_channel(key, described.encoding, schema)


def begin_file(stream: IO[bytes]) -> Writer:
    """Return the writer of an MCAP file with every checksum of the format, its header written."""
    writer = Writer(
        stream,
        chunk_size=CHUNK_BYTES,
        compression=CompressionType.ZSTD,
        enable_crcs=True,
        enable_data_crcs=True,
    )
    writer.start(profile="", library="splinefleet")
    return writer


def _stamp(time_ns: int) -> int:
    """Return a time clipped to the range of the format: a sender's clock may show anything."""
    return min(max(time_ns, 0), _LAST_STAMP)


def _sentence(path: Path, error: BaseException) -> str:
    reason = error.strerror if isinstance(error, OSError) else str(error)
    return f"{path}: the log cannot be written: {reason or repr(error)}"
