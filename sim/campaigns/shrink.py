"""The smallest fault list that still fails.

Decides: in which order lists are made smaller.  Must not know: what failing means.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from sim.world.fault_text import Fault


def shrink(faults: Sequence[Fault], fails: Callable[[list[Fault]], bool]) -> list[Fault]:
    """Return a part of the faults that still fails, times and values as round as they can be.

    `fails` is asked a few times per fault; the list given is taken to fail.
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
    """Round the time, and a value that rounding does not make nothing of."""
    value = round(fault.value, digits) if math.isfinite(fault.value) else fault.value
    return replace(fault, time=round(fault.time, digits), value=value or fault.value)
