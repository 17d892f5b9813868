"""Read a log back, whether it is complete, cut short by a kill, or damaged.

"Incomplete" and "damaged" are different.  A file that ends early is incomplete, and every record
before its end can be used.  A file whose bytes contradict its own checksums or structure is
damaged, and the sentence that says so names the byte.  `recorder.py` writes every checksum of the
format, so that in a closed log any changed byte is found.

Decides: which parts of an MCAP file can be used, and whether the file is as it was written.  Must
not know: what the messages mean.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import Final, NamedTuple

from mcap import records as mcap_records
from mcap.writer import MCAP0_MAGIC
from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.log.log_folder import (
    files_of_runs,
    hint_below,
    newest_log,
    numbered_files,
    other_files,
)
from coordinator.log.log_writer import METADATA_NAME, WALL_OFFSET
from coordinator.log.records import NOT_CLOSED, Log, Record
from coordinator.log.soundness import Sound, is_closed, scan
from coordinator.log.versions import objection
from coordinator.scenario.file_kinds import kind_of, wrong_kind
from protocol import keys
from protocol.timing import SECOND

RESUMED: Final = "resumed.mcap"
"""The attachment with the log that a log resumes."""

MOST_RESUMED: Final = 100
_DAY: Final = 24 * 3600 * SECOND
_LONGEST: Final = 31 * _DAY
"""The longest time that a log may span [ns]."""

RECOVERED: Final = "splinefleet.recovered"
"""The name of the metadata record that describes a recovered log before it was recovered."""

_LAST_TIME: Final = 2**62
_MOST_OFFSET: Final = 2**63 - 1
_NO_METADATA: Final = (
    "its metadata are damaged: the fleet's name is taken from the keys, and times are log times"
)
_MOST_NAMED: Final = 2 * MOST_RESUMED
"""How often the name RESUMED may be in a file that resumes MOST_RESUMED logs.

Each log has it twice: in the attachment itself and in the summary."""


class LogScan(NamedTuple):
    """A log's intact records, and what its `Log` says of metadata, end, damage and recovery."""

    sound: list[Sound]
    metadata: dict[str, str]
    complete: bool
    damage: str
    recovered: str


def read_log(path: Path) -> Log:
    """Read every complete message of a closed, unfinished or damaged log, or of a folder of logs.

    Raises InputError if the file does not exist, is not an MCAP file, or is not a fleet's log.
    """
    if not path.is_dir():
        return log_from_bytes(load(path), str(path))
    log = read_folder(path)
    if log is None:
        raise InputError([f"{path}: holds no log{hint_below(path)}"])
    return log


def read_folder(folder: Path) -> Log | None:
    """Read the log of a folder; return None if it holds none.

    The files run-0001.mcap and so on are one log.  Otherwise it is the log that contains all other
    logs in the folder, because it resumes them.  What else is there is `left_out`.  Raises
    InputError if a numbered file cannot be read, or if no log contains all others.
    """
    numbered = numbered_files(folder)
    return _numbered_log(folder, numbered) if numbered else _log_among_others(folder)


def _numbered_log(folder: Path, files: list[Path]) -> Log:
    parts = [(file.name, log) for file in files if (log := _part(file)) is not None]
    if not parts:
        raise InputError([f"{folder}: holds no log: nothing was recorded in {files[0].name}"])
    runs = [list(run) for _, run in groupby(parts, lambda part: part[1].metadata.get("boot"))]
    *before, newest = [_joined(run) for run in runs]
    left_out = tuple(file.name for file in other_files(folder))
    return replace(newest, before=tuple(before), left_out=left_out)


def _log_among_others(folder: Path) -> Log | None:
    logs: dict[Path, Log] = {}
    for file in other_files(folder):
        with suppress(InputError):
            part = _part(file)
            if part is not None:
                logs[file] = part
    found = newest_log(folder, logs, readable_logs_before)
    if found is None:
        return None
    newest = logs[found]
    before = {one.metadata.get("boot") for one in readable_logs_before(newest)}
    own = {found, *(file for file, log in logs.items() if log.metadata.get("boot") in before)}
    left_out = tuple(file.name for file in other_files(folder) if file not in own)
    return replace(newest, left_out=left_out)


def read_newest(path: Path) -> tuple[Log, bytes]:
    """Read a log, or the newest file of a folder in which anything was recorded; and its bytes.

    That file is enough to go on from.  Raises InputError as `read_log` does, and for a folder whose
    files are not numbered.
    """
    if path.is_dir():
        for file in reversed(numbered_files(path)):
            part = _part(file)
            if part is not None and part.records:
                return part, load(file)
        raise InputError([f"{path}: has no log in files run-0001.mcap, ...; name the log's file"])
    data = load(path)
    return log_from_bytes(data, str(path)), data


def _part(file: Path) -> Log | None:
    """Read a file of a folder; None if its coordinator was killed before it recorded anything."""
    data = file.read_bytes()
    try:
        return log_from_bytes(data, str(file))
    except InputError:
        if data.startswith(MCAP0_MAGIC[: len(data)]) and not is_closed(data):
            return None
        raise


def _joined(files: list[tuple[str, Log]]) -> Log:
    """Return the log of one coordinator whose files these are, each with its name."""
    attachments: dict[str, bytes] = {}
    parts = [part for _, part in files]
    for part in parts:
        attachments |= part.attachments
    return Log(
        metadata=parts[0].metadata,
        attachments=attachments,
        records=[record for part in parts for record in part.records],
        complete=parts[-1].complete,
        damage="; ".join(f"{name}: {part.damage}" for name, part in files if part.damage),
        recovered="; ".join(dict.fromkeys(part.recovered for part in parts if part.recovered)),
    )


