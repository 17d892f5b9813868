"""Plays the exchanges with a robot one after the other, and sums up what was found.

Decides: which exchange is next, and when the robot conforms.  Must not know: links, clocks, files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from coordinator.conformance.courses import Pace, Pose
from coordinator.conformance.exam import Exam, Script, Until
from coordinator.conformance.exchanges import EXCHANGES, SLOW, Exchange
from coordinator.conformance.requirements import REQUIREMENTS, Requirement
from coordinator.conformance.stage import Put, Stage
from protocol.phases import OVER
from protocol.timing import SECOND

_SILENCE: Final = 2 * SECOND
"""A robot that is not heard for so long [ns] is not examined any further."""

HOLDS, FAILS, NOT_TRIED = "holds", "fails", "not tried"


@dataclass(frozen=True)
class Finding:
    """What was found of one requirement; `seen`: what the robot did instead, or why not tried."""

    number: str
    requirement: Requirement
    verdict: str
    seen: tuple[str, ...]


class Examiner:
    """The examination of one robot; `robot` None: the first that says Hello within `wait_ns`.

    `boot` is a number from 2 to 2**32 - 3, `place` the pose at which the robot stands.  `now`: the
    exchange under way, in words.  `is_over`: whether there is nothing left to do.
    """

    def __init__(
        self,
        fleet: str,
        robot: str | None,
        boot: int,
        pace: Pace,
        place: Pose = (0.0, 0.0, 0.0),
        wait_ns: int = 30 * SECOND,
        exchanges: Sequence[Exchange] = EXCHANGES,
    ) -> None:
        self.stage = Stage(fleet, robot, boot)
        self.exam = Exam(self.stage, pace, place)
        self.now, self.is_over = "", False
        self._wait_ns = wait_ns
        self._exchanges = exchanges
        self._could_not: dict[str, str] = {}
        self._script = self._play()
        self._until: Until | None = None
        self._deadline_ns = 0

    def hear(self, key: str, payload: bytes, now_ns: int) -> None:
        """Take in what was put on a key of the fleet."""
        self.stage.hear(key, payload, now_ns)

    def hear_alive(self, key: str, alive: bool) -> None:
        """Take in that a link is up or gone."""
        self.stage.hear_alive(key, alive)

    def tick(self, now_ns: int) -> list[Put]:
        """Return what is to be sent now; to be called every few milliseconds."""
        puts = self.stage.tick(now_ns)
        while not self.is_over:
            met = self._until is not None and self._until.met()
            if self._until is not None and not met and self.stage.now_ns < self._deadline_ns:
                break
            try:
                self._until = next(self._script) if self._until is None else self._script.send(met)
                self._deadline_ns = self.stage.now_ns + self._until.patience_ns
            except StopIteration:
                self.is_over = True
        return puts

    def findings(self) -> list[Finding]:
        """Return what was found of each requirement, in the order of the page."""
        exam, found = self.exam, []
        for number, requirement in REQUIREMENTS.items():
            seen = tuple(exam.failures.get(number, ()))
            verdict = FAILS if seen else HOLDS if number in exam.tried else NOT_TRIED
            if verdict == NOT_TRIED and number in self._could_not:
                seen = (self._could_not[number],)
            found.append(Finding(number, requirement, verdict, seen))
        return found

    @property
    def conforms(self) -> bool:
        """Return whether everything that a robot must do was tried as far as asked, and held."""
        return not any(
            one.requirement.is_must and (one.verdict == FAILS or one.seen)
            for one in self.findings()
        )

    def _play(self) -> Script:
        stage = self.stage
        stage.clock_delay_ns = SLOW
        if not (yield Until(lambda: bool(stage.hellos), self._wait_ns)):
            self._skip(self._exchanges, "no robot said Hello")
            return
        self.exam.limit_pace()
        for place, exchange in enumerate(self._exchanges):
            self.now = exchange.name
            yield from exchange.script(self.exam)
            self._skip([exchange], f"{exchange.name}: {self.exam.said_phase()} before")
            if not stage.heard_within(_SILENCE):
                left = self._exchanges[place + 1 :]
                self._skip(left, f"the robot fell silent when {exchange.name}")
                break
        self.now, stage.phase = "the fleet has ended", OVER
        yield from self.exam.pause(1_000)

    def _skip(self, exchanges: Sequence[Exchange], why: str) -> None:
        """Record why what these exchanges try was not tried."""
        for exchange in exchanges:
            for number in exchange.tries:
                if number not in self.exam.tried:
                    self._could_not.setdefault(number, why)
