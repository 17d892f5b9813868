"""One robot that stands because it is late, while the others drive on until new times are found.

The others may drive on as long as a freeze would still bring all to rest before their plan times
differ by more than tau from the plan time of the place where the late robot stands.  Meanwhile new
times are searched.  Until a certain plan time, the switch, they are the same as the old times for
every robot that moves.  If a robot has not confirmed its new times when there is just enough time
left to freeze before the switch, the whole fleet freezes.

Decides: until when the others may drive on, and which robots have yet to confirm their new times.
Must not know: paths, other faults.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.member import Member
from coordinator.schedule.lateness import Lateness
from protocol.messages import Pace
from protocol.phases import LATE
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND

THINKING: Final = 300 * MILLISECOND
"""How long the search for new times may take."""

TELLING: Final = 3 * COMMAND_PERIOD
"""How long robots have to confirm new times, in addition to twice a message's time under way."""


class Delay:
    """The delay of at most one late robot at a time.

    `tau_ns` is the plan's tau, `travel_ns` the time that a message is under way.  `revision` is how
    often new times have replaced the times of this epoch.
    """

    def __init__(self, tau_ns: int = 0, travel_ns: int = 0) -> None:
        self.revision = 0
        self.missing: set[str] = set()
        self._tau_ns, self._travel_ns = tau_ns, travel_ns
        self._member: Member | None = None
        self._until_ns = 0
        self._asked: Lateness | None = None
        self._is_asked = self._is_told = False
        self._helped: set[str] = set()

    @property
    def robot(self) -> str:
        """The id of the late robot; empty if there is none."""
        return "" if self._member is None else self._member.id

    def begin(self, member: Member, times: EpochTimes, now_ns: int) -> bool:
        """Begin a delay if the others may drive on although this robot stopped; return whether.

        A robot gets one delay in an epoch.  If it is late again, the fleet freezes: it needs
        another path.
        """
        if self._member is not None or member.fault != LATE or member.id in self._helped:
            return False
        until_ns = member.kept_ns - times.behind_ns + self._tau_ns - times.settling_ns
        if until_ns <= now_ns:
            return False
        self._member, self._until_ns = member, until_ns
        self._helped.add(member.id)
        return True

    def bears(self, member: Member, now_ns: int) -> bool:
        """Return whether this robot is the late one and the others may still drive on.

        They may not if a fault stopped the robot, or if it stands although it has its new times.
        """
        told = self._is_told and member.id not in self.missing
        known = self._member is member and member.fault == LATE and not told
        return known and now_ns <= self._until_ns

    def is_over(self, now_ns: int) -> bool:
        """Return whether the delay has lasted too long."""
        return self._member is not None and now_ns > self._until_ns

    def hear(self, member: Member, pace: Pace, times: EpochTimes, now_ns: int) -> bool:
        """Take in a Pace; return whether all robots have now confirmed their new times."""
        if pace.revision != member.revision or pace.epoch != times.epoch:
            return False
        stood_ns = times.start_ns + 1000 * (pace.stood_us or 0)
        stands = pace.stood_us is not None and stood_ns <= now_ns
        if stands and member is self._member and self._asked is None:
            self._until_ns = stood_ns + self._tau_ns - times.settling_ns
            told_ns = now_ns + THINKING + TELLING + 2 * self._travel_ns
            switch_ns = told_ns + times.settling_ns - times.start_ns
            stood = (stood_ns - times.start_ns) / SECOND
            self._asked = Lateness(member.id, stood, switch_ns / SECOND)
        if member.id not in self.missing or pace.stood_us is not None:
            return False
        self.missing.discard(member.id)
        if self.missing:
            return False
        self.drop()
        return True

    def request(self) -> Lateness | None:
        """Return the lateness for which new times are needed; None if it was returned before."""
        if self._asked is None or self._is_asked:
            return None
        self._is_asked = True
        return self._asked

    def awaits(self, asked: Lateness) -> bool:
        """Return whether new times for this lateness are still needed."""
        return self._asked == asked and not self.missing

    def tell(self, robots: Iterable[str], times: EpochTimes) -> None:
        """Record that these robots are sent new times, and until when they have to confirm them."""
        assert self._asked is not None
        self.revision += 1
        self.missing, self._is_told = set(robots), True
        switch_ns = round(self._asked.switch * SECOND)
        self._until_ns = times.start_ns + switch_ns - times.settling_ns

    def drop(self) -> None:
        """End the delay."""
        self._member = self._asked = None
        self._is_asked = self._is_told = False
        self.missing = set()

    def begin_epoch(self) -> None:
        """Begin an epoch, whose times were never replaced."""
        self.drop()
        self.revision = 0
        self._helped.clear()
