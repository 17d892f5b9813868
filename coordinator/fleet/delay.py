"""One robot that stands because it is late, while the others go on: until when, and its new times.

The others may go on as long as all would still rest before their plan times differ by more than tau
from that of the place where it stands.  Meanwhile new times are looked for; they change nothing
before a switch, and whoever has not got them a freeze before that stops everybody.

Decides: until when that is borne, and who has yet to say that it has its new times.  Must not know:
paths, other faults.
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
"""How long new times may be looked for."""

TELLING: Final = 3 * COMMAND_PERIOD
"""How long robots have to say that they have them, and twice what a message takes."""


class Delay:
    """At most one late robot at a time; `tau_ns` is the plan's, `travel_ns` what a message takes.

    `revision` counts the new times of this epoch.
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
        """The late robot; empty if there is none."""
        return "" if self._member is None else self._member.id

    def begin(self, member: Member, times: EpochTimes, now_ns: int) -> bool:
        """Tell whether the others may go on although this robot has stopped; once per delay.

        Who is late again in an epoch is not just held up: it needs another path.
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
        """Tell whether this robot is known to stand, and that may go on.

        One that has its new times and stands again, or for another reason, is not borne.
        """
        told = self._is_told and member.id not in self.missing
        known = self._member is member and member.fault == LATE and not told
        return known and now_ns <= self._until_ns

    def is_over(self, now_ns: int) -> bool:
        """Tell whether it has lasted too long."""
        return self._member is not None and now_ns > self._until_ns

    def hear(self, member: Member, pace: Pace, times: EpochTimes, now_ns: int) -> bool:
        """Take what a robot says of its times; tell whether now all have their new ones."""
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
        """Return what new times are wanted for, once."""
        if self._asked is None or self._is_asked:
            return None
        self._is_asked = True
        return self._asked

    def awaits(self, asked: Lateness) -> bool:
        """Tell whether these new times are still waited for."""
        return self._asked == asked and not self.missing

    def tell(self, robots: Iterable[str], times: EpochTimes) -> None:
        """Have new times told to these robots; they have until a freeze before the switch."""
        assert self._asked is not None
        self.revision += 1
        self.missing, self._is_told = set(robots), True
        switch_ns = round(self._asked.switch * SECOND)
        self._until_ns = times.start_ns + switch_ns - times.settling_ns

    def drop(self) -> None:
        """Have no late robot."""
        self._member = self._asked = None
        self._is_asked = self._is_told = False
        self.missing = set()

    def begin_epoch(self) -> None:
        """Begin with times that nobody has changed."""
        self.drop()
        self.revision = 0
        self._helped.clear()
