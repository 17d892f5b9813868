"""All fuzz targets: `python -m benchmarks.fuzz [--seconds 30] [--jobs 2] [TARGET ...]`.

Every target runs for `--seconds` in a process of its own, at a low priority.  A crash is an
exception that is not a one-line error message, an input that takes too long, or one that takes too
much memory; its input is kept in benchmarks/results/fuzz.  The exit code is 1 after a crash.
"""

from __future__ import annotations

import argparse
import os
import sys

from benchmarks.campaign import record
from benchmarks.fuzz.running import SECONDS, fuzz_all, leftovers
from benchmarks.fuzz.table import MODULES
from benchmarks.table import ROOT


def main() -> None:
    """Run the targets, print the table, write it to benchmarks/results/fuzz.json."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description="Fuzz readers.")
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=", ".join(MODULES))
    parser.add_argument("--seconds", type=int, default=SECONDS)
    parser.add_argument("--jobs", type=int, default=max(1, (os.cpu_count() or 2) // 2))
    asked = parser.parse_args()
    unknown = [name for name in asked.targets if name not in MODULES]
    if unknown:
        parser.error(f"unknown target {unknown[0]!r}, the targets are {', '.join(MODULES)}")
    rows = fuzz_all(asked.targets or list(MODULES), asked.seconds, asked.jobs)
    record("fuzz", {f"bad input, {asked.seconds} s a target": rows})
    for path in leftovers():
        sys.stderr.write(f"{path.relative_to(ROOT)}\n")
    sys.exit(any(row["outcome"] != "no crash" for row in rows))


if __name__ == "__main__":
    main()
