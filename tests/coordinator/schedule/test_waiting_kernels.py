"""The kernels of the search for waits, each against the plainest way to say what it does."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.schedule.waiting_kernels import ForbiddenTimes, safe_times


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    rows=st.lists(
        st.tuples(st.integers(0, 2), st.integers(-20, 20), st.integers(0, 15)), max_size=12
    ),
    asks=st.lists(st.booleans(), min_size=4, max_size=4),
    polite=st.booleans(),
)
def test_safe_times_are_those_in_no_ban_of_the_cell(rows, asks, polite):
    zones = [sorted(rows[k::4]) for k in range(4) if rows[k::4]]
    flat = np.array([row for zone in zones for row in zone], float).reshape(-1, 3)
    cell, begin, lasts = (column.copy() for column in flat.T)
    low = np.where(asks[: len(zones)], 0.0, np.inf)
    first = np.cumsum([0, *map(len, zones)])
    spans = 0.01 * np.array([[zone[0][0], zone[-1][0] + 1] for zone in zones]).reshape(-1, 2)
    forbidden = ForbiddenTimes(
        first, cell.astype(int), begin, begin + lasts, low, np.maximum(low, 1.0), spans
    )
    found = safe_times(forbidden, 0.015, 1, polite)
    assert np.all(found[:, 0] < found[:, 1])
    assert np.all(found[1:, 0] > found[:-1, 1])
    asked = np.repeat(np.array(asks[: len(zones)], bool), np.diff(first))
    spanned = [zone[0][0] <= 1 <= zone[-1][0] for zone in zones]
    unknown = any(s and not a for s, a in zip(spanned, asks, strict=False))
    for t in np.arange(-25.25, 40.0, 0.5):
        here = asked & (cell == 1) & (lasts > 0)
        inside = here & (t < begin + lasts) & (polite | (t > begin))
        safe = not inside.any() and not (polite and unknown)
        assert safe == bool(np.any((found[:, 0] <= t) & (t <= found[:, 1])))
