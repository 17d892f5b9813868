"""What the coordinator hears of all that arrives; one sender's flood is its own trouble."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.fleet.log_records import LINK_GONE
from coordinator.mission.intake import (
    MOST_STRANGERS,
    NOT_OURS,
    RATES,
    TOO_LONG,
    TOO_MANY,
    UNREADABLE,
    UNREADABLE_RATE,
    Arrival,
    Intake,
)
from coordinator.mission.lanes import DEPTH, Bucket, Lanes, Rate
from protocol import keys
from protocol.codec import encode
from protocol.messages import MAX_MESSAGE_BYTES, Clock, Command, Hello, Order, Report
from protocol.phases import MOVING
from protocol.timing import CLOCK_PERIOD_FAST, MILLISECOND, REPORT_PERIOD, SECOND

ROBOTS = ("R1", "R2")
BOOT = 5
OWN = 77


def an_intake():
    return Intake("hall", OWN, dict.fromkeys(ROBOTS, BOOT).__getitem__)


def report(robot="R1", sequence=1, boot=BOOT):
    payload = encode(Report(boot, sequence, 1, MOVING))
    return Arrival(keys.report("hall", robot), payload, None)


def heard(intake, now_ns=0):
    return list(iter(lambda: intake.take(now_ns), None))


@pytest.mark.parametrize(
    ("key", "payload", "cause"),
    [
        (keys.report("hall", "R1"), bytes(MAX_MESSAGE_BYTES + 1), TOO_LONG),
        (keys.report("other", "R1"), report().payload, NOT_OURS),
        (keys.plan("hall", "R1"), b"", NOT_OURS),
        ("splinefleet/hall/report/*", report().payload, NOT_OURS),
        ("splinefleet/hall/**", report().payload, NOT_OURS),
        ("splinefleet/hall/nonsense/R1", b"", NOT_OURS),
        ("elsewhere", b"", NOT_OURS),
    ],
)
def test_what_is_not_for_a_coordinator_is_dropped_and_counted(key, payload, cause):
    intake = an_intake()
    assert not intake.put(Arrival(key, payload, None))
    assert intake.dropped == {cause: 1}
    assert heard(intake) == []


def test_an_echo_of_what_only_this_coordinator_can_say_is_dropped():
    intake = an_intake()
    answer, command = Clock(BOOT, 1, 2, 3), Command(OWN, 1, 1, 1, MOVING, 0, 0)
    assert not intake.put(Arrival(keys.clock("hall", "R1"), encode(answer), None))
    assert not intake.put(Arrival(keys.command("hall"), encode(command), None))
    assert intake.dropped == {NOT_OURS: 2}
    other = Command(OWN + 1, 1, 1, 1, MOVING, 0, 0)
    assert intake.put(Arrival(keys.command("hall"), encode(other), None))


def test_a_flood_of_one_robot_takes_no_turn_and_no_room_from_another():
    intake = an_intake()
    for sequence in range(20_000):
        intake.put(report("R1", sequence))
    assert intake.put(report("R2", 7))
    assert report("R2", 7) in (intake.take(0), intake.take(0))
    assert intake.dropped == {TOO_MANY: 20_000 - DEPTH}


def test_of_a_flood_of_reports_the_newest_is_heard():
    intake = an_intake()
    for sequence in range(20_000):
        intake.put(report("R1", sequence))
    assert heard(intake)[-1] == report("R1", 19_999)


def test_garbage_on_a_robots_keys_pushes_none_of_its_messages_out():
    intake = an_intake()
    intake.put(report("R1", 1))
    for _ in range(20_000):
        intake.put(Arrival(keys.report("hall", "R1"), b"junk", None))
    intake.put(report("R1", 2))
    found = heard(intake)
    assert [one for one in found if one.payload != b"junk"] == [report("R1", 1), report("R1", 2)]
    assert len(found) == 2 + UNREADABLE_RATE.at_once
    assert intake.dropped[UNREADABLE] == 20_000 - DEPTH


def test_who_speaks_in_a_robots_name_pushes_nothing_out_that_its_own_process_says():
    intake = an_intake()
    intake.put(report(sequence=1))
    for number in range(20_000):
        intake.put(report(sequence=number, boot=number + 10))
    intake.put(report(sequence=2))
    own = [one for one in heard(intake) if one in (report(sequence=1), report(sequence=2))]
    assert own == [report(sequence=1), report(sequence=2)]


def test_strangers_share_one_lane_a_kind_however_many_names_they_invent():
    intake = an_intake()
    for number in range(5_000):
        intake.put(Arrival(keys.hello("hall", f"X{number}"), encode(Hello(1, number)), None))
    found = heard(intake)
    assert len(found) == RATES["hello"].at_once
    assert found[-1].key == keys.hello("hall", f"X{MOST_STRANGERS - 1}")


def test_all_desks_together_may_give_200_orders_a_second():
    intake = an_intake()
    for number in range(4_000):
        now_ns = number * SECOND // 200
        order = Arrival(
            keys.order("hall"), encode(Order(1, f"o-{number}", (1.0, float(number)))), None
        )
        assert intake.put(order)
        assert heard(intake, now_ns) == [order]
    assert intake.dropped == {}


def test_news_of_a_link_stay_in_order_with_the_reports():
    intake = an_intake()
    gone = Arrival(keys.alive("hall", "R1"), LINK_GONE, None)
    said = [report("R1", 1), gone, report("R1", 2)]
    for arrival in said:
        intake.put(arrival)
    assert heard(intake) == said


def said_by_an_honest_robot(seconds, tick_ns=10 * MILLISECOND):
    """Yield times and messages of a robot that changes its state at every tick."""
    for now in range(0, round(seconds * SECOND), tick_ns):
        yield now, report("R1", now // MILLISECOND)
        if now % REPORT_PERIOD == 0:
            yield now, Arrival(keys.hello("hall", "R1"), encode(Hello(1, 5)), None)
        if now % CLOCK_PERIOD_FAST == 0:
            yield now, Arrival(keys.clock("hall", "R1"), encode(Clock(5, now)), None)


def test_nothing_that_an_honest_robot_says_is_dropped_or_held_back():
    intake = an_intake()
    for now, arrival in said_by_an_honest_robot(30.0):
        intake.put(arrival)
        assert heard(intake, now) == [arrival]
    assert intake.dropped == {}


@pytest.mark.parametrize("robots", [1, 2])
def test_what_a_partition_held_back_is_heard_at_once_when_it_heals(robots):
    """A robot's link holds what it says for a second, then gives itself up; two are enough."""
    intake = an_intake()
    said = [arrival for _, arrival in said_by_an_honest_robot(2.0)]
    for number, arrival in itertools.product(range(robots), said):
        key = arrival.key.replace("R1", ROBOTS[number])
        intake.put(arrival._replace(key=key))
    assert len(heard(intake, 60 * SECOND)) == robots * len(said)
    assert intake.dropped == {}


@given(
    st.integers(1, 200),
    st.integers(1, 50),
    st.lists(st.integers(0, SECOND // 20), max_size=300),
)
def test_a_bucket_never_lets_more_pass_than_its_rate_nor_holds_less_back(rate, burst, gaps):
    bucket, passed = Bucket(Rate(rate, burst)), []
    tokens, last, now = float(burst), 0, 0
    period = SECOND // rate
    for gap in gaps:
        now += gap
        tokens, last = min(burst, tokens + (now - last) / period), now
        if bucket.take(now):
            passed.append(now)
            assert tokens >= 1.0 - 1e-6
            tokens -= 1.0
        else:
            assert tokens < 1.0 + 1e-6
    for first, start in enumerate(passed):
        for count, end in enumerate(passed[first:], start=1):
            assert count <= burst + (end - start) / period + 1e-6


def test_a_lane_over_its_rate_speaks_its_newest_when_it_may():
    lanes = Lanes()
    for number in range(10):
        lanes.put("a", Rate(10, 1), number)
    lanes.put("b", Rate(10, 1), "b")
    assert [lanes.take(0), lanes.take(0), lanes.take(0)] == [0, "b", None]
    assert lanes.take(SECOND // 10) == 1
