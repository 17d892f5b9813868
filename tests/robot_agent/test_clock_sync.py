from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_agent.clock_sync import ClockSync

MS = 1_000_000
SECOND = 1_000_000_000

delays = st.integers(0, 30 * MS)


@settings(derandomize=True, max_examples=100)
@given(
    st.integers(-(10**15), 10**15),
    st.integers(-50, 50),
    st.lists(st.tuples(delays, delays, delays), min_size=1, max_size=30),
)
def test_the_bound_holds_whatever_the_delays_and_the_drift(offset, ppm, exchanges):
    sync = ClockSync()

    def coordinator(own: int) -> int:
        return own + offset + own * ppm // 1_000_000

    now = 0
    for there, thinking, back in exchanges:
        sent = now
        received = coordinator(sent + there)
        answered = coordinator(sent + there + thinking)
        now = sent + there + thinking + back
        assert sync.add(sent, received, answered, now) or ppm
        error = abs(now + sync.offset_ns - coordinator(now))
        assert error <= sync.error_ns(now) + 2_000 or not sync.good
        now += 2 * SECOND


def test_the_best_exchange_wins_until_drift_has_worn_it_out():
    sync = ClockSync()
    assert sync.add(0, 1_000, 1_000, 2_000)
    assert sync.add(SECOND, SECOND + 40 * MS, SECOND + 40 * MS, SECOND + 41 * MS)
    assert sync.offset_ns == 0
    late = 500 * SECOND
    assert sync.error_ns(late) == pytest.approx(25 * MS, rel=0.01)
    assert sync.add(late, late + 12 * MS, late + 12 * MS, late + 20 * MS)
    assert (sync.offset_ns, sync.error_ns(late + 20 * MS)) == (2 * MS, 10 * MS)


@pytest.mark.parametrize(
    "stamps",
    [
        (10, 5, 4, 20),
        (10, 0, 15, 20),
        (30, 5, 5, 20),
        (0, 5, 5, 11 * SECOND),
    ],
)
def test_stamps_that_cannot_be_true_are_left_out(stamps):
    sync = ClockSync()
    assert not sync.add(*stamps)
    assert sync.good == 0


def test_answers_to_questions_from_before_a_reset_do_not_count():
    sync = ClockSync()
    sync.add(0, 100, 100, 10)
    sync.reset(50)
    assert sync.error_ns(50) > 10**15
    assert not sync.add(40, 140, 140, 60)
    assert sync.add(50, 155, 155, 60)
    assert sync.offset_ns == 100


def test_a_robot_on_the_move_slews_to_a_better_offset_within_its_bound():
    sync = ClockSync()
    truth = 300 * MS
    sync.add(0, 380 * MS, 380 * MS, 160 * MS)
    assert abs(sync.offset_ns - truth) <= sync.error_ns(160 * MS) == 80 * MS
    sync.follow(160 * MS, True)
    now = 200 * MS
    sync.add(now, now + truth + MS, now + truth + MS, now + 2 * MS)
    before, ended = sync.offset_ns, 0
    for now in range(210 * MS, 6000 * MS, 10 * MS):
        sync.follow(now, True)
        assert abs(sync.offset_ns - before) <= 10 * MS // 50 + 2 * MS // 50
        assert abs(sync.offset_ns - truth) <= sync.error_ns(now)
        ended = ended or (now if sync.offset_ns == truth else 0)
        before = sync.offset_ns
    assert abs(sync.offset_ns - truth) <= MS
    assert sync.error_ns(now) < 2 * MS
