"""Kernels are compiled or loaded before anything is timed, not in the middle of a plan."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.processes

_ROOT = Path(__file__).resolve().parents[3]

_PLANS = """
from pathlib import Path
from coordinator.planning.warm import load_kernels, compile_rest

load_kernels()
seen = set()

import coordinator.base.compiled
from numba.core.dispatcher import Dispatcher

compiled = Dispatcher.compile


def told(self, signature):
    seen.add(self.py_func.__name__)
    return compiled(self, signature)


Dispatcher.compile = told

from coordinator.planning.planner import plan_fleet
from coordinator.mission.fleet_from_plan import muster
from coordinator.scenario_files.scenario_reader import read_scenario

scenario = read_scenario(Path("examples/paper_five.toml"))
plan_fleet(scenario)
print(sorted(seen))
compile_rest()
seen.clear()
for name in ("paper_five_real", "u_trap", "circle_swap", "map_ros", "map_movingai", "map_dxf"):
    scenario = read_scenario(Path(f"examples/{name}.toml"))
    muster(plan_fleet(scenario), 1).grants.grant(0, 0)
print(sorted(seen))
"""


_CALLS = """
import functools
import coordinator.base.compiled as base

kernels, left, known = set(), [], set()


def recorded(function):
    @functools.wraps(function)
    def called(*values, **named):
        left.append(called)
        return function(*values, **named)

    kernels.add(called)
    return called


base.compiled = recorded
from coordinator.planning.warm import load_kernels, compile_rest

load_kernels()
compile_rest()
while left:  # numba compiles what a kernel may call, too.
    kernel = left.pop()
    if kernel in kernels - known:
        known.add(kernel)
        inner = kernel.__wrapped__
        used = [inner.__globals__.get(name) for name in inner.__code__.co_names]
        left += [one for one in used if callable(one)]
print(sorted(kernel.__qualname__ for kernel in kernels - known))
"""


def test_every_kernel_is_compiled_ahead_of_time():
    """Otherwise the cache never counts as filled, and each command compiles again."""
    plain = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONWARNINGS": "ignore"}
    run = subprocess.run(
        [sys.executable, "-c", _CALLS],
        cwd=_ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        env=plain,
    )
    assert (run.stderr, run.stdout) == ("", "[]\n")


def test_no_kernel_is_left_for_plans_to_compile():
    run = subprocess.run(
        [sys.executable, "-c", _PLANS], cwd=_ROOT, capture_output=True, text=True, timeout=300
    )
    assert run.stderr == ""
    assert run.stdout.split("\n")[:2] == ["[]", "[]"]
