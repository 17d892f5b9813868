"""Collects the courses that robots were sent while the fleet drove, and draws them once.

Decides: what is kept of a course, and since when its robot drives it.  Must not know: files, how a
course was found.  Times are on the coordinator's clock.
"""

from __future__ import annotations

from typing import NamedTuple

from msgspec.structs import replace

from coordinator.findings.braking import Words
from coordinator.plan.wire import Driven, unpack
from coordinator.view.scene import Ride, Wait
from coordinator.view.scene_plan import ride_of
from protocol.codec import encode
from protocol.messages import Plan


class SentCourse(NamedTuple):
    """A course, when it was sent [ns], and its ride, whose robot has no index yet."""

    told_ns: int
    driven: Driven
    ride: Ride

    @property
    def begin(self) -> float:
        """The plan time [s] at which the course begins."""
        return 0.001 * self.driven.plan.begin_ms

    def since(self, words: Words) -> float | None:
        """Return since when [s] the robot drives it, by its reports; None if it does not."""
        return words.since(self.driven.timeline, self.begin)


class SentCourses:
    """The further courses of all epochs."""

    def __init__(self) -> None:
        self._all: dict[tuple[int, str, int], SentCourse] = {}

    def take(self, plan: Plan, radius: float, now_ns: int) -> bool:
        """Add a course; return whether it is a new one that robots accept.

        It replaces one of the same revision that was withdrawn.
        """
        key, plan = (plan.epoch, plan.robot, plan.revision), replace(plan, boot=0)
        known = self._all.get(key)
        if known is not None and known.driven.plan == plan:
            return False
        try:
            driven = unpack(encode(plan), radius)
        except (ValueError, OverflowError):
            return False
        self._all[key] = SentCourse(now_ns, driven, ride_of(driven, -1, _waits(driven)))
        return True

    def of(self, epoch: int) -> list[SentCourse]:
        """Return the further courses of an epoch, by revision."""
        found = [one for (number, _, _), one in self._all.items() if number == epoch]
        return sorted(found, key=lambda one: one.driven.plan.revision)

    def radii(self) -> dict[str, float]:
        """Return the radii [m] of the robots that have such courses."""
        return {robot: one.driven.radius for (_, robot, _), one in self._all.items()}

    def forget(self, epoch: int, robot: str, revision: int) -> None:
        """Forget a robot's courses before this one, because they are of no interest any more."""
        old = [key for key in self._all if key[:2] == (epoch, robot) and key[2] < revision]
        for key in old:
            del self._all[key]


def _waits(one: Driven) -> list[Wait]:
    """Return where the robot rests on its way, the time before it sets out included."""
    begin = 0.001 * one.plan.begin_ms
    return [
        Wait(s=round(s, 4), since=round(max(arrive, begin), 4), until=round(depart, 4))
        for s, arrive, depart in one.rests
        if depart > max(arrive, begin)
    ]
