"""Kept machine code loads without its bitcode, and still serves what is compiled later."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.processes

_ROOT = Path(__file__).resolve().parents[3]

_KERNELS = """
import numpy as np

from coordinator.base.compiled import compiled


@compiled
def twice(x: float) -> float:
    return 2.0 * x


@compiled
def sorted_sums(rows):
    if rows.shape[0] == 0:
        raise ValueError("no rows")
    return np.sort(np.sum(rows, axis=1))[::-1].copy()


@compiled
def hashed(x: float) -> int:
    return hash(x)
"""

_HIDDEN = """
import sys

import numba

NAMES = [
    "codegen.JITCodeLibrary",
    "codegen.JitEngine",
    "caching.Cache",
    "caching.FunctionCache",
    "cpu.CPUContext",
    "environment",
    "runtime.rtsys",
    "runtime.nrt.nrtdynmod",
]


def owner_of(path):
    *owners, name = path.split(".")
    owner = numba.core
    for one in owners:
        owner = getattr(owner, one)
    return owner, name


hidden = [(*owner_of(path), getattr(*owner_of(path))) for path in NAMES]
for owner, name, _ in hidden:
    delattr(owner, name)
import coordinator.base.compiled
for owner, name, value in hidden:
    setattr(owner, name, value)
"""

_CALLER = """
import sys
from pathlib import Path

import numba
import numpy as np
from coordinator.base import kernel_cache

NOT_NEEDED = "scipy.linalg", "numba.np.arrayobj"
kernel_cache.places = lambda: (Path(sys.argv[1]),)
import some_kernels

print(some_kernels.twice(2.0), sum(some_kernels.twice.stats.cache_hits.values()))
print(some_kernels.sorted_sums(np.array([[1.0, 2.0], [3.0, 4.0]])).tolist())
try:
    some_kernels.sorted_sums(np.zeros((0, 2)))
except ValueError as error:
    print(error)
print(some_kernels.hashed(0.5) == hash(0.5))
print([name for name in NOT_NEEDED if name in sys.modules])


@numba.njit
def later(x):
    return some_kernels.twice(x) + 1.0


print(later(1.5))
"""


def _run(folder: Path, before: str = "") -> list[str]:
    (folder / "some_kernels.py").write_text(_KERNELS, encoding="utf-8")
    (folder / "caller.py").write_text(before + _CALLER, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, folder / "caller.py", folder / "cache"],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
        env=os.environ | {"PYTHONPATH": str(_ROOT)},
    )
    return done.stdout.splitlines()


def test_kernels_that_were_loaded_serve_later_ones_and_leave_the_compiler_unloaded(
    tmp_path: Path,
) -> None:
    first, second = _run(tmp_path), _run(tmp_path)
    answers = ["[7.0, 3.0]", "no rows", "True"]
    assert first[:4] == ["4.0 0", *answers]
    assert "scipy.linalg" not in first[4]
    assert second[:5] == ["4.0 1", *answers, "[]"]
    assert first[5] == second[5] == "4.0"


def test_a_numba_that_has_other_names_within_loads_what_it_kept_in_its_own_way(
    tmp_path: Path,
) -> None:
    first, second = _run(tmp_path, _HIDDEN), _run(tmp_path, _HIDDEN)
    assert first[:4] == ["4.0 0", "[7.0, 3.0]", "no rows", "True"]
    assert second[:4] == ["4.0 1", *first[1:4]]
    assert "numba.np.arrayobj" in second[4]
    assert first[5] == second[5] == "4.0"
