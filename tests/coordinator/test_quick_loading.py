"""Kept machine code loads without its bitcode, and still serves what is compiled later."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

_KERNELS = """
from coordinator.compiled import compiled


@compiled
def twice(x: float) -> float:
    return 2.0 * x
"""

_CALLER = """
import sys
import coordinator.compiled as compiled
import numba

compiled.numba.config.CACHE_DIR = sys.argv[1]
compiled._choose_cache = lambda file: None
import some_kernels

print(some_kernels.twice(2.0), sum(some_kernels.twice.stats.cache_hits.values()))
print("scipy.linalg" in sys.modules)


@numba.njit
def later(x):
    return some_kernels.twice(x) + 1.0


print(later(1.5))
"""


def _run(folder: Path) -> list[str]:
    (folder / "some_kernels.py").write_text(_KERNELS, encoding="utf-8")
    (folder / "caller.py").write_text(_CALLER, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, folder / "caller.py", folder / "cache"],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    return done.stdout.split()


def test_kernels_that_were_loaded_can_be_compiled_against_and_load_no_linear_algebra(
    tmp_path: Path,
) -> None:
    first, second = _run(tmp_path), _run(tmp_path)
    assert first == ["4.0", "0", "False", "4.0"]
    assert second == ["4.0", "1", "False", "4.0"]
