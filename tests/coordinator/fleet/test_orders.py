"""The order book: which orders are known, who does them, when they are over."""

from itertools import pairwise

import msgspec
import numpy as np
import pytest

from coordinator.fleet.orders import OrderBook, PlainBook
from coordinator.fleet.task import known_order, order_of
from coordinator.scenario.model import Demand, Order
from protocol import messages
from protocol.messages import CANCELLED, ORDER_DONE, REFUSED, UNDER_WAY, WAITING

ROBOTS = ("R1", "R2")


def look(book, now_ms, arrived=(), taken=()):
    def are_free(_, places):
        return np.array([tuple(place) not in taken for place in places.tolist()])

    book.look(now_ms, lambda robot, _: robot in arrived, are_free)


def begin(book, order_id, robot, now_ms):
    task = book.tasks[order_id]
    task.state, task.robot, task.accepted_ms = UNDER_WAY, robot, now_ms
    return task


def ids(tasks):
    return [task.order.id for task in tasks]


def test_an_order_is_known_from_its_release_on_or_when_the_one_before_is_over():
    orders = (
        Order(id="a", goal=(1.0, 1.0), robot="R1", release=2.0),
        Order(id="b", goal=(2.0, 1.0), robot="R1", after="a"),
    )
    book = OrderBook(orders, robots=ROBOTS)
    look(book, 1_900)
    assert (ids(book.waiting()), book.is_open, book.is_quiet) == ([], True, True)
    look(book, 2_000)
    assert (ids(book.waiting()), book.is_quiet) == (["a"], False)
    begin(book, "a", "R1", 2_100)
    look(book, 5_000)
    assert book.tasks["a"].arrived_ms is None
    look(book, 6_000, arrived=["R1"])
    look(book, 6_100, arrived=["R1"])
    assert book.tasks["a"].state == ORDER_DONE
    assert ids(book.waiting()) == ["b"]


def test_an_order_is_done_when_its_robot_has_stood_at_the_goal_for_its_dwell():
    book = OrderBook((Order(id="a", goal=(1.0, 1.0), dwell=3.0),), robots=ROBOTS)
    look(book, 0)
    begin(book, "a", "R2", 0)
    look(book, 4_000, arrived=["R2"])
    assert (book.tasks["a"].arrived_ms, book.tasks["a"].state) == (4_000, UNDER_WAY)
    look(book, 6_900, arrived=["R2"])
    assert book.of_robot("R2") is book.tasks["a"]
    look(book, 7_000, arrived=["R2"])
    assert book.tasks["a"].state == ORDER_DONE
    assert not book.is_open


def test_a_higher_priority_goes_first_and_making_room_before_all():
    book = OrderBook(robots=ROBOTS)
    book.give(Order(id="low", goal=(1.0, 1.0)), 0)
    book.give(Order(id="high", goal=(1.0, 1.0), priority=5), 0)
    book.room_for("R1", (0.0, 0.0), "high", 0)
    assert ids(book.waiting()) == ["room-1", "high", "low"]


def test_the_same_id_twice_is_the_same_order_and_a_stranger_is_refused():
    book = OrderBook(robots=ROBOTS)
    first = book.give(Order(id="a", goal=(1.0, 1.0)), 0)
    assert book.give(Order(id="a", goal=(9.0, 9.0)), 50) is first
    refused = book.give(Order(id="b", goal=(1.0, 1.0), robot="R9"), 0)
    assert (refused.state, refused.reason) == (REFUSED, "there is no robot R9 in this fleet")


def test_a_robot_leaves_a_cancelled_order_for_its_next_one_or_makes_room():
    book = OrderBook(robots=ROBOTS)
    for name in ("a", "b"):
        book.give(Order(id=name, goal=(1.0, 1.0), robot="R1"), 0)
    begin(book, "a", "R1", 0)
    assert book.cancel("a", 10).state == CANCELLED
    assert [(t.order.id, t.is_urgent) for t in book.waiting()] == [("b", True)]
    begin(book, "b", "R1", 20)
    book.cancel("b", 30)
    (room,) = book.waiting()
    assert (room.makes_room, room.is_urgent, room.robot) == (True, True, "R1")
    assert book.cancel("nothing", 30) is None


