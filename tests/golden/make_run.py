"""Make the run of this version that later versions must be able to read.

Run as `python -m tests.golden.make_run` for a release; the folder is never changed after it.  A
robot is lost, others go around it, and orders are done.  `facts.json` holds what `info`, `verify`
and `judge` say of the run, as its own version reads it.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from typer.testing import CliRunner

from splinefleet import app

RUNS: Final = Path(__file__).with_name("runs")
KEPT: Final = ("run.mcap", "plan.json", "scenario.json", "blackbox")
SCENARIO: Final = """name = "three"

[workspace]
boundary = [[0, 0], [8, 0], [8, 5], [0, 5]]
obstacles = [[[3.5, 2.0], [4.5, 2.0], [4.5, 3.0], [3.5, 3.0]]]

[[robots]]
id = "R1"
radius = 0.2
max_speed = 0.8
max_accel = 0.8
start = [1, 1, 0]
goal = [7, 4]

[[robots]]
id = "R2"
radius = 0.2
max_speed = 0.8
max_accel = 0.8
start = [7, 1, 3.14]
goal = [1, 4]

[[robots]]
id = "R3"
radius = 0.2
max_speed = 0.8
max_accel = 0.8
start = [1, 2.5, 0]

[[orders]]
id = "parts"
robot = "R3"
goal = [6, 2.5]
release = 1.0

[[orders]]
id = "tools"
goal = [2, 1]
release = 6.0
"""


def facts(run: Path) -> dict[str, Any]:
    """Return what the commands say of a run, without what later versions may add or word anew."""
    told = _said("info", str(run / "run.mcap"), "--json")
    proof = _said("verify", str(run / "run.mcap"), "--json")
    judged = _said("judge", str(run), "--json")
    return {
        "duration": told["duration"],
        "messages": told["messages"],
        "bad_messages": told["bad_messages"],
        "phases": [one["phases"] for one in told["epochs"]],
        "arrivals": [one["arrivals"] for one in told["epochs"]],
        "orders": {one["id"]: [one["robot"], one["state"]] for one in told["orders"]},
        "lost": [one["robot"] for one in told["faults"]],
        "held": [[one["robot"], one["by"]] for one in told["held"]],
        "stops": {name: len(one["stops"]) for name, one in told["robots"].items()},
        "holds": proof["holds"],
        "commands": [one["commands"] for one in proof["epochs"]],
        "courses": [one["courses"] for one in proof["epochs"]],
        "collisions": judged["collisions"],
        "arrived": {one["id"]: one["t"] for one in judged["robots"]},
    }


def _said(*command: str) -> dict[str, Any]:
    done = CliRunner().invoke(app, command)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def main() -> None:
    """Write the run of this version."""
    kept = RUNS / version("splinefleet")
    with TemporaryDirectory() as name:
        folder, scenario = Path(name) / "run", Path(name) / "three.toml"
        scenario.write_text(SCENARIO)
        options = ("--fault", "kill:R2@4", "--box-rate", "5", "--out", str(folder))
        CliRunner().invoke(app, ["simulate", str(scenario), *options])
        for part in KEPT:
            for file in [folder / part, *(folder / part).glob("*")]:
                if file.is_file():
                    copy = kept / file.relative_to(folder)
                    copy.parent.mkdir(parents=True, exist_ok=True)
                    copy.write_bytes(file.read_bytes())
    (kept / "facts.json").write_text(json.dumps(facts(kept), indent=1) + "\n")


if __name__ == "__main__":
    main()
