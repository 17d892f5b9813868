"""Sweeps: tests that are run for many seeds: all, each N-th, or a tenth of them (conftest.py)."""

from __future__ import annotations

from typing import Final

QUICK_STEP: Final = 11
"""About a tenth; many generators take kinds of floors in turn, ten of them and fewer."""

_step = 1


def set_step(step: int) -> None:
    """Have sweeps visit each `step`-th seed from now on; asked for before tests are collected."""
    global _step
    _step = step


def seeds(count: int) -> range:
    """Return the seeds of a sweep: 0 to count - 1, or each so many-th of them."""
    return range(0, count, _step)


def enough(count: int) -> int:
    """Return how many cases of a kind a sweep has to meet, of `count` that all seeds have to."""
    return count // _step


def are_whole() -> bool:
    """Return whether every seed is visited, so that heavy cases may be, too."""
    return _step == 1
