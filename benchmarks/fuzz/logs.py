"""Fuzz targets for logs: damaged files, and sound files with wrong messages."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import cache
from itertools import count
from typing import Final

from mcap.writer import CompressionType, Writer
from msgspec.structs import replace

from benchmarks.fuzz.files import two
from benchmarks.fuzz.target import Target, answered
from benchmarks.fuzz.wire import pieces, spoken
from coordinator.exchange.motion_story import csv_lines, story_of_log
from coordinator.findings.info import courses_of, summarise
from coordinator.findings.info_table import render
from coordinator.fleet.events import Outgoing
from coordinator.log.head import first_head
from coordinator.log.log_file import log_from_bytes
from coordinator.log.log_writer import METADATA_NAME, WALL_OFFSET
from coordinator.log.records import Log, Record
from coordinator.log.recover import make_whole
from coordinator.mission.fleet_from_plan import muster
from coordinator.plan.wire import packed
from coordinator.service.replay import check_log
from coordinator.view.scene_log import scene_of_logs
from protocol import keys
from protocol.codec import encode
from protocol.messages import Hello, Report
from protocol.phases import ARMED, DONE, MOVING
from protocol.timing import COMMAND_PERIOD, SECOND

_BOOT: Final = 7
_KEYS: Final = (keys.hello, keys.plan, keys.report, keys.clock, keys.admit, keys.alive)
_STEP: Final = 0.5


@answered
def log_bytes(data: bytes) -> None:
    """Read a file that may be a log, recover it, and summarize it."""
    make_whole(data, "run.mcap")
    _tell(log_from_bytes(data, "run.mcap"))


@answered
def log_words(data: bytes) -> None:
    """Summarize a log in which other messages are between the sound ones."""
    sound = _sound_log()
    records = sound.records[: len(sound.records) // 2]
    now_ns = records[-1].log_ns
    robots = [robot.id for robot in two()[0].robots]
    for which, payload in pieces(data):
        now_ns += which * 1_000_000
        key = (
            keys.command("two")
            if which >= 240
            else _KEYS[which % 6]("two", robots[which // 6 % len(robots)])
        )
        records.append(Record(key, payload, now_ns, now_ns, 0))
    _tell(replace(sound, records=records))


def _tell(log: Log) -> None:
    courses_of(log, [])
    render(summarise(log))
    check_log(log)
    scene_of_logs([("run.mcap", log)])
    for _ in csv_lines(story_of_log(log), _STEP):
        pass


def _spoken() -> Iterator[tuple[int, Outgoing]]:
    """Yield the messages of two robots that drive, with their times."""
    fleet = muster(packed(two()[1]), _BOOT)
    sequence, now_ns = count(1), SECOND
    for phase in (None, ARMED, ARMED, MOVING, MOVING, DONE, DONE, DONE):
        for robot in fleet.members:
            key, said = keys.hello("two", robot), encode(Hello(2, 5, 0.15))
            if phase is not None:
                key = keys.report("two", robot)
                said = encode(Report(5, next(sequence), fleet.epoch, phase))
            yield now_ns, Outgoing(key, said)
            yield from ((now_ns, answer) for answer in fleet.hear(key, said, now_ns))
        now_ns += COMMAND_PERIOD
        yield from ((now_ns, message) for message in fleet.tick(now_ns))


def _file(compression: CompressionType, *, checked: bool) -> bytes:
    """Return a log; without checksums a fuzzer can change what they would protect."""
    scenario, document = two()
    stream = io.BytesIO()
    writer = Writer(stream, compression=compression, enable_crcs=checked, enable_data_crcs=checked)
    writer.start(profile="", library="splinefleet")
    metadata, files = first_head(scenario, document, boot=_BOOT, effort=0)
    writer.add_metadata(METADATA_NAME, {**metadata, WALL_OFFSET: "0"})
    for file in files:
        writer.add_attachment(0, 0, *file)
    channels: dict[str, int] = {}
    for now_ns, message in _spoken():
        if message.key not in channels:
            channels[message.key] = writer.register_channel(message.key, "msgpack", 0)
        writer.add_message(channels[message.key], now_ns, message.payload, now_ns)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


@cache
def _sound_log() -> Log:
    return log_from_bytes(_file(CompressionType.ZSTD, checked=True), "run.mcap")


def _byte_seeds() -> Iterator[bytes]:
    for compression in (CompressionType.NONE, CompressionType.ZSTD):
        whole = _file(compression, checked=False)
        yield whole
        yield whole[: 2 * len(whole) // 3]
    yield _file(CompressionType.ZSTD, checked=True)


TARGETS: Final = {
    "log-bytes": Target(log_bytes, _byte_seeds),
    "log-words": Target(log_words, spoken, 4_200),
}
