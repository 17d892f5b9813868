"""All benchmarks: `python -m benchmarks [PART ...]`; without a part all of them.

Prints tables and writes benchmarks/results/PART.json.  Times are medians of several runs on this
machine; where another library does the same, both are measured in the same run and a ratio is
given.  Nothing here asserts a time.
"""

from __future__ import annotations

import json
import os
import platform
import sys
from collections.abc import Callable
from functools import partial
from typing import Final

from benchmarks.against_paper import against_paper
from benchmarks.agent import agent
from benchmarks.beyond import beyond
from benchmarks.curves import curves
from benchmarks.desk import desk
from benchmarks.disturbance import disturbance
from benchmarks.explore import explore
from benchmarks.firmware import c_fleets, comparison, instructions, native_module, sizes
from benchmarks.flood import flood
from benchmarks.flow import circles, flow
from benchmarks.fuzz.running import fuzz_all
from benchmarks.fuzz.table import MODULES
from benchmarks.intersections import intersections
from benchmarks.live_orders import live_orders
from benchmarks.locks import arming
from benchmarks.making_room import making_room
from benchmarks.movingai import movingai
from benchmarks.orders import cobra, orders
from benchmarks.paths import against_peers, fleets, for_robots
from benchmarks.planning import planning
from benchmarks.proof import proving, sharpness
from benchmarks.quality import quality
from benchmarks.recording import recording, writing
from benchmarks.refusals import refusals
from benchmarks.reliability import campaigns
from benchmarks.replays import replays
from benchmarks.safety import safety
from benchmarks.swaps import swaps
from benchmarks.table import ROOT, Row, show
from benchmarks.whole_plan import whole_plan
from benchmarks.zones import zones

PARTS: Final[dict[str, dict[str, Callable[[], list[Row]]]]] = {
    "curves": {"evaluating a rational cubic with 12 control points": curves},
    "paths": {
        "shortest ways, compared with other libraries": against_peers,
        "shortest ways, ours for points and for robots": for_robots,
        "path stage: all robots of a floor, with the proof of clearance": fleets,
    },
    "intersections": {"all intersections of two curves": intersections},
    "zones": {"conflict zones of a whole fleet": zones},
    "proof": {"the proof stage": proving, "damaged plans against the dense sampler": sharpness},
    "planning": {
        "planning whole scenes": planning,
        "the whole command, including its process": whole_plan,
    },
    "swaps": {"rings and circles, compared with other planners": swaps},
    "quality": {"sums of delays, compared with the optimum": quality},
    "paper": {"comparison with Algorithm 2 of the paper": against_paper},
    "explore": {"all runs of two robots' real cores with up to two faults": explore},
    "safety": {"seeded scenarios, judged by a dense sampler": partial(safety, 200)},
    "reliability": {"seeded fleets with 1 to 4 faults": partial(campaigns, 500)},
    "disturbance": {"robots stopped, Commands lost": disturbance},
    "orders": {
        "a day's work: four orders a robot": orders,
        "COBRA's experiment on floors of the same kind": cobra,
    },
    "live_orders": {"orders given to live processes": live_orders},
    "beyond": {"beyond every budget": beyond},
    "replays": {"logs of faulty runs, replayed": replays},
    "agent": {"one tick of the robot's core": agent},
    "firmware": {
        "the agent in C on a Cortex-M4F": sizes,
        "instructions on an emulated Cortex-M4F": instructions,
        "the native module of MicroPython on an emulated Cortex-M4F": native_module,
        "both agents on the same events": comparison,
        "fleets of C agents with 1 to 4 faults": c_fleets,
    },
    "flow": {
        "delays of whole fleets, with and without ways in space and time, and by ORCA": flow,
        "circles, compared with a roundabout by hand": circles,
    },
    "flood": {"a fleet beside a flood": flood},
    "desk": {"a fleet whose desk is asked much, and nonsense": desk},
    "fuzz": {"bad input, 30 s per target": partial(fuzz_all, list(MODULES))},
    "locks": {"arming a fleet without and with keys": arming},
    "refusals": {"refused scenes, searched exhaustively": refusals},
    "ways": {"robots that have to make room for each other": partial(making_room, 3)},
    "movingai": {"discs on maps of MovingAI's kinds": movingai},
    "recording": {
        "recording what arrives over Zenoh": recording,
        "the recorder alone, with the traffic of 100 robots": writing,
    },
}


def main() -> None:
    """Run the parts named on the command line, print their tables and write the results."""
    chosen = sys.argv[1:] or list(PARTS)
    unknown = [name for name in chosen if name not in PARTS]
    if unknown:
        sys.stderr.write(f"unknown part {unknown[0]!r}, the parts are {', '.join(PARTS)}\n")
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
