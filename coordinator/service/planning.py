"""Planning on this machine: kernels loaded, a thread per core, stages timed.

Decides: what the planner is given by its shell.  Must not know: how plans are found.
"""

from __future__ import annotations

import functools
import os
import time
from concurrent.futures import ThreadPoolExecutor

from coordinator.base.console import tell
from coordinator.base.kernel_cache import is_filled, places, writable_place
from coordinator.plan.wire import PackedPlan
from coordinator.planning.planner import DEFAULT_EFFORT, plan_fleet
from coordinator.planning.warm import compile_rest, load_kernels
from coordinator.scenario.model import Scenario


def plan_here(scenario: Scenario, effort: int = DEFAULT_EFFORT, epoch: int = 1) -> PackedPlan:
    """Return the plan of a scenario; raises PlanError as planner.plan_fleet does."""
    _get_kernels_ready()
    with ThreadPoolExecutor(os.cpu_count()) as executor:
        return plan_fleet(
            scenario, effort=effort, epoch=epoch, timer=time.perf_counter, executor=executor
        )


@functools.cache
def _get_kernels_ready() -> None:
    """Load the kernels; where they have to be compiled first, say so, and compile all of them."""
    if not is_filled():
        tell(f"compiling the planner's kernels, {_how_often()}; this takes a minute or two")
        compile_rest()
    load_kernels()


def _how_often() -> str:
    """Tell whether the kernels have to be compiled again next time, and why."""
    if writable_place() is not None:
        return "once"
    return f"for this process alone, as {' and '.join(map(str, places()))} cannot be written"
