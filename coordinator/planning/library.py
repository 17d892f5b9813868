"""Planning from other programs: the names that `from coordinator import ...` gives.

These names and their signatures do not change from version to version.  docs/tutorial.md uses all
of them, and tests run the tutorial.  Lengths are in metres, times in seconds, angles in radians,
counter-clockwise from +x.

Decides: which functions and types other programs may rely on.  Must not know: how plans are found.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from coordinator.base.errors import InputError, PlanError
from coordinator.curves.nurbs import Array
from coordinator.plan import plan_file
from coordinator.plan.document import PlanDocument as Plan
from coordinator.plan.document import Proof
from coordinator.plan.trajectory import sample
from coordinator.plan.wire import pack, packed, unpack
from coordinator.planning.planner import plan_scenario
from coordinator.proof.verify import prove_messages
from coordinator.scenario.model import GivenPath, Robot, Scenario, Workspace
from coordinator.scenario_files.scenario_reader import parse_scenario
from coordinator.scenario_files.scenario_reader import read_scenario as _read_scenario
from coordinator.schedule.staircase_making import with_staircases

__all__ = [
    "GivenPath",
    "InputError",
    "Plan",
    "PlanError",
    "Proof",
    "Robot",
    "Scenario",
    "Workspace",
    "motion_of",
    "plan_scenario",
    "plan_to_json",
    "prove_plan",
    "read_plan",
    "read_scenario",
    "scenario_from",
]


def scenario_from(document: Mapping[str, object], name: str = "scenario") -> Scenario:
    """Return the scenario that a mapping describes: keys and values as in a scenario file.

    `name` begins each line about a problem.  It also becomes the scenario's name if the mapping
    has none.  Raises InputError with every problem.
    """
    return parse_scenario(json.dumps(document).encode(), f"{name}.json")


def read_scenario(path: str | Path) -> Scenario:
    """Return the scenario in a TOML or JSON file; raises InputError with every problem."""
    return _read_scenario(Path(path))


def read_plan(path: str | Path) -> Plan:
    """Return the plan in a file that `plan_to_json` made; raises InputError with every problem."""
    return plan_file.read(Path(path))


def plan_to_json(plan: Plan) -> bytes:
    """Return a plan as the text of a plan file, plan.json."""
    return plan_file.to_json(plan)


def prove_plan(plan: Plan, scenario: Scenario | None = None) -> Proof:
    """Prove a plan again from the bytes that robots would receive, and return the proof.

    The staircases that a coordinator would grant authority by are made anew and proven as well.
    With a scenario, the plan is proven against the scenario's floor, robots, tau and margin.
    Raises InputError when a robot would not accept its part of the plan.
    """
    return prove_messages(with_staircases(packed(plan)), scenario)


def motion_of(plan: Plan, robot: str, times: npt.ArrayLike) -> Array:
    """Return where a robot is at plan times (m,) [s]: x, y [m], heading, s [m], v [m/s], (m, 5).

    The rows are computed from the message that the robot would receive, as the robot computes
    them.  Raises KeyError for an unknown robot.
    """
    planned = plan.robot(robot)
    driven = unpack(pack(plan, planned, 0), planned.radius)
    return sample(driven, np.atleast_1d(np.asarray(times, dtype=np.float64)).tolist())
