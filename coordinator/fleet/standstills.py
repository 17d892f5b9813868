"""Which robots of a fleet get on, which one holds which, and which are stuck.

Decides: when a robot counts as held, stuck, or as getting on.  Must not know: how authority is
divided, what is done about robots that stand.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from protocol.timing import LATE_STEP_MS

STUCK_MS: Final = 10_000
"""A robot that nobody holds and that has not got on for this long is stuck."""

LATELY_MS: Final = 1_000
"""A robot that has got on within this time gets on."""

LONG_MS: Final = 5_000
"""A robot that is held for this long counts as standing: it had time to use up its authority."""

_STEPS: Final = 2
"""A robot gets on when its known progress has grown by this many steps of lateness."""


class Held(NamedTuple):
    """A robot that another one holds, and since which plan time [ms]."""

    robot: str
    by: str
    since_ms: int


class Standstills:
    """Who gets on and who does not; `names`: the robot of each slot, a list that may grow."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self.got_on_latest_ms = 0
        """The plan time when a robot last got on."""

        self.got_on_ms = np.zeros(len(names), np.int64)
        """By slot: when its robot last got on, or could not because it was held."""

        self.passed_ms = np.zeros(len(names), np.int64)
        """By slot: what its robot had passed when it last got on."""

        self.by_slot: dict[int, tuple[int, int]] = {}
        """By slot: the slot of who holds its robot, and since when [ms]."""

        self.for_long: set[int] = set()
        """The slots whose robots are held for LONG_MS or longer."""

        self.kept_from: dict[str, str] = {}
        """By robot: who has to pass before it may begin the course last found, or one is found."""

    def grow(self) -> None:
        """Make room for the slots whose names have been added."""
        more = np.zeros(len(self._names) - len(self.got_on_ms), np.int64)
        self.got_on_ms = np.append(self.got_on_ms, more)
        self.passed_ms = np.append(self.passed_ms, more)

    def await_start(self, slot: int, begin_ms: int) -> None:
        """Take in that a course was committed to a slot; its robot begins it at `begin_ms`."""
        self.passed_ms[slot] = self.got_on_ms[slot] = begin_ms
        self.kept_from.pop(self._names[slot], None)

    def begin(self, slot: int, old: int, now_ms: int) -> None:
        """Take in that a robot has left its old course for the one in a slot."""
        self._free(old)
        self.got_on_ms[slot] = now_ms
        self.got_on_latest_ms = max(now_ms, self.got_on_latest_ms)

    def drive(self, slot: int, passed_ms: int, now_ms: int) -> None:
        """Take in how far a robot is known to have come."""
        if passed_ms - self.passed_ms[slot] >= _STEPS * LATE_STEP_MS:
            self.passed_ms[slot] = passed_ms
            self.got_on_latest_ms = max(now_ms, self.got_on_latest_ms)
            self.got_on_ms[slot] = max(now_ms, int(self.got_on_ms[slot]))

    def keep_from(self, robot: str, by: int) -> None:
        """Take in that a robot may not begin the course found for it before a slot's has passed."""
        self.kept_from[robot] = self._names[by]

    def hold(self, holders: Mapping[int, int | None], now_ms: int) -> None:
        """Take in by which slots' robots those of other slots are held; None: by nobody."""
        before, self.by_slot = self.by_slot, {}
        for slot, by in holders.items():
            if by is not None:
                self.by_slot[slot] = by, before.get(slot, (by, now_ms))[1]
        self.for_long = {
            slot for slot, (_, since) in self.by_slot.items() if now_ms - since >= LONG_MS
        }

    def remove(self, robot: str, slots: Collection[int]) -> None:
        """Forget a robot that is not on the floor any more, and its slots."""
        for slot in slots:
            self._free(slot)
        self.kept_from = {one: by for one, by in self.kept_from.items() if robot not in (one, by)}

    def _free(self, slot: int) -> None:
        self.by_slot.pop(slot, None)
        self.for_long.discard(slot)

    def excuse(self, lost_ms: int) -> None:
        """Take in that for so long [ms] robots could not get on, or could not be heard."""
        self.got_on_ms += lost_ms
        self.got_on_latest_ms += lost_ms

    def held(self) -> list[Held]:
        """Return the robots that others hold."""
        names = self._names
        return [Held(names[slot], names[by], since) for slot, (by, since) in self.by_slot.items()]

    def behind(self, stopped: Collection[str]) -> set[str]:
        """Return the robots that are held by these robots, or by others that these hold.

        One that may not set out on the course found for it, before another one has passed, counts.
        """
        held = [*self.kept_from.items(), *((one.robot, one.by) for one in self.held())]
        found = own = set(stopped)
        while more := {robot for robot, by in held if by in found} - found:
            found = found | more
        return found - own

    def stuck(self, could_drive: npt.NDArray[np.bool_], now_ms: int) -> set[str]:
        """Return the robots that could drive, by slot (n,), and have not got on for STUCK_MS."""
        late = (now_ms - self.got_on_ms > STUCK_MS) & could_drive
        return {self._names[slot] for slot in np.flatnonzero(late).tolist()}

    def gets_on(self, slot: int, now_ms: int) -> bool:
        """Return whether a slot's robot has got on lately, or could not."""
        return now_ms - int(self.got_on_ms[slot]) <= LATELY_MS
