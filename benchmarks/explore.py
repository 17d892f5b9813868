"""All runs of a small fleet's real cores: `python -m benchmarks explore --robots 2 --faults 2`.

States are visited depth first, those with fewer faults first, until all are or the time is over.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from benchmarks.table import Row
from tests.exploration.explorer import Explorer, Found, seconds_of

STEPS = 60
"""Steps in which the fleet sets out, crosses and arrives, with what faults cost."""


def explore() -> list[Row]:
    """Return what is found with two robots and a fault, and for two minutes with two faults."""
    return [_row(2, 1, explored(2, 1, STEPS, 10.0)), _row(2, 2, explored(2, 2, STEPS, 2.0))]


def explored(robots: int, faults: int, depth: int, minutes: float) -> Found:
    """Explore, at most so long."""
    return Explorer(robots, faults).explore(depth, 60.0 * minutes)


def _row(robots: int, faults: int, found: Found) -> Row:
    return {
        "robots": robots,
        "faults": faults,
        "states": found.states,
        "steps made": found.steps,
        "deepest": found.deepest,
        "runs to the end": found.ends,
        "CPU min": round(found.seconds / 60.0, 1),
        "all": found.is_complete,
        "broken": found.broken,
    }


def main(words: Sequence[str]) -> int:
    """Explore as the command line says; 1 if a state was found that may not be."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks explore", description=__doc__)
    parser.add_argument("--robots", type=int, choices=(2, 3), default=2)
    parser.add_argument("--faults", type=int, default=1)
    parser.add_argument("--depth", type=int, default=STEPS, help="steps of 0.2 s")
    parser.add_argument("--minutes", type=float, default=60.0, help="of the CPU")
    asked = parser.parse_args(words)
    found = explored(asked.robots, asked.faults, asked.depth, asked.minutes)
    for name, value in _row(asked.robots, asked.faults, found).items():
        sys.stdout.write(f"{name:16} {value}\n")
    for step, fault in found.way if found.broken else ():
        sys.stdout.write(f"  after {seconds_of(step):.1f} s: {fault.kind} {fault.which}\n")
    return 1 if found.broken else 0
