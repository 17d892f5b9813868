"""A campaign for the command line: progress, shrinking, and commands that reproduce failures.

Decides: what is shrunk, and which command repeats a run.  Must not know: what a run consists of.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rich.progress import Progress

from coordinator.base.console import errors
from coordinator.scenario.model import Link, Scenario
from sim.campaigns.answer import Answer, Tally, Violation
from sim.campaigns.campaign import LINKS, Outcome, Wish, plan_for
from sim.campaigns.pool import attempt, run_all
from sim.campaigns.shrink import shrink
from sim.world.fault_script import USUAL, read_faults, write_fault
from sim.world.fault_text import Fault

NO_FAULT: Final = "none"
"""The text for an empty list of faults."""

MOST_SHRUNK: Final = 3
"""At most this many violations are shrunk, because shrinking takes many runs."""


@dataclass(frozen=True)
class Campaign:
    """A scenario, its file, bounds of random choices, and faults that replace random ones."""

    scenario: Scenario
    file: Path
    wish: Wish
    faults: Sequence[Fault] | None = None

    def run(self, seeds: Sequence[int], executor: Executor) -> Answer:
        """Run all seeds; PlanError when the scenario has no plan."""
        worst = LINKS[-1]
        link = Link(delay=min(worst.delay, self.wish.delay), loss=min(worst.loss, self.wish.loss))
        plan_for(self.scenario, link, self.wish.tau)
        tally = Tally()
        violations: list[Violation] = []
        with Progress(console=errors, transient=True) as progress:
            task = progress.add_task("runs", total=len(seeds))
            for outcome in run_all(self.scenario, seeds, self.wish, self.faults, executor):
                tally.add(outcome)
                progress.advance(task)
                if outcome.violations:
                    violations.append(self._violation(outcome, len(violations) < MOST_SHRUNK))
        return tally.answer(violations)

    def _violation(self, outcome: Outcome, shrunk: bool) -> Violation:
        faults = None
        if shrunk and outcome.faults:
            names = [robot.id for robot in self.scenario.robots]
            faults = shrink(
                read_faults(outcome.faults, names),
                lambda fewer: bool(
                    attempt(self.scenario, outcome.seed, self.wish, fewer).violations
                ),
            )
        return Violation(outcome.seed, self.command(outcome.seed, faults), outcome.violations)

    @classmethod
    def asked(
        cls, scenario: Scenario, file: Path, wish: Wish, texts: Sequence[str] | None
    ) -> Campaign:
        """Return the campaign with these faults; InputError with a line per invalid text."""
        names = [robot.id for robot in scenario.robots]
        given = [text for text in texts or () if text != NO_FAULT]
        faults = read_faults(given, names)
        return cls(scenario, file, wish, faults if texts else None)

    def command(self, seed: int, faults: Sequence[Fault] | None = None) -> str:
        """Return the command that runs one seed again, with these faults or the campaign's."""
        words = [
            "splinefleet",
            "campaign",
            str(self.file),
            "--seeds",
            "1",
            "--from-seed",
            str(seed),
        ]
        if faults is None:
            faults = self.faults
        if faults is None and self.wish.kinds != USUAL:
            words += ["--faults", ",".join(self.wish.kinds)]
        if faults is not None:
            for text in [write_fault(fault) for fault in faults] or [NO_FAULT]:
                words += ["--fault", text]
        for option, value, usual in (
            ("--loss", self.wish.loss, LINKS[-1].loss),
            ("--delay-ms", 1000.0 * self.wish.delay, 1000.0 * LINKS[-1].delay),
            ("--tau", self.wish.tau, None),
        ):
            if value != usual:
                words += [option, f"{value:g}"]
        return shlex.join(words)
