from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_agent.core.clock_sync import ClockSync

MS = 1_000_000
SECOND = 1_000_000_000

delays = st.integers(0, 30 * MS)


def exchange(sync: ClockSync, sent: int, received: int, answered: int, heard: int) -> bool:
    """Ask and hear the answer."""
    sync.ask(sent)
    return sync.add(sent, received, answered, heard)


@settings(derandomize=True, max_examples=200)
@given(
    st.integers(-(10**15), 10**15),
    st.integers(-100, 100),
    st.lists(st.tuples(delays, delays, delays, st.booleans()), min_size=1, max_size=30),
)
def test_the_bound_holds_whatever_the_delays_and_the_drift(offset, ppm, exchanges):
    sync = ClockSync()

    def coordinator(own: int) -> int:
        return own + offset + own * ppm // 1_000_000

    now = 0
    for there, thinking, back, moving in exchanges:
        sent = now
        received = coordinator(sent + there)
        answered = coordinator(sent + there + thinking)
        now = sent + there + thinking + back
        sync.follow(now, moving)
        assert exchange(sync, sent, received, answered, now)
        error = abs(now + sync.offset_ns - coordinator(now))
        assert error <= sync.error_ns(now)
        now += 2 * SECOND


class Exchanges:
    """A robot's clock that may be set or stopped, and its exchanges with a coordinator."""

    def __init__(self, delay: int = 2 * MS) -> None:
        self.sync = ClockSync()
        self.truth = 50 * SECOND
        self.behind = 0
        self.delay = delay

    @property
    def own(self) -> int:
        return self.truth - self.behind

    @property
    def error(self) -> int:
        return abs(self.own + self.sync.offset_ns - self.truth)

    def exchange(self, stops: tuple[int, int] = (0, 0)) -> bool:
        """Ask and hear; the robot's clock stops for so long on the way there and back."""
        sent = self.own
        self.truth += self.delay + stops[0]
        told = self.truth
        self.truth += self.delay + stops[1]
        self.behind += sum(stops)
        return exchange(self.sync, sent, told, told, self.own)


@pytest.mark.parametrize("seconds", [-6.0, -0.45, 0.01, 0.45, 6.0])
@pytest.mark.parametrize("delay", [0, 2 * MS])
def test_an_exchange_after_the_clock_was_set_or_stopped_contradicts_those_before(seconds, delay):
    line = Exchanges(delay)
    for _ in range(8):
        assert line.exchange()
        line.truth += 2 * SECOND
    line.behind += round(seconds * SECOND)
    assert not line.exchange()
    line.sync.start_over(line.own)
    assert line.exchange()
    assert line.error <= line.sync.error_ns(line.own) <= delay + 2_000


@pytest.mark.parametrize("seconds", [0.01, 0.45, 6.0])
@pytest.mark.parametrize("way", [0, 1])
def test_a_clock_that_stops_during_an_exchange_is_found_out_by_the_next_one(seconds, way):
    line, stop = Exchanges(), round(seconds * SECOND)
    assert line.exchange()
    assert not (line.exchange((stop, 0) if way == 0 else (0, stop)) and line.exchange())


@pytest.mark.parametrize(("seconds", "is_found"), [(0.45, True), (6.0, True), (-6.0, False)])
def test_a_command_said_later_than_it_can_be_shows_that_the_robots_clock_stopped(seconds, is_found):
    line = Exchanges()
    assert line.exchange()
    assert not line.sync.is_said_in_future(line.truth, line.own)
    line.behind += round(seconds * SECOND)
    assert line.sync.is_said_in_future(line.truth, line.own) == is_found


def test_nothing_is_said_in_the_future_of_a_clock_that_is_not_known():
    assert not ClockSync().is_said_in_future(10**18, 0)


@pytest.mark.parametrize("jump", [0, -6 * SECOND, 6 * SECOND, 20 * MS])
def test_a_doubted_offset_counts_again_once_a_new_exchange_agrees_with_it(jump):
    line = Exchanges()
    assert line.exchange()
    line.behind += jump
    line.sync.doubt(line.own)
    assert line.sync.error_ns(line.own) > 10**15
    assert line.exchange() == (jump == 0)
    assert (line.sync.error_ns(line.own) < 3 * MS) == (jump == 0)