def test_an_order_that_is_cancelled_before_it_is_known_is_over():
    book = OrderBook((Order(id="a", goal=(1.0, 1.0), release=50.0),), robots=ROBOTS)
    assert book.cancel("a", 10).state == CANCELLED
    assert not book.is_open


def test_demand_gives_each_robot_its_orders_one_after_another_to_free_places():
    places = ((1.0, 1.0), (2.0, 2.0), (3.0, 3.0))
    demand = Demand(places=places, per_robot=3, first_within=5.0, seed=4)
    book, now = OrderBook(demand=demand, robots=ROBOTS), 0
    goals = {robot: [] for robot in ROBOTS}
    while book.is_open:
        now += 100
        look(book, now, arrived=ROBOTS, taken=[goal[-1] for goal in goals.values() if goal])
        for task in book.waiting():
            goals[task.robot].append(task.order.goal)
            begin(book, task.order.id, task.robot, now)
        bound = [task.order.goal for task in book.under_way()]
        assert len(set(bound)) == len(bound)
    assert [len(goal) for goal in goals.values()] == [3, 3]
    assert all(a != b for goal in goals.values() for a, b in pairwise(goal))
    assert all(task.released_ms <= 5_100 for name, task in book.tasks.items() if name[-1] == "1")


def test_what_changed_is_said_once():
    book = OrderBook((Order(id="a", goal=(1.0, 1.0)),), robots=ROBOTS)
    assert book.changed() == []
    look(book, 0)
    assert [one.state for one in book.changed()] == [WAITING]
    assert book.changed() == []
    begin(book, "a", "R1", 10)
    look(book, 20, arrived=["R1"])
    assert [one.state for one in book.changed()] == [ORDER_DONE]
    assert [one.state for one in book.states()] == [ORDER_DONE]
    assert book.changed() == []


def test_orders_that_nobody_can_do_are_refused_those_that_are_not_known_too():
    orders = (Order(id="a", goal=(1.0, 1.0)), Order(id="b", goal=(1.0, 1.0), after="a"))
    book = OrderBook(orders, robots=ROBOTS)
    look(book, 0)
    book.refuse_all(lambda task: f"{task.order.id} cannot be done")
    assert [task.state for task in book.tasks.values()] == [REFUSED, REFUSED]
    assert not book.is_open


def test_a_demand_of_robots_that_cannot_go_on_gives_no_further_orders():
    demand = Demand(places=((1.0, 1.0), (2.0, 2.0)), per_robot=3, first_within=5.0, seed=4)
    book = OrderBook(demand=demand, robots=ROBOTS)
    look(book, 100)
    book.refuse_all(lambda task: f"{task.order.id} cannot be done")
    assert not book.is_open
    known = len(book.tasks)
    look(book, 60_000, arrived=ROBOTS)
    assert len(book.tasks) == known


def test_a_message_becomes_an_order():
    said = messages.Order(7, "a", (1.0, 2.0, 0.5), "R1", ((3.0, 4.0),), 1_500, 2)
    assert order_of(said) == Order(
        id="a", goal=(1.0, 2.0, 0.5), robot="R1", via=((3.0, 4.0),), dwell=1.5, priority=2
    )


