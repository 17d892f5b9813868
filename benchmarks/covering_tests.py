"""Which tests run which lines: only these can notice a mutant, the quickest ones first.

Lines of kernels are seen with compilation switched off only.  What a test finds made by another
one, in a cache or a fixture, it does not run again: where a test runs a line, the other tests of
its file are taken for ones that may, too.

Decides: which tests a mutant has to be noticed by.  Must not know: what is damaged, or how.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import coverage
import pytest

from benchmarks.mutants import ROOMS, Mutant
from benchmarks.table import ROOT

PYTEST: Final = ("-q", "--every=11", "-p", "no:cacheprovider")
NO_COMPILING: Final = "NUMBA_DISABLE_JIT"
PLAIN: Final = ("-W", "ignore::RuntimeWarning")
"""Further options without compilation: Python's kernels warn where compiled ones return inf."""
LONGEST: Final = 60
"""Tests that take longer [s] are left out: a mutant must not cost minutes."""


class Covering(NamedTuple):
    """A test, its time [s], and the lines that it runs, by file."""

    name: str
    seconds: float
    lines: dict[str, frozenset[int]]

    @property
    def file(self) -> str:
        """The file that the test stands in."""
        return self.name.partition("::")[0]


class _Watch:
    """A pytest plugin that times tests and has their lines told apart."""

    def __init__(self, measured: coverage.Coverage) -> None:
        self._measured = measured
        self.seconds: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._measured.switch_context(item.nodeid)
        signal.signal(signal.SIGALRM, _too_long)
        signal.alarm(LONGEST)
        began = time.perf_counter()
        try:
            return (yield)
        finally:
            signal.alarm(0)
            self.seconds.setdefault(item.nodeid, round(time.perf_counter() - began, 3))
            self._measured.switch_context("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed:
            self.seconds[report.nodeid] = -1.0


def _too_long(*_: object) -> None:
    raise TimeoutError


def watch(tests: Sequence[str], out: Path) -> None:
    """Run tests in this process and write what they ran, and how long they took, as JSON."""
    files = [str(ROOT / pattern) for room in ROOMS.values() for pattern in room.files]
    measured = coverage.Coverage(data_file=None, include=files, messages=False)
    watching = _Watch(measured)
    measured.start()
    pytest.main(
        [*PYTEST, *(PLAIN if NO_COMPILING in os.environ else ()), *tests], plugins=[watching]
    )
    measured.stop()
    data = measured.get_data()
    lines: dict[str, dict[str, list[int]]] = {}
    for path in data.measured_files():
        file = str(Path(path).relative_to(ROOT))
        for line, names in data.contexts_by_lineno(path).items():
            for name in names:
                lines.setdefault(name, {}).setdefault(file, []).append(line)
    rows = [
        [name, seconds, lines.get(name, {})]
        for name, seconds in watching.seconds.items()
        if seconds >= 0.0
    ]
    out.write_text(json.dumps(rows))


def tests_of(room: str, is_plain: bool, kept: Path) -> list[Covering]:
    """Return the tests of a room by their times, watched once and kept in a folder."""
    file = kept / f"{room}{'-plain' if is_plain else ''}.json"
    if not file.exists():
        kept.mkdir(parents=True, exist_ok=True)
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        if is_plain:
            environment[NO_COMPILING] = "1"
        command = [sys.executable, "-m", "benchmarks.covering_tests", str(file)]
        subprocess.run([*command, *ROOMS[room].tests], cwd=ROOT, env=environment, check=True)
    rows: list[Any] = json.loads(file.read_text())
    found = [
        Covering(name, seconds, {path: frozenset(own) for path, own in lines.items()})
        for name, seconds, lines in rows
    ]
    return sorted(found, key=lambda one: one.seconds)


def covering(mutant: Mutant, tests: Sequence[Covering], budget: float) -> list[Covering]:
    """Return the tests that may notice a mutant, those that run its lines first.

    What is run when a file is imported may be noticed by every test.  Files take turns, each with
    its quickest test that is left.  Together they take no longer than the budget [s].
    """
    span = frozenset(range(mutant.first, mutant.last + 1))
    direct = [one for one in tests if span & one.lines.get(mutant.file, frozenset())]
    if direct:
        files = {one.file for one in direct}
        others = [one for one in tests if one.file in files]
    else:
        direct = [one for one in tests if mutant.file in one.lines]
        others = list(tests)
    return in_turn(direct, budget, others)


def in_turn(
    tests: Sequence[Covering], budget: float, others: Sequence[Covering] = ()
) -> list[Covering]:
    """Return tests, then others, that together take no longer than a budget [s].

    Files take turns, each with its quickest test that is left.
    """
    by_name = {one.name: one for one in [*_in_turn(tests), *_in_turn(others)]}
    chosen, total = [], 0.0
    for one in by_name.values():
        if total + one.seconds <= budget:
            chosen.append(one)
            total += one.seconds
    return chosen


def _in_turn(tests: Sequence[Covering]) -> list[Covering]:
    """Return tests, which are sorted by time, so that their files take turns."""
    turns: list[tuple[int, float, Covering]] = []
    taken: dict[str, int] = {}
    for one in tests:
        taken[one.file] = taken.get(one.file, 0) + 1
        turns.append((taken[one.file], one.seconds, one))
    return [one for *_, one in sorted(turns, key=lambda turn: turn[:2])]


if __name__ == "__main__":
    watch(sys.argv[2:], Path(sys.argv[1]))
