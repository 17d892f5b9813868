"""Compiled: a binary heap of a key and two numbers in arrays, the least first.

heapq on a list also works in compiled code, but counts references at every step.

Decides: how the heap is kept.  Must not know: what the numbers mean.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.base.compiled import allocation_free, compiled


class Heap(NamedTuple):
    """The first size[0] entries of keys (n,) and pairs (n, 2), in the order of a binary heap."""

    keys: npt.NDArray[np.float64]
    pairs: npt.NDArray[np.int64]
    size: npt.NDArray[np.int64]


@compiled
def empty_heap(room: int) -> Heap:
    """Return a heap with room for so many entries."""
    return Heap(np.empty(room), np.empty((room, 2), np.int64), np.zeros(1, np.int64))


@compiled
def wider_heap(heap: Heap) -> Heap:
    """Return a heap with the same entries and twice the room."""
    keys, pairs, size = heap
    wider = empty_heap(2 * len(keys))
    wider.keys[: len(keys)], wider.pairs[: len(keys)], wider.size[0] = keys, pairs, size[0]
    return wider


@allocation_free
def push(heap: Heap, key: float, first: int, second: int) -> None:
    """Add an entry; there must be room for it."""
    keys, pairs = heap.keys, heap.pairs
    at = heap.size[0]
    heap.size[0] = at + 1
    while at > 0:
        above = (at - 1) // 2
        if not _is_before(key, first, second, heap, above):
            break
        keys[at], pairs[at, 0], pairs[at, 1] = keys[above], pairs[above, 0], pairs[above, 1]
        at = above
    keys[at], pairs[at, 0], pairs[at, 1] = key, first, second


@allocation_free
def pop(heap: Heap) -> tuple[int, int]:
    """Remove the least entry, by key and then by the pair; return its pair.

    There must be an entry.
    """
    keys, pairs = heap.keys, heap.pairs
    found = int(pairs[0, 0]), int(pairs[0, 1])
    last = heap.size[0] - 1
    heap.size[0] = last
    key, first, second = keys[last], pairs[last, 0], pairs[last, 1]
    at, below = 0, 1
    while below < last:
        right = below + 1
        if right < last and _is_before(keys[right], pairs[right, 0], pairs[right, 1], heap, below):
            below = right
        if not _is_before(keys[below], pairs[below, 0], pairs[below, 1], heap, last):
            break
        keys[at], pairs[at, 0], pairs[at, 1] = keys[below], pairs[below, 0], pairs[below, 1]
        at, below = below, 2 * below + 1
    keys[at], pairs[at, 0], pairs[at, 1] = key, first, second
    return found


@allocation_free
def _is_before(key: float, first: int, second: int, heap: Heap, at: int) -> bool:
    """Tell whether an entry comes before the one at a place of the heap."""
    if key != heap.keys[at]:
        return bool(key < heap.keys[at])
    if first != heap.pairs[at, 0]:
        return bool(first < heap.pairs[at, 0])
    return bool(second < heap.pairs[at, 1])
