"""Kernels that make no arrays: what they may return; they keep nothing of what they are given."""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from numba.core.errors import NumbaError

from coordinator.base.compiled import allocation_free, compiled

Array = npt.NDArray[np.float64]


class Span(NamedTuple):
    low: float
    high: float


class Box(NamedTuple):
    low: Array
    high: Array


@allocation_free
def span_of(box: Box, k: int) -> Span:
    return Span(box.low[k], box.high[k])


@compiled
def widest(box: Box) -> float:
    found = 0.0
    for k in range(len(box.low)):
        span = span_of(box, k)
        found = max(found, span.high - span.low)
    return found


def test_an_allocation_free_kernel_leaves_the_references_to_its_arrays_as_they_were():
    box = Box(np.array([0.0, 1.0]), np.array([1.0, 4.0]))
    before = [sys.getrefcount(one) for one in box]
    assert widest(box) == 3.0
    assert span_of(box, 1) == (1.0, 4.0)
    assert [sys.getrefcount(one) for one in box] == before


def test_an_allocation_free_kernel_may_not_return_an_array():
    def first(box: Box) -> Array:
        return box.low

    def both(box: Box) -> tuple[float, Array]:
        return box.low[0], box.high

    def whole(box: Box) -> Box:
        return box

    for function in (first, both, whole):
        with pytest.raises(TypeError, match=f"{function.__name__} may return only numbers"):
            allocation_free(function)


def test_an_allocation_free_kernel_that_makes_an_array_is_refused_when_it_is_compiled():
    def total(values: Array) -> float:
        return float(np.cumsum(values)[-1])

    with pytest.raises(NumbaError):
        allocation_free(total)(np.ones(3))