def log_from_bytes(data: bytes, path: str) -> Log:
    """Read a log as `read_log` does; `path` names it in error messages."""
    found = scan_log(data, path)
    attachments = {
        record.name: record.data
        for _, record in found.sound
        if isinstance(record, mcap_records.Attachment)
    }
    records = list(_messages(found.sound, int(found.metadata[WALL_OFFSET])))
    _check_times(records, path)
    return Log(
        metadata=found.metadata,
        attachments=attachments,
        records=records,
        complete=found.complete,
        damage=found.damage,
        recovered=found.recovered,
    )


def logs_before(log: Log, name: str = "") -> list[Log]:
    """Return the logs that a log resumes, directly and indirectly, oldest first.

    Raises InputError if one of them is not a log.  `name` names the log itself in error messages.
    """
    inner = f"{name}: {RESUMED}" if name else RESUMED
    before = log_before(log, inner)
    return [] if before is None else [*logs_before(before, inner), before]


def log_before(log: Log, name: str = RESUMED) -> Log | None:
    """Return the log that a log resumes, if there is one; raise InputError if it is not a log."""
    if log.before:
        *earlier, before = log.before
        return replace(before, before=tuple(earlier))
    data = log.attachments.get(RESUMED)
    return None if data is None else log_from_bytes(data, name)


def readable_logs_before(log: Log) -> list[Log]:
    """Return the logs that a log resumes, as `logs_before`, as far back as they can be read."""
    try:
        before = log_before(log)
    except InputError:
        return []
    return [] if before is None else [*readable_logs_before(before), before]


def _check_times(records: list[Record], path: str) -> None:
    """Raise InputError if a record's time is impossible."""
    for number, record in enumerate(records):
        if abs(record.log_ns) > _LAST_TIME or abs(record.log_ns - records[0].log_ns) > _LONGEST:
            days = _LONGEST // _DAY
            problem = f"message {number} on {record.key}: its time is invalid"
            raise InputError([f"{path}: {problem} or more than {days} days from the log's first"])


def scan_log(data: bytes, path: str) -> LogScan:
    """Return the intact parts of a log; raise InputError if the data is not a fleet's log."""
    if not data.startswith(MCAP0_MAGIC) and not is_closed(data):
        raise _no_log(path, data)
    if data.count(RESUMED.encode()) > _MOST_NAMED:
        raise InputError([f"{path}: resumes more than {MOST_RESUMED} logs, one inside the other"])
    sound, damage = scan(data)
    metadata: dict[str, str] = {}
    recovered = ""
    for _, record in sound:
        if isinstance(record, mcap_records.Metadata) and record.name == METADATA_NAME:
            metadata = record.metadata
        elif isinstance(record, mcap_records.Metadata) and record.name == RECOVERED:
            recovered = record.metadata.get("damage") or NOT_CLOSED
    if reason := objection(metadata):
        raise InputError([f"{path}: {reason}"])
    if not _has_offset(metadata):
        fleet = metadata.get("fleet") or _fleet_by_keys(sound)
        if not fleet:
            reason = f": {damage}" if damage else ""
            raise InputError([f"{path}: is not the log of a fleet{reason}"])
        metadata = {**metadata, "fleet": fleet, WALL_OFFSET: "0"}
        damage = f"{damage}; {_NO_METADATA}" if damage else _NO_METADATA
    return LogScan(sound, metadata, is_closed(data), damage, recovered)


def _has_offset(metadata: dict[str, str]) -> bool:
    """Return whether the metadata have the offset from log times to the coordinator's clock."""
    try:
        return abs(int(metadata[WALL_OFFSET])) <= _MOST_OFFSET
    except (KeyError, ValueError):
        return False


def _fleet_by_keys(sound: list[Sound]) -> str:
    """Return the fleet in the first channel's key that names one; empty if none does."""
    for _, record in sound:
        place = keys.split(record.topic) if isinstance(record, mcap_records.Channel) else None
        if place is not None:
            return place[0]
    return ""


def is_unfinished(path: Path) -> bool:
    """Return whether a file, or the newest one of a folder, is a log that was not closed."""
    if path.is_dir():
        return any(is_unfinished(file) for file in files_of_runs(path)[-1:])
    data = path.read_bytes() if path.is_file() else b""
    return data.startswith(MCAP0_MAGIC) and not is_closed(data)


def load(path: Path) -> bytes:
    """Return a log's bytes; raise InputError if the file does not exist or is not an MCAP file."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError([f"{path}: {error.strerror}"]) from None
    if not data.startswith(MCAP0_MAGIC) and not is_closed(data):
        raise _no_log(str(path), data)
    return data


def _no_log(path: str, data: bytes) -> InputError:
    """Return the InputError for a file that was never a log."""
    found = kind_of(data)
    if found is None or found == "log":
        return InputError([f"{path}: is not an MCAP file"])
    return InputError([wrong_kind(path, found, "log")])


def _messages(sound: list[Sound], wall_offset_ns: int) -> Iterator[Record]:
    """Yield the messages; a channel lost in a damaged chunk is taken from the summary."""
    channels = (record for _, record in sound if isinstance(record, mcap_records.Channel))
    topics = {channel.id: channel.topic for channel in channels}
    for offset, record in sound:
        if isinstance(record, mcap_records.Message) and record.channel_id in topics:
            yield Record(
                key=topics[record.channel_id],
                payload=record.data,
                log_ns=record.log_time - wall_offset_ns,
                publish_ns=record.publish_time,
                offset=offset,
            )