def test_an_operators_order_that_comes_later_waits_and_says_for_what():
    book = OrderBook((), robots=ROBOTS)
    first, second = (
        Order(id="a", goal=(1.0, 1.0), release=9.0),
        Order(id="b", goal=(2.0, 1.0), after="a"),
    )
    told = [book.put_off(one, 1_000) for one in (first, second, first)]
    assert [one.state for one in told] == [WAITING] * 3
    assert [one.reason for one in told] == [
        "waits until 9 s after the first GO",
        "waits for a to end",
        "waits until 9 s after the first GO",
    ]
    lost = book.put_off(Order(id="c", goal=(2.0, 1.0), after="nobody"), 1_000)
    assert (lost.state, lost.reason) == (REFUSED, "there is no order nobody to come after")
    assert book.put_off(Order(id="d", goal=(2.0, 1.0)), 1_000) is None
    other = OrderBook((), robots=ROBOTS)
    other.take_plain(msgspec.convert(msgspec.to_builtins(book.plain()), PlainBook))
    for one in (book, other):
        look(one, 9_000)
        assert ids(one.waiting()) == ["a"]
        one.cancel("a", 9_000)
        look(one, 9_100)
        assert ids(one.waiting()) == ["b"]


def test_an_order_with_the_id_of_one_to_another_goal_or_for_another_robot_is_another_one():
    later = Order(id="b", goal=(5.0, 5.0), release=9.0)
    book = OrderBook((later,), robots=ROBOTS)
    given = Order(id="a", goal=(1.0, 1.0), robot="R1")
    book.give(given, 0)
    for order, other in (
        (given, None),
        (msgspec.structs.replace(given, goal=(1.0, 1.0, 0.0)), given),
        (msgspec.structs.replace(given, robot=""), given),
        (Order(id="b", goal=(1.0, 1.0)), later),
        (Order(id="c", goal=(1.0, 1.0)), None),
    ):
        assert book.other(order) == other
    assert known_order(given, 7) == messages.Order(7, "a", (1.0, 1.0), "R1")


@pytest.mark.parametrize("is_old", [False, True])
def test_where_an_order_led_that_was_over_is_in_a_checkpoint_but_not_in_an_old_one(is_old):
    book, order = OrderBook(robots=ROBOTS), Order(id="a", goal=(1.0, 1.0))
    book.end(book.give(order, 0), ORDER_DONE)
    resumed = OrderBook(robots=ROBOTS)
    told = msgspec.convert(msgspec.to_builtins(book.plain()), PlainBook)
    resumed.take_plain(msgspec.structs.replace(told, led_to={}) if is_old else told)
    assert resumed.tasks["a"].is_over
    other = resumed.other(Order(id="a", goal=(2.0, 2.0)))
    assert other == (None if is_old else order)


def make_room(book, now_ms, robot="R1", goal=(5.0, 5.0)):
    """Let a robot make room for another order, and go back to its goal at (1, 1) later."""
    room = book.room_for(robot, goal, "way-9", now_ms)
    room.returns_to = (1.0, 1.0)
    return begin(book, room.order.id, robot, now_ms)


def test_who_made_room_goes_back_once_when_nobody_else_has_an_order():
    book = OrderBook(robots=ROBOTS)
    book.go_around("R2", (0, (9.0, 9.0), ()), "R3", 0)
    for now_ms in (1_000, 2_000):
        room = make_room(book, now_ms)
        look(book, now_ms + 500, arrived=["R1"])
        assert room.state == ORDER_DONE
    assert ids(book.waiting()) == ["way-1"]
    begin(book, "way-1", "R2", 3_000)
    assert book.waiting() == []
    look(book, 4_000, arrived=["R2"])
    (back,) = book.waiting()
    assert (back.order.robot, back.order.goal) == ("R1", (1.0, 1.0))
    assert book.is_open
    assert not book.is_used
    begin(book, back.order.id, "R1", 5_000)
    look(book, 6_000, arrived=["R1"])
    assert not book.is_open


def test_who_made_room_goes_back_too_when_the_others_cannot_get_on():
    book = OrderBook(robots=ROBOTS)
    book.go_around("R2", (0, (9.0, 9.0), ()), "R3", 0)
    make_room(book, 1_000)
    look(book, 2_000, arrived=["R1"])
    book.refuse_stuck(lambda _: "no way")
    assert book.tasks["way-1"].state == REFUSED
    (back,) = book.waiting()
    assert back.order.robot == "R1"
    book.refuse_stuck(lambda _: "no way")
    assert not book.is_open


