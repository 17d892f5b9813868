"""Finds who sent on a fleet's keys without being one of its robots.

Decides: which names do not belong to robots of the fleet.  Must not know: what else they sent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec

from protocol import keys
from protocol.codec import decode
from protocol.messages import Join, Plan, Refusal, Report

if TYPE_CHECKING:
    from coordinator.log.records import Log


def strangers_in(log: Log, before: Sequence[Log] = ()) -> set[str]:
    """Return the names in a log that are not in its scenario and have not joined.

    In a log without a scenario, return those that were refused and never drove.  `before`: the logs
    that it resumes, in which robots may have joined.
    """
    robots = _robots_of(log.attachments)
    joined = {name for one in (*before, log) for name in _joined(one)}
    spoke, refused, drove = set(), set(), set()
    for record in log.records:
        place = keys.split(record.key)
        if place is None or not place[2] or place[1] == "orders":
            continue
        spoke.add(place[2])
        if robots or place[1] not in ("plan", "report"):
            continue
        message = decode(place[1], record.payload)
        if isinstance(message, Refusal):
            refused.add(place[2])
        elif isinstance(message, Plan) or (isinstance(message, Report) and message.epoch > 0):
            drove.add(place[2])
    return spoke - robots - joined if robots else refused - drove


def _joined(log: Log) -> Iterator[str]:
    """Yield the robots that operators took into the fleet."""
    for record in log.records:
        if record.key.endswith("/roster"):
            said = decode("roster", record.payload)
            if isinstance(said, Join):
                yield said.robot


class _Named(msgspec.Struct):
    id: str


class _Fleet(msgspec.Struct):
    robots: list[_Named]


def _robots_of(attachments: Mapping[str, bytes]) -> set[str]:
    """Return the names of a fleet's robots from the attached scenario; none if there is none."""
    try:
        fleet = msgspec.json.decode(attachments.get("scenario.json", b""), type=_Fleet)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return set()
    return {robot.id for robot in fleet.robots}
