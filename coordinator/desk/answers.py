"""What the desk answers: the types of its JSON.

Decides: their fields.  Must not know: where the values come from.
"""

from __future__ import annotations

import msgspec

from protocol.phases import DONE, PHASE_NAMES


class Alarm(msgspec.Struct, frozen=True, kw_only=True):
    """An alarm; `since` counts seconds since 1970, `todo` says what a person can do about it.

    is_lasting: it is not over by itself.
    """

    id: str
    since: float
    text: str
    todo: str
    robot: str = ""
    order: str = ""
    is_acknowledged: bool = False
    is_lasting: bool = False


class RobotState(msgspec.Struct, frozen=True, kw_only=True):
    """What a robot reported last.

    phase: "" before its first report.  late [s].  age [s]: how long ago it was heard; null if
    never.  order: the one that it does.  next: those that wait for it by name.  held_by: the robot
    behind which it has to slow down or stand, held_since [s] since when after the first GO; null if
    nobody holds it.  stretch: of a robot that is not heard, where it may
    stand: points [m] of its course, from where it was heard last to where its authority ends.
    is_back: its program was started again, and waits until the robot is admitted; place: where it
    says that it stands, x, y [m] and heading [rad], null if it does not know.
    """

    id: str
    phase: str = ""
    fault: str = ""
    late: float = 0.0
    age: float | None = None
    is_heard: bool = False
    order: str = ""
    next: list[str] = []
    held_by: str = ""
    held_since: float | None = None
    stretch: list[tuple[float, float]] = []
    is_back: bool = False
    place: tuple[float, float, float] | None = None

    @property
    def rests(self) -> bool:
        """Whether the robot is at the end of its course."""
        return self.is_heard and self.phase == PHASE_NAMES[DONE]

    @property
    def is_free(self) -> bool:
        """Whether the robot rests and has nothing to do."""
        return self.rests and not (self.order or self.next)


class FleetAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """The fleet as far as it is known.

    phase: that of the last Command; age [s]: how long ago it was heard, null if never.  orders: how
    many are in each state.  blocks: the ids of closed places.
    """

    fleet: str
    phase: str
    epoch: int
    age: float | None
    is_heard: bool
    robots: list[RobotState]
    orders: dict[str, int]
    blocks: list[str]
    alarms: list[Alarm]


class Phase(msgspec.Struct, frozen=True):
    """What the fleet does after it was told something."""

    fleet: str
    phase: str


class Told(msgspec.Struct, frozen=True):
    """What has become of a robot."""

    robot: str
    text: str


class Place(msgspec.Struct, frozen=True):
    """A place of the floor that is closed: the corners of a polygon [m]."""

    id: str
    polygon: tuple[tuple[float, float], ...]


class PreviewRest(msgspec.Struct, frozen=True):
    """A rest on the way, at a place [m] and for `seconds`; robot: for whom, "" if for nobody."""

    robot: str
    place: tuple[float, float]
    seconds: float


class PreviewAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """What an order would come to, as far as the desk knows; nothing is reserved.

    robot: who would do it.  way: the points [m] of its path, empty if there is none; then, or if
    somebody rests in the way, reason says so and the times are null.  begins, arrives, done [s]:
    from now on.  alone [s]: how long it would take with nobody else on the floor.
    """

    robot: str
    way: list[tuple[float, float]]
    begins: float | None
    arrives: float | None
    done: float | None
    alone: float | None
    waits: list[PreviewRest]
    reason: str = ""


class Problem(msgspec.Struct, frozen=True):
    """What is wrong: one line each in `problems`, all of them in `error`."""

    error: str
    problems: list[str] = []
