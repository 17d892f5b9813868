"""Plan on this machine, or with others: load the kernels, use all cores, and time the stages.

Decides: which executor and timer the planner gets, and which scenarios are driven.  Must not know:
how plans are found.
"""

from __future__ import annotations

import gc
import os
import time
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext

from coordinator.base.errors import InputError, PlanError, SeveralRobotsError
from coordinator.paths.path_planner import closed_in
from coordinator.plan.wire import PackedPlan
from coordinator.planning.planner import DEFAULT_EFFORT, Timer, plan_fleet
from coordinator.scenario.model import Scenario
from coordinator.service.kernel_setup import get_kernels_ready


def check_is_driven(scenario: Scenario) -> None:
    """Raise InputError if the plans of a scenario are for study only."""
    if scenario.policy != "safe":
        name, policy = scenario.name, scenario.policy
        raise InputError([f"{name}: policy: {policy!r} is for study; a fleet drives only 'safe'"])


def plan_here(
    scenario: Scenario,
    effort: int = DEFAULT_EFFORT,
    epoch: int = 1,
    timer: Timer = time.perf_counter,
    executor: Executor | None = None,
) -> PackedPlan:
    """Return the plan of a scenario; raise PlanError as planner.plan_fleet does.

    Without an executor, a thread per core is used.  The error of the first epoch tells all robots
    that have no way, not only the first of them.
    """
    get_kernels_ready()
    if epoch == 1:
        gc.freeze()  # What was imported stays: to look through it takes a tenth of the time.
    try:
        with nullcontext(executor) if executor else ThreadPoolExecutor(os.cpu_count()) as given:
            return plan_fleet(scenario, effort=effort, epoch=epoch, timer=timer, executor=given)
    except PlanError as error:
        closed = list(closed_in(scenario).values()) if epoch == 1 and error.robot else []
        if len(closed) > 1:
            raise SeveralRobotsError(closed) from None
        raise