def test_a_doubted_clock_is_asked_for_at_once_and_often():
    sync = ClockSync()
    asked = 0
    for now in range(0, SECOND, 10 * MS):
        if sync.due(now, MS, True):
            asked += 1
            assert sync.add(now, now, now, now)
    assert asked == 1
    sync.doubt(SECOND)
    assert [
        now for now in range(SECOND, SECOND + 100 * MS, 10 * MS) if sync.due(now, MS, True)
    ] == [
        SECOND,
        SECOND + 40 * MS,
        SECOND + 80 * MS,
    ]


def test_what_exchanges_have_in_common_is_believed_until_drift_has_worn_it_out():
    sync = ClockSync()
    assert exchange(sync, 0, 1_000, 1_000, 2_000)
    assert (sync.offset_ns, sync.error_ns(2_000)) == (0, 1_002)
    assert exchange(sync, SECOND, SECOND + 40 * MS, SECOND + 40 * MS, SECOND + 41 * MS)
    assert sync.error_ns(SECOND + 41 * MS) < 110_000
    late = 500 * SECOND
    assert sync.error_ns(late) == pytest.approx(50 * MS, rel=0.01)
    assert exchange(sync, late, late + 12 * MS, late + 12 * MS, late + 20 * MS)
    assert (sync.offset_ns, sync.error_ns(late + 20 * MS)) == (2 * MS, 10 * MS + 2_002)


@pytest.mark.parametrize("stamps", [(10, 5, 4, 20), (30, 5, 5, 20), (0, 5, 5, 11 * SECOND)])
def test_stamps_that_no_exchange_has_are_left_out(stamps):
    sync = ClockSync()
    assert exchange(sync, *stamps)
    assert sync.good == 0


def test_an_answer_to_no_question_does_not_count():
    sync = ClockSync()
    sync.ask(10)
    for sent in (9, 11, -(2**62), 2**62):
        assert sync.add(sent, 105, 105, 20)
    assert sync.good == 0
    assert sync.add(10, 105, 105, 20)
    assert sync.good == 1


def test_a_question_that_is_answered_is_closed():
    sync = ClockSync()
    assert exchange(sync, 10, 110, 110, 12)
    known = sync.offset_ns, sync.error_ns(14)
    for stamps in ((110, 110), (10**9, 10**9)):
        assert sync.add(10, *stamps, 14)
    assert (sync.offset_ns, sync.error_ns(14), sync.good) == (*known, 1)


def test_the_newest_sixteen_questions_stay_open_and_may_be_answered_in_any_order():
    sync = ClockSync()
    for sent in range(20):
        sync.ask(sent)
    for sent in (3, 19, 4, 0, 11):
        assert sync.add(sent, sent + 100, sent + 100, 25)
    assert sync.good == 3


def test_answers_to_questions_from_before_a_start_do_not_count():
    sync = ClockSync()
    exchange(sync, 0, 100, 100, 10)
    sync.ask(40)
    sync.start_over(50)
    assert sync.error_ns(50) > 10**15
    assert sync.add(40, 140, 140, 60)
    assert sync.good == 0
    assert exchange(sync, 50, 155, 155, 60)
    assert sync.offset_ns == 100


def test_a_robot_on_the_move_slews_to_a_better_offset_within_its_bound():
    sync = ClockSync()
    truth = 300 * MS
    exchange(sync, 0, 320 * MS, 320 * MS, 160 * MS)
    assert sync.offset_ns == truth - 60 * MS
    assert sync.error_ns(160 * MS) == 80 * MS + 16_002
    sync.follow(160 * MS, True)
    now = 200 * MS
    sync.follow(now, True)
    exchange(sync, now, now + truth + MS, now + truth + MS, now + 2 * MS)
    before, ended = sync.offset_ns, 0
    for now in range(210 * MS, 6000 * MS, 10 * MS):
        sync.follow(now, True)
        assert abs(sync.offset_ns - before) <= 10 * MS // 50 + 2 * MS // 50
        assert abs(sync.offset_ns - truth) <= sync.error_ns(now)
        ended = ended or (now if sync.offset_ns == truth else 0)
        before = sync.offset_ns
    assert 3000 * MS <= ended <= 3300 * MS
    assert abs(sync.offset_ns - truth) <= MS
    assert sync.error_ns(now) < 2 * MS
