"""The smallest fault list that still fails.

Decides: in which order lists are made smaller.  Must not know: what failing means.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from sim.world.fault_text import Fault


def shrink(faults: Sequence[Fault], fails: Callable[[list[Fault]], bool]) -> list[Fault]:
    """Return a sublist of the faults that still fails, with times and values rounded if possible.

    `fails` is called a few times per fault.  The whole list is assumed to fail.
    """
    smallest = _fewest(list(faults), fails)
    for index in range(len(smallest)):
        for digits in (0, 1):
            rounder = list(smallest)
            rounder[index] = _rounded(smallest[index], digits)
            if rounder != smallest and fails(rounder):
                smallest = rounder
                break
    return smallest


def _fewest(faults: list[Fault], fails: Callable[[list[Fault]], bool]) -> list[Fault]:
    """Leave faults out one by one for as long as what remains fails."""
    index = 0
    while index < len(faults):
        fewer = faults[:index] + faults[index + 1 :]
        if fails(fewer):
            faults, index = fewer, 0
        else:
            index += 1
    return faults


def _rounded(fault: Fault, digits: int) -> Fault:
    """Round the time of a fault, and its value unless that would become 0."""
    value = round(fault.value, digits) if math.isfinite(fault.value) else fault.value
    return replace(fault, time=round(fault.time, digits), value=value or fault.value)
