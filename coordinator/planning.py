"""Planning on this machine: kernels loaded, a thread per core, stages timed.

Decides: what the planner is given by its shell.  Must not know: how plans are found.
"""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor

from coordinator.compiled import is_compiled
from coordinator.console import tell
from coordinator.plan import PlanDocument
from coordinator.planner import DEFAULT_EFFORT, plan_scenario
from coordinator.scenario import Scenario
from coordinator.warm import compile_rest, load_kernels


def plan_here(scenario: Scenario, effort: int = DEFAULT_EFFORT, epoch: int = 1) -> PlanDocument:
    """Return the plan of a scenario; raises PlanError as planner.plan_scenario does."""
    if not is_compiled():
        tell("compiling the planner's kernels, once; this takes a minute or two")
        compile_rest()
    load_kernels()
    with ThreadPoolExecutor(os.cpu_count()) as executor:
        return plan_scenario(
            scenario, effort=effort, epoch=epoch, timer=time.perf_counter, executor=executor
        )
