"""All runs of a small fleet's real cores: `python -m benchmarks.explore --robots 2 --faults 2`.

The search is made in parts, by the step of the first fault and by which fault that is, on several
processes.  With `--kept FILE` it goes on where it stopped.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from benchmarks.campaign import WORKERS, in_turn
from benchmarks.table import Row, show
from tests.exploration.explorer import Explorer, Found, Part, seconds_of

STEPS = 60
"""Steps in which the fleet sets out, crosses and arrives, with what faults cost."""

STANDS_ON = ("coordinator", "protocol", "robot_agent", "tests/exploration")
"""The folders whose sources the search depends on."""


def explore() -> list[Row]:
    """Return what is found with two robots and a fault, and in two minutes with two faults."""
    return [
        _row(faults, [Explorer(2, faults).explore(STEPS, 60.0 * minutes)])
        for faults, minutes in ((1, 10.0), (2, 2.0))
    ]


def explored(
    robots: int, faults: int, depth: int, pieces: int, jobs: int, kept: Path | None
) -> list[Found]:
    """Return what each part found, with the faults of each step in so many pieces."""
    parts = [(step, piece, pieces) for step in range(1, depth + 1) for piece in range(pieces)]
    measure = partial(part_found, robots, faults, depth)
    return in_turn(measure, parts, jobs, kept, STANDS_ON)


def part_found(robots: int, faults: int, depth: int, part: Sequence[int]) -> Found:
    """Return what a part found."""
    return Explorer(robots, faults).explore(depth, part=Part(*part))


def _row(faults: int, found: Sequence[Found]) -> Row:
    return {
        "faults": faults,
        "states": sum(one.states for one in found),
        "steps made": sum(one.steps for one in found),
        "deepest": max(one.deepest for one in found),
        "runs to the end": sum(one.ends for one in found),
        "CPU min": round(sum(one.seconds for one in found) / 60.0, 1),
        "all": all(one.is_complete for one in found),
        "broken": sum(bool(one.broken) for one in found),
    }


def main(words: Sequence[str] | None = None) -> int:
    """Explore as the command line says; 1 if a state was found that may not be."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.explore", description=__doc__)
    parser.add_argument("--robots", type=int, choices=(2, 3), default=2)
    parser.add_argument("--faults", type=int, default=1)
    parser.add_argument("--depth", type=int, default=STEPS, help="steps of 0.2 s")
    parser.add_argument("--pieces", type=int, default=1, help="parts of each step's faults")
    parser.add_argument("--jobs", type=int, default=WORKERS, help="how many processes")
    parser.add_argument("--kept", type=Path, help="a file with parts to go on from")
    asked = parser.parse_args(words)
    size = (asked.robots, asked.faults, asked.depth, asked.pieces)
    found = explored(*size, asked.jobs, asked.kept)
    show(f"{asked.robots} robots", [_row(asked.faults, found)])
    broken = [one for one in found if one.broken]
    for one in broken:
        sys.stdout.write(f"{one.broken}\n")
        for step, fault in one.way:
            sys.stdout.write(f"  after {seconds_of(step):.1f} s: {fault.kind} {fault.which}\n")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
