"""Keys and bytes of the records that a coordinator writes into its log besides messages.

These records are never sent.  `replay --check` runs the fleet again from them:

- `epoch`: a new epoch was adopted, and where its robots stood when its plan was requested;
- `ahead`: until another such record, no robot is told that it may drive beyond this plan time [ms]
  of the epoch; it is in the log before a robot is told that much, so a coordinator that resumes
  from the log knows how far any robot may be;
- `course`: a search for a robot's course came to its end: what was asked, and what was found;
- `checkpoint`: the whole state of the coordinator (mission/checkpoint.py), to go on from without
  the records before it;
- `around`: from now on others are sent around a lost robot, which is granted nothing more on its
  course;
- `told`: an operator told the fleet to stop, or to go on;
- `router`: the coordinator's own link to a router came up or went down.  For a robot's link the
  same bytes are recorded under the robot's `alive` key;
- `dropped`: how many messages were dropped so far, by cause.

Decides: keys and bytes.  Must not know: when something is worth a record (mission_driver.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import msgspec

from coordinator.fleet.rest_places import Standing

TOLD_TO_STOP: Final = b'"stop"'
TOLD_TO_GO_ON: Final = b'"go on"'
LINK_UP: Final = msgspec.msgpack.encode(True)
LINK_GONE: Final = msgspec.msgpack.encode(False)
NOT_RECORDED: Final = "not recorded"
"""The cause of drop for messages for which the recorder had no space."""

_UNREADABLE: Final = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
_counts: Final = msgspec.json.Decoder(dict[str, int])


@dataclass(frozen=True)
class Request:
    """A request for a plan: its epoch, where the robots stand, and whether orders may follow.

    `homes`: robots that have made room, and where they go back to: x, y [m], and maybe a heading
    [rad].
    """

    epoch: int
    told: tuple[Standing, ...]
    has_orders: bool = False
    homes: tuple[tuple[str, tuple[float, ...]], ...] = ()


@dataclass(frozen=True)
class CourseRequest:
    """A request for a robot's next course: for which order, and what its message will say.

    `serial` counts the requests of a mission.
    """

    serial: int
    order: str
    robot: str
    number: int
    revision: int
    begin_ms: int


class Found(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a search for a course found: the course's message with boot id 0, or why there is none.

    The other fields are those of `planning.course_search.Answer`; `way` has its numbers as bytes.
    `alone` is None if the robot has no way even alone.
    """

    message: bytes | None = None
    alone: float | None = None
    reason: str = ""
    blockers: tuple[str, ...] = ()
    way: bytes = b""


class Search(msgspec.Struct, frozen=True):
    """A `course` record; `found` is None in logs of versions that searched again for it."""

    serial: int
    order: str
    robot: str
    number: int
    revision: int
    begin_ms: int
    found: Found | None = None

    @property
    def request(self) -> CourseRequest:
        """What was asked."""
        return CourseRequest(
            self.serial, self.order, self.robot, self.number, self.revision, self.begin_ms
        )


def course_key(fleet: str) -> str:
    """Return the key of a fleet's `course` records."""
    return f"coordinator/{fleet}/course"


def is_course_key(key: str) -> bool:
    """Return whether this is a key of `course` records."""
    return _is_record(key, "course")


def search_record(asked: CourseRequest, found: Found) -> bytes:
    """Encode a search as JSON."""
    return msgspec.json.encode(Search(**vars(asked), found=found))


def search_of(payload: bytes) -> Search | None:
    """Decode a search; return None if the bytes do not encode one."""
    try:
        return msgspec.json.decode(payload, type=Search)
    except _UNREADABLE:
        return None


def checkpoint_key(fleet: str) -> str:
    """Return the key of a fleet's `checkpoint` records."""
    return f"coordinator/{fleet}/checkpoint"


def is_checkpoint_key(key: str) -> bool:
    """Return whether this is a key of `checkpoint` records."""
    return _is_record(key, "checkpoint")


def around_key(fleet: str) -> str:
    """Return the key of a fleet's `around` records."""
    return f"coordinator/{fleet}/around"


def is_around_key(key: str) -> bool:
    """Return whether this is a key of `around` records."""
    return _is_record(key, "around")


def around_record(robot: str) -> bytes:
    """Encode a robot's name."""
    return msgspec.json.encode(robot)


def around_robot(payload: bytes) -> str | None:
    """Decode a robot's name; return None if the bytes do not encode one."""
    try:
        return msgspec.json.decode(payload, type=str)
    except _UNREADABLE:
        return None


def adoption_key(fleet: str) -> str:
    """Return the key of a fleet's `epoch` records."""
    return f"coordinator/{fleet}/epoch"


def is_adoption_key(key: str) -> bool:
    """Return whether this is a key of `epoch` records."""
    return _is_record(key, "epoch")


def adoption_record(request: Request) -> bytes:
    """Encode a request as JSON."""
    return msgspec.json.encode(request)


def request_of(payload: bytes) -> Request | None:
    """Decode a request; return None if the bytes do not encode one."""
    try:
        return msgspec.json.decode(payload, type=Request)
    except _UNREADABLE:
        return None


def ahead_key(fleet: str) -> str:
    """Return the key of a fleet's `ahead` records."""
    return f"coordinator/{fleet}/ahead"


def is_ahead_key(key: str) -> bool:
    """Return whether this is a key of `ahead` records."""
    return _is_record(key, "ahead")


def ahead_record(until_ms: int) -> bytes:
    """Encode a plan time [ms]."""
    return msgspec.msgpack.encode(until_ms)


def ahead_ms(payload: bytes) -> int | None:
    """Decode a plan time [ms]; return None if the bytes do not encode one."""
    try:
        return msgspec.msgpack.decode(payload, type=int)
    except _UNREADABLE:
        return None


def told_key(fleet: str) -> str:
    """Return the key of a fleet's `told` records."""
    return f"coordinator/{fleet}/told"


def is_told_key(key: str) -> bool:
    """Return whether this is a key of `told` records."""
    return _is_record(key, "told")


def router_key(fleet: str) -> str:
    """Return the key of a fleet's `router` records: the coordinator's own link."""
    return f"coordinator/{fleet}/router"


def is_router_key(key: str) -> bool:
    """Return whether this is a key of `router` records."""
    return _is_record(key, "router")


def link_record(alive: bool) -> bytes:
    """Return the payload that records a link as up or gone."""
    return LINK_UP if alive else LINK_GONE


def drops_key(fleet: str) -> str:
    """Return the key of a fleet's `dropped` records."""
    return f"coordinator/{fleet}/dropped"


def is_drops_key(key: str) -> bool:
    """Return whether this is a key of `dropped` records."""
    return _is_record(key, "dropped")


def drops_record(dropped: Mapping[str, int]) -> bytes:
    """Encode the numbers of dropped messages by cause as JSON."""
    return msgspec.json.encode(dict(sorted(dropped.items())))


def drops_of(payload: bytes) -> dict[str, int] | None:
    """Decode the numbers of dropped messages; return None if the bytes do not encode them."""
    try:
        return _counts.decode(payload)
    except _UNREADABLE:
        return None


def _is_record(key: str, kind: str) -> bool:
    first, _, rest = key.partition("/")
    return first == "coordinator" and rest.endswith(f"/{kind}")