def test_who_made_room_goes_back_too_when_it_finds_no_way_on_after_going_around():
    """It has left its goal, goes around another robot, and then the place is out of reach."""
    book = OrderBook(robots=ROBOTS)
    room = make_room(book, 1_000)
    room.revision = 1
    book.go_around("R1", (1, (3.0, 3.0), ()), "R2", 2_000)
    assert ids(book.waiting()) == [room.order.id]
    book.end(room, REFUSED, "has no way")
    (back,) = book.waiting()
    assert (back.order.robot, back.order.goal) == ("R1", (1.0, 1.0))


def test_who_was_to_make_room_and_never_left_its_place_is_not_sent_back():
    book = OrderBook(robots=ROBOTS)
    room = book.room_for("R1", (5.0, 5.0), "way-9", 1_000)
    room.returns_to = (1.0, 1.0)
    book.end(room, REFUSED, "has no way")
    assert not book.is_open


def test_an_order_that_waits_to_go_back_survives_a_checkpoint():
    book = OrderBook(robots=ROBOTS)
    make_room(book, 1_000)
    kept = msgspec.msgpack.decode(msgspec.msgpack.encode(book.plain()), type=PlainBook)
    other = OrderBook()
    other.take_plain(kept)
    assert other.plain() == book.plain()
    look(other, 2_000, arrived=["R1"])
    (back,) = other.waiting()
    assert (back.is_return, back.order.goal) == (True, (1.0, 1.0))


def test_a_new_plan_leads_those_that_made_room_back_unless_they_have_no_way():
    book, ends = OrderBook(robots=ROBOTS), {"R1": (1.0, 1.0), "R2": (1.0, 1.0)}
    make_room(book, 1_000, robot="R2")
    look(book, 2_000, arrived=["R2"])
    (back,) = book.waiting()
    back.rooms = 7
    room = make_room(book, 3_000)
    assert book.homes() == ends
    book.begin_epoch({"R1", "R2"}, {})
    assert room.state == CANCELLED
    assert [(one.robot, one.is_return) for one in book.under_way()] == [("R2", True), ("R1", True)]
    assert (book.homes(), back.rooms) == (ends, 0)
    book.begin_epoch({"R1"}, {"R2": "R3 is in its way"})
    assert (back.state, back.reason) == (REFUSED, "R3 is in its way")
    look(book, 9_000, arrived=["R1"])
    assert (book.is_open, book.homes()) == (False, {})


def test_who_goes_around_something_has_the_places_to_pass_that_are_left():
    order = Order(id="a", goal=(9.0, 1.0), robot="R1", via=((2.0, 1.0), (4.0, 1.0)))
    book = OrderBook((order,), robots=ROBOTS)
    look(book, 0)
    begin(book, "a", "R1", 0).revision = 1
    book.go_around("R1", (1, (9.0, 1.0), ((4.0, 1.0),)), "R2", 1_000)
    task = book.tasks["a"]
    assert (task.state, task.is_urgent, task.order.via) == (WAITING, True, ((4.0, 1.0),))
    book.go_around("R2", (3, (8.0, 8.0, 0.5), ((5.0, 5.0),)), "R3", 1_000)
    own = book.tasks["way-1"].order
    assert (own.robot, own.goal, own.via) == ("R2", (8.0, 8.0, 0.5), ((5.0, 5.0),))
    assert book.is_used


def test_an_order_that_was_not_begun_keeps_all_places_to_pass():
    order = Order(id="a", goal=(9.0, 1.0), robot="R1", via=((2.0, 1.0),))
    book = OrderBook((order,), robots=ROBOTS)
    look(book, 0)
    book.go_around("R1", (0, (3.0, 3.0), ()), "R2", 1_000)
    assert book.tasks["a"].order.via == ((2.0, 1.0),)
