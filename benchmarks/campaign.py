"""Campaigns: one measurement for each of many seeds, on two processes, with the results in a file.

Decides: the command-line options of campaigns, and how they are run and written.  Must not know:
what is measured.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from typing import Final, TypeVar

from benchmarks.table import ROOT, Row, show

WORKERS: Final = 2
SAID: Final = 100
"""Progress is printed each time that this many seeds are done."""

Answer = TypeVar("Answer")


def options(about: str | None, count: int, effort: int) -> argparse.Namespace:
    """Return the options on the command line: count, from_seed and effort."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--from-seed", type=int, default=0)
    parser.add_argument("--effort", type=int, default=effort)
    return parser.parse_args()


def in_turn(measure: Callable[[int], Answer], seeds: Sequence[int]) -> list[Answer]:
    """Return the measurements of all seeds, in order; progress is printed on stderr.

    Raises RuntimeError with the first seed that has no result when a process dies.
    """
    answers: list[Answer] = []
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        try:
            for answer in pool.map(measure, seeds):
                answers.append(answer)
                if len(answers) % SAID == 0:
                    sys.stderr.write(f"{len(answers)} done\n")
        except BrokenProcessPool:
            seed = seeds[len(answers)]
            raise RuntimeError(f"a process died with seed {seed} or one soon after") from None
    return answers


def record(name: str, tables: dict[str, list[Row]]) -> None:
    """Print tables and write them to benchmarks/results/NAME.json."""
    for title, rows in tables.items():
        show(title, rows)
    folder = ROOT / "benchmarks" / "results"
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.json").write_text(json.dumps(tables, indent=1) + "\n")
