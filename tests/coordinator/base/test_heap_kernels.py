"""The compiled heap gives its entries in the order of heapq."""

import heapq

import hypothesis.strategies as st
from hypothesis import given

from coordinator.base.heap_kernels import empty_heap, pop, push, wider_heap

_ENTRIES = st.tuples(st.sampled_from([0.0, 0.5, 1.0, 2.5]), st.integers(-3, 3), st.integers(-3, 3))


@given(st.lists(st.none() | _ENTRIES, max_size=60))
def test_entries_come_in_the_order_of_heapq_whenever_they_are_taken(steps):
    heap, expected = empty_heap(1), []
    for entry in steps:
        if entry is not None:
            if heap.size[0] == len(heap.keys):
                heap = wider_heap(heap)
            push(heap, *entry)
            heapq.heappush(expected, entry)
        elif expected:
            assert pop(heap) == heapq.heappop(expected)[1:]
    assert heap.size[0] == len(expected)
    while expected:
        assert pop(heap) == heapq.heappop(expected)[1:]
