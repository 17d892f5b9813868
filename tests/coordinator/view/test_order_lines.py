"""What the terminal says of orders."""

from coordinator.view.live_table import FleetTable
from coordinator.view.order_lines import order_line
from protocol.messages import (
    CANCELLED,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    Cancel,
    OrderState,
)
from protocol.messages import Order as Said
from tests.coordinator.base.test_text_table import shown
from tests.sim.world.test_orders_in_time import a_world, hall, operator


def clock(ms):
    return f"12:00:{ms // 1000:02d}"


def test_a_line_says_who_does_an_order_and_when_or_why_nobody_does():
    said = {
        OrderState("o", WAITING, "R1", 0, reason="R1 does n first"): "o waits: R1 does n first",
        OrderState("o", UNDER_WAY, "R1", 0, 100, 9_000): (
            "o: R1 is under way, arrives 12:00:09 (9.0 s)"
        ),
        OrderState("o", ORDER_DONE, "R1", 0, 100, 9_000, 9_150): "o is done by R1",
        OrderState("o", ORDER_DONE, "R1", 0, 100, 9_000, 11_500): "o is done by R1, 2.5 s late",
        OrderState("leave-R1", ORDER_DONE, "R1", reason="R1 was not heard"): (
            "leave-R1 is done: R1 was not heard"
        ),
        OrderState("o", CANCELLED, "R1"): "o is cancelled",
        OrderState("o", REFUSED, reason="nobody can"): "o is refused: nobody can",
    }
    assert {state: order_line(state, clock) for state in said} == said


def test_who_does_not_know_when_the_first_go_was_is_told_times_since_then():
    under_way = OrderState("o", UNDER_WAY, "R1", 0, 100, 9_000)
    assert order_line(under_way) == "o: R1 is under way, arrives 9.0 s after the first GO"


def told(world):
    """What people are told of orders, in words."""
    incidents = [one for one in world.fleet.incidents if one.kind == "order state"]
    return [order_line(one.order, clock) for one in incidents]


def test_every_change_of_an_order_is_told_once_and_the_table_shows_what_is_under_way():
    world = a_world(hall(), stays=True)
    say = operator(world)
    world.run(1.0)
    say(Said(1, "one", (8.0, 3.0), "R1"))
    say(Said(1, "two", (2.0, 3.0), "R1"))
    say(Said(1, "off", (60.0, 3.0), "R2"))
    world.run(2.0)
    say(Cancel(1, "two"))
    table = FleetTable(world.mission.document, clock)
    picture = shown(table.render(world.fleet, world.now_ns), width=160)
    assert "orders: 1 under way, 1 waiting, 1 over" in picture
    (row,) = [line for line in picture.splitlines() if line.startswith("│ one ")]
    assert "R1" in row
    assert "under way │ arrives 12:00:" in row
    (robot,) = [line for line in picture.splitlines() if line.startswith("│ R1 ")]
    assert "moving │ one" in robot
    world.run(40.0)
    lines = told(world)
    assert [line.split(", ")[0] for line in lines if line.startswith(("one", "two"))] == [
        "one: R1 is under way",
        "two waits: R1 does one first",
        "two is cancelled",
        "one is done by R1",
    ]
    (refused,) = [line for line in lines if line.startswith("off")]
    assert refused.startswith("off is refused: R2 ")
