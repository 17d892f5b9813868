"""All benchmarks: `python -m benchmarks [PART ...]`; without a part all of them.

Prints tables and writes benchmarks/results/PART.json.  Times are medians of several runs on this
machine; what can be compared is compared with a peer in the same run, as a ratio.  Nothing here
asserts a time.
"""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Callable
from typing import Final

from benchmarks.agent import agent
from benchmarks.curves import curves
from benchmarks.paths import against_peers, fleets, for_robots
from benchmarks.planning import planning
from benchmarks.table import ROOT, Row, show

PARTS: Final[dict[str, dict[str, Callable[[], list[Row]]]]] = {
    "curves": {"evaluating a rational cubic with 12 control points": curves},
    "paths": {
        "shortest ways, against peers": against_peers,
        "shortest ways, ours for points and for robots": for_robots,
        "path stage: all robots of a floor, proof of clearance included": fleets,
    },
    "planning": {"planning whole scenes": planning},
    "agent": {"one tick of the robot's core": agent},
}


def main() -> None:
    """Run the parts that are asked for, print their tables and write the results."""
    chosen = sys.argv[1:] or list(PARTS)
    unknown = [name for name in chosen if name not in PARTS]
    if unknown:
        sys.stderr.write(f"unknown part {unknown[0]!r}, there are {', '.join(PARTS)}\n")
        sys.exit(2)
    folder = ROOT / "benchmarks" / "results"
    folder.mkdir(exist_ok=True)
    for name in chosen:
        results = {}
        for title, measure in PARTS[name].items():
            results[title] = measure()
            show(title, results[title])
        about = {
            "python": platform.python_version(),
            "machine": platform.machine(),
            "cores": os.cpu_count(),
            "load": os.getloadavg(),
        }
        (folder / f"{name}.json").write_text(json.dumps(about | results, indent=1) + "\n")


if __name__ == "__main__":
    main()
