"""Pieces of curves: which of two curves' pieces are left over once their ends are trimmed."""

import numpy as np
import pytest

from coordinator.curves.bezier_kernels import CurvePair, Pieces, boxes_apart, facing
from tests.sweeps import seeds


def pieces_of(*chains):
    """Pieces of which only the boxes count, those of the legs of each chain (n, 2)."""
    boxes = [
        np.concatenate((np.minimum(c[:-1], c[1:]), np.maximum(c[:-1], c[1:])), axis=1)
        for c in chains
    ]
    first = np.cumsum([0, *map(len, boxes)])
    count, none = len(chains), np.empty((0, 3))
    start, degree = np.zeros(first[-1], np.int64), np.ones(count, np.int64)
    return Pieces(first, degree, start, none, np.empty((0, 2)), np.concatenate(boxes))


def left_of(pieces, tolerance=1e-3, one=0, other=1):
    return facing(CurvePair(pieces, one, other), tolerance, np.empty(4))


def walk(random, count):
    return np.cumsum(random.normal(0.0, 1.0, (count, 2)), axis=0) + random.uniform(-8.0, 8.0, 2)


@pytest.mark.parametrize("seed", seeds(60))
def test_every_pair_of_near_boxes_is_left(seed):
    random = np.random.default_rng(seed)
    pieces = pieces_of(*(walk(random, int(random.integers(2, 40))) for _ in range(2)))
    begin, end, its_begin, its_end = left_of(pieces)
    for i in range(pieces.first[0], pieces.first[1]):
        for j in range(pieces.first[1], pieces.first[2]):
            if not boxes_apart(pieces.boxes[i], pieces.boxes[j], 1e-3):
                assert begin <= i < end
                assert its_begin <= j < its_end


def test_of_long_lines_that_cross_only_what_is_near_the_crossing_is_left():
    along = np.linspace(0.0, 100.0, 101)
    pieces = pieces_of(np.column_stack((along, along)), np.column_stack((along, 60.0 - along)))
    begin, end, its_begin, its_end = left_of(pieces)
    assert begin <= 30 < end
    assert end - begin + its_end - its_begin < 130
    level = pieces_of(
        np.column_stack((along, 0.0 * along)), np.column_stack((0 * along + 7, along))
    )
    begin, end, its_begin, its_end = left_of(level)
    assert (end - begin, its_end - its_begin) == (2, 1)


def test_of_a_curve_and_itself_all_is_left_and_of_strangers_nothing():
    chain = walk(np.random.default_rng(1), 20)
    pieces = pieces_of(chain, chain + 1000.0)
    assert left_of(pieces, other=0) == (0, 19, 0, 19)
    begin, end, its_begin, its_end = left_of(pieces)
    assert (end - begin) * (its_end - its_begin) == 0
